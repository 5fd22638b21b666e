"""Draws scenarios from seeds, biased so that failures meet the robot, each other and the operators.

SHARED consecutive seeds share their surroundings, and with them one sound walk. Everything else is drawn for each.
"""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Any

from control.records import JOINTS
from drivers.fault_injection.failure_table import SCHEDULED
from drivers.fault_injection.failures import Failures
from tests.dst.scenario import Call, Event, Failure, HangUp, Scenario, Surroundings, Terminate, end_s
from tests.dst.starts import STUCK_M, STUCK_PA

SHARED = 16
BUSES = ("left", "right")  # of the example configuration
WEIGHTS = {"power-on": 1, "idle": 2, "hold": 3, "path": 1, "insertion": 3, "stance": 3, "extraction": 3, "release": 4}
FAILURES = {0: 1, 1: 4, 2: 5, 3: 3}  # number of failures: weight
FLAPPING = 0.2
EARLIEST_S, LATEST_S, AFTER_S = 0.02, 0.4, 0.25
TERMINATED = 0.05

COMPONENTS: dict[str, list[tuple[str, str]]] = {}  # each family's components and kinds
_FAILURES = Failures(BUSES)
for _component, _kind, _ in _FAILURES.table():
    COMPONENTS.setdefault(_FAILURES.families[_component], []).append((_component, str(_kind)))
FAMILIES = tuple(COMPONENTS)


def draw_scenario(seed: int) -> Scenario:
    surroundings = draw_surroundings(seed // SHARED)
    random = Random(f"scenario {seed}")
    start = random.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]
    failures = sorted(_draw_failures(random), key=lambda event: event.at_s)
    moments_s = [0.0, *(each for event in failures for each in (event.at_s, end_s(event)))]
    calls = list(_draw_calls(random, start, moments_s))
    events = sorted([*failures, *calls], key=lambda event: event.at_s)
    for_s = max(end_s(event) for event in (*events, HangUp(LATEST_S, ""))) + AFTER_S
    return Scenario(seed, surroundings, start, tuple(events), round(for_s, 3))


def draw_surroundings(number: int) -> Surroundings:
    random = Random(f"surroundings {number}")
    stuck = random.random() < 0.2
    return Surroundings(
        seed=number,
        strength_pa=STUCK_PA if stuck else round(random.uniform(200.0, 4000.0)),
        depth_m=STUCK_M if stuck else round(random.uniform(0.015, 0.035), 3),
        stone_m=round(random.uniform(0.0, 0.08), 3) if random.random() < 0.25 and not stuck else None,
        disturbed=random.random() < 0.3,
        free_body=random.random() < 0.2 and not stuck,
        drives=tuple(_draw_drives(random)),
        configuration=tuple(_draw_configuration(random, stuck)),
    )


def _draw_drives(random: Random) -> Iterator[tuple[str, float]]:
    if random.random() < 0.3:
        yield "current_lag_s", random.choice((0.0005, 0.001))
    if random.random() < 0.3:
        yield "cogging_nm", random.choice((0.003, 0.01))
    if random.random() < 0.3:
        yield "message_delay_s", 0.0005
    if random.random() < 0.3:
        yield "overspeed_fraction", 1.2


def _draw_configuration(random: Random, stuck: bool) -> Iterator[tuple[str, Any]]:
    """Draw changes that keep a sound robot healthy: quick paths, other gains, limits and recoveries."""
    yield "motion.path_speed_rad_s", round(random.uniform(1.5, 3.0), 1)
    yield "motion.fade_in_s", random.choice((0.1, 0.3, 0.5))
    yield "gait.swing_duration_s", random.choice((0.4, 0.6, 0.8))
    if random.random() < 0.5:
        yield "gait.insertion_speed_m_s", random.choice((0.1, 0.2))
    if random.random() < 0.3:
        yield "gains.sweep_stiffness_nm_rad", round(random.uniform(6.0, 10.0), 1)
        yield "gains.adduction_stiffness_nm_rad", round(random.uniform(8.0, 12.0), 1)
    if random.random() < 0.2 and not stuck:
        yield "limits.torque_nm", 0.6
        yield "adaptation.motor_force_n", 5.0
    if random.random() < 0.5:
        yield "recovery.attempts", random.choice((1, 2))
        yield "recovery.attempt_s", 0.3
    if random.random() < 0.3:
        yield "estimation.method", "paper"
    yield "log.rest_hz", random.choice((0.0, 0.0, 10.0))
    yield "log.rest_full_s", 0.3
    yield "log.segment_s", random.choice((1.0, 600.0))


