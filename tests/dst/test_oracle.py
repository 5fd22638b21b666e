"""The oracle notices robots that break a promise, and gives the same result for a seed every time."""

from __future__ import annotations

import pytest

from tests.dst.broken_promises import BREAKS
from tests.dst.drawing import draw_scenario
from tests.dst.promises import PROMISES
from tests.dst.run import run_scenario
from tests.dst.scenario import Call, Drift, Event, Failure, Scenario, Surroundings, Suspend
from tests.dst.shrinking import shrink
from tests.dst.starts import sound_walk

QUICK = Surroundings(configuration=(("motion.path_speed_rad_s", 3.0), ("motion.fade_in_s", 0.1)))
SHORT_S = 0.3
SCHEDULES: dict[str, tuple[str, tuple[Event, ...], float]] = {  # start, events and duration that show each break
    "LimitedMotors": ("stance", (Failure(0.01, "left_sweep.arm", "blocked", 0.2),), SHORT_S),
    "LittleEnergy": ("stance", (Failure(0.05, "bus.left", "stuck", 0.02),), 1.0),
    "DisarmAtOnce": ("stance", (Call(0.05, "guest", "disarm"),), SHORT_S),
    "StopInTime": ("hold", (Call(0.0, "pilot", "walk"), Call(0.1, "guest", "stop")), SHORT_S),
    "ArmedByRequest": ("stance", (Call(0.05, "guest", "disarm"),), 0.8),
    "NoTorqueWithoutMode": ("stance", (Failure(0.05, "left_sweep.error", "stuck", 0.05),), SHORT_S),
    "LeaseHeld": ("hold", (Call(0.0, "pilot", "lease", {"for_s": 1.0}), Call(0.1, "second", "walk")), SHORT_S),
    "SilentLoop": ("stance", (Suspend(0.05, 0.4, "drives.send"),), 0.6),
    "TrueTorque": ("path", (Drift(0.0, "left_sweep", {"torque_constant_error": 4.0}, 1.5),), 1.5),
    "WithinStops": ("stance", (Failure(0.0, "left_sweep.motor", "inverted", 1.2),), 1.2),
    "BoundedEnergy": ("stance", (Failure(0.0, "left_sweep.motor", "inverted", 0.6),), SHORT_S),
    "NoFalseAlarm": ("stance", (), SHORT_S),
    "NoBug": ("hold", (Call(0.05, "guest", "stop"), Call(0.1, "pilot", "clear")), SHORT_S),
    "BackToIdle": ("hold", (Failure(0.05, "left_sweep", "off", 0.05),), SHORT_S),
    "WholeLog": ("release", (), SHORT_S),
}


@pytest.fixture(scope="module", autouse=True)
def sound_robots() -> None:
    """Pass the starts of the schedules while the robot is whole."""
    for start, _, _ in SCHEDULES.values():
        sound_walk(QUICK).robot_at(start)


@pytest.mark.parametrize("promise", SCHEDULES)
def test_a_broken_promise_is_noticed(promise: str) -> None:
    scenario = Scenario(1, QUICK, *SCHEDULES[promise])
    alone = [each for each in PROMISES if each.__name__ == promise]  # no other promise notices first
    assert run_scenario(scenario, alone).problem == ""
    with BREAKS[promise]():
        assert run_scenario(scenario, alone).promise == promise


def test_every_promise_has_a_robot_that_breaks_it() -> None:
    assert {each.__name__ for each in PROMISES} <= set(BREAKS) == set(SCHEDULES)


def test_a_seed_gives_the_same_run_every_time() -> None:
    scenario = draw_scenario(3)
    first = run_scenario(scenario)
    sound_walk.cache_clear()
    assert run_scenario(scenario) == first


def test_a_failing_schedule_shrinks_to_the_event_that_matters() -> None:
    hot = Failure(0.2, "left_sweep.motor", "hot", 0.4)
    events = (Call(0.0, "viewer", "status"), Failure(0.1, "pose", "off", 0.3), hot, Call(0.3, "guest", "stop"))
    scenario = Scenario(1, Surroundings(seed=7, free_body=True), "stance", events, 1.5)
    smallest = shrink(scenario, lambda each: hot.kind in {getattr(event, "kind", "") for event in each.events})
    assert [event.component for event in smallest.events if isinstance(event, Failure)] == [hot.component]
    assert smallest.surroundings == Surroundings()
    assert smallest.for_s < 0.5


def test_a_printed_scenario_is_python() -> None:
    names = {kind.__name__: kind for kind in (Call, Failure, Scenario, Surroundings)}
    scenario = Scenario(
        1, Surroundings(), "hold", (Call(0.0, "guest", "stop"), Failure(0.1, "left_sweep.arm", "pushed", 0.2)), 1.0
    )
    assert eval(repr(scenario), names) == scenario
