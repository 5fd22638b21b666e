"""The oracle notices robots that break a promise, and gives the same result for a seed every time."""

import pytest

from tests.dst.broken_promises import BREAKS
from tests.dst.drawing import draw_scenario
from tests.dst.promises import PROMISES
from tests.dst.run import run_scenario
from tests.dst.scenario import Call, Failure, Scenario, Surroundings
from tests.dst.shrinking import shrink
from tests.dst.starts import sound_walk

QUICK = Surroundings(configuration=(("motion.path_speed_rad_s", 3.0), ("motion.fade_in_s", 0.1)))


@pytest.fixture(scope="module", autouse=True)
def sound_robots() -> None:
    """Pass the starts of the schedules while the robot is whole."""
    for broken in BREAKS.values():
        sound_walk(QUICK).robot_at(broken.start)


@pytest.mark.parametrize("promise", BREAKS)
def test_a_broken_promise_is_noticed(promise: str) -> None:
    patch, start, events, for_s = BREAKS[promise]
    scenario = Scenario(1, QUICK, start, events, for_s)
    alone = [each for each in PROMISES if each.__name__ == promise]  # no other promise notices first
    assert run_scenario(scenario, alone).problem == ""
    with patch():
        assert run_scenario(scenario, alone).promise == promise


def test_every_promise_has_a_robot_that_breaks_it() -> None:
    assert {each.__name__ for each in PROMISES} <= set(BREAKS)


def test_a_seed_gives_the_same_run_every_time() -> None:
    scenario = draw_scenario(28)
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