def _draw_failures(random: Random) -> Iterator[Failure]:
    count = random.choices(list(FAILURES), list(FAILURES.values()))[0]
    at_s = round(random.uniform(EARLIEST_S, LATEST_S), 3)
    for _ in range(count):
        event = _draw_failure(random, at_s)
        if random.random() < FLAPPING:
            yield from _flapping(random, event)
        else:
            yield event
        at_s = round(at_s + random.choice((0.0, 0.003, 0.01, 0.03, 0.1, 0.3)) * random.random(), 3)


def _draw_failure(random: Random, at_s: float) -> Failure:
    for_s = round(random.choice((0.01, 0.03, 0.1, 0.3, 0.6)) * random.uniform(1.0, 2.0), 3)
    if random.random() < 0.5:
        component, kind = random.choice(list(SCHEDULED))
        return Failure(at_s, component.replace("JOINT", random.choice(JOINTS)), kind, for_s)
    component, kind = random.choice(COMPONENTS[random.choice(FAMILIES)])
    return Failure(at_s, component, kind, for_s)


def _flapping(random: Random, event: Failure) -> Iterator[Failure]:
    """Repeat a failure with short gaps, some of them shorter than its detection takes."""
    for_s, gap_s = round(random.uniform(0.01, 0.06), 3), random.uniform(0.005, 0.08)
    for number in range(random.randint(2, 5)):
        yield event._replace(at_s=round(event.at_s + number * (for_s + gap_s), 3), for_s=for_s)


def _draw_calls(random: Random, start: str, moments_s: list[float]) -> Iterator[Event]:
    """Draw the operators' calls, at or shortly after the times at which something begins or ends."""

    def moment_s() -> float:
        return round(random.choice(moments_s) + random.choice((0.0, 0.003, 0.02, 0.1)) * random.random(), 3)

    if start in ("power-on", "idle"):
        yield Call(0.0 if start == "idle" else 0.75, "pilot", "arm", {"force": random.random() < 0.3})
        yield Call(round(random.uniform(0.2, 0.4), 3), "pilot", "walk", {})
    if start == "hold":
        yield Call(0.0, "pilot", *random.choice((("walk", {}), _move(random))))
    if random.random() < 0.3:
        yield from _attend(random)
    if random.random() < 0.5:
        yield Call(moment_s(), random.choice(("pilot", "guest")), random.choice(("stop", "stop", "disarm")))
    for _ in range(random.choice((0, 1, 2, 4))):
        yield _draw_call(random, moment_s())
    if random.random() < TERMINATED:
        yield Terminate(moment_s())


def _attend(random: Random) -> Iterator[Event]:
    """Draw a program that renews its lease for a while, then stops in order, disconnects, or falls silent."""
    renewals, for_s = random.randint(1, 4), random.choice((0.1, 0.2, 1.0))
    for number in range(renewals):
        yield Call(round(0.08 * number, 3), "pilot", "lease", {"for_s": for_s})
    match random.randrange(3):
        case 0:
            yield Call(round(0.08 * renewals, 3), "pilot", "stop")
            yield Call(round(0.08 * renewals + 0.3, 3), "pilot", "release")
        case 1:
            yield HangUp(round(0.08 * renewals, 3), "pilot")


def _draw_call(random: Random, at_s: float) -> Event:
    client = random.choice(("pilot", "second", "second", "viewer", "guest"))
    if random.random() < 0.1:
        return HangUp(at_s, client)
    method, params = random.choice(
        (
            ("arm", {"force": random.random() < 0.5}),
            ("arm", {"take_over": True, "lease_s": 0.3}),
            ("walk", {"strides": 1}),
            ("walk", {"depth_m": 0.02, "take_over": True}),
            _move(random),
            ("stop", {}),
            ("disarm", {}),
            ("clear", {}),
            ("lease", {"for_s": 0.15}),
            ("release", {}),
            (random.choice(("status", "check", "map", "strides", "failures", "hello")), {}),
            ("fail", {"component": "pose", "kind": "off", "for_s": 0.05}),
        )
    )
    return Call(at_s, client, method, params)


def _move(random: Random) -> tuple[str, dict[str, Any]]:
    angles = {"left_sweep_rad": 0.3, "right_sweep_rad": -0.4, "left_adduction_rad": 0.2, "right_adduction_rad": 0.1}
    return "move", {name: angles[name] for name in random.sample(sorted(angles), 2)}
