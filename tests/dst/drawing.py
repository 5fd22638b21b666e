"""Draws scenarios from seeds, biased so that failures meet the robot, each other and the operators.

SHARED consecutive seeds share their surroundings, and with them one sound walk. Everything else is drawn for each.
"""

from collections.abc import Callable, Iterator
from enum import StrEnum
from math import exp, log
from random import Random
from typing import Any

from control.parameters.joint_gains import GAINS_OF_ASKED_DRIVES, JointGains
from control.records import JOINTS
from drivers.drive_types import DRIVE_TYPES
from drivers.fault_injection.failure_table import SCHEDULED
from drivers.fault_injection.failures import Failures
from simulation.harness.drive_presets import DRIVES
from tests.dst.operated_robot import INTRUDERS
from tests.dst.scenario import (
    LASTING,
    Call,
    Drift,
    Event,
    Failure,
    HangUp,
    Harm,
    Restart,
    Scenario,
    Send,
    Surroundings,
    Suspend,
    Terminate,
    end_s,
)
from tests.dst.starts import STUCK_M, STUCK_PA

SHARED = 16
BUSES = ("left", "right")  # of the example configuration
WEIGHTS = {"power-on": 1, "idle": 2, "hold": 3, "path": 1, "insertion": 3, "stance": 3, "extraction": 3, "release": 4}
FAILURES = {0: 1, 1: 4, 2: 5, 3: 3}  # number of failures: weight
FLAPPING = 0.2
FORCED = "watchdog_unknown"  # the check that arming by force overrules
EARLIEST_S, LATEST_S, AFTER_S = 0.02, 0.4, 0.25
TERMINATED = 0.08
HOSTILE = 0.15
PLACES = (  # where SIGSTOP may stop the daemon: between two ticks, before a part of a tick, or amid its commands
    *("", "", "drives.read", "fault_monitor.update", "controller.step", "drives.send", "recorder.put"),
    *(f"bus.{bus}" for bus in BUSES),
)
NO_REQUESTS = (
    b"",  # only the connection
    b"\x94\x00\x01\xa4walk",  # half a request
    b"\xdd\xff\xff\xff\xff",  # an array of 4 billion elements
    b"\x94" * 200,  # nested arrays
    b"\xc1" * 64,  # no MessagePack
    bytes(range(256)) * 16,
)
ATTACKS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("arm", {"force": FORCED}),
    ("arm", {"take_over": True, "force": FORCED, "lease_s": 0.1}),
    ("walk", {}),
    ("walk", {"depth_m": 0.035, "take_over": True}),
    ("walk", {"depth_m": 1e308}),
    ("move", {"left_sweep_rad": 100.0}),
    ("lease", {"for_s": 0.1}),
    ("release", {}),
    ("clear", {}),
    ("reset_timing", {}),
    ("fail", {"component": "loop", "kind": "stuck", "for_s": 0.05}),
    ("no such method", {}),
)

COMPONENTS: dict[str, list[tuple[str, str]]] = {}  # each family's components and kinds
_FAILURES = Failures(BUSES)
for _component, _kind, _ in _FAILURES.table():
    COMPONENTS.setdefault(_FAILURES.families[_component], []).append((_component, str(_kind)))
FAMILIES = tuple(COMPONENTS)


class Style(StrEnum):
    """How long a schedule is, and what its operators want."""

    USUAL = "usual"
    STUBBORN = "stubborn"  # failures outlast several attempts to clear the faults, to arm and to walk
    SLOW = "slow"  # something drifts away within up to a minute, while the robot is made to walk again and again


STYLES = {Style.USUAL: 0.87, Style.STUBBORN: 0.12, Style.SLOW: 0.01}


def draw_scenario(seed: int, style: Style | None = None) -> Scenario:
    """Draw one scenario; `style`: None draws that too."""
    surroundings = draw_surroundings(seed // SHARED)
    random = Random(f"scenario {seed}")
    drawn = random.choices(list(STYLES), list(STYLES.values()))[0]
    match style or drawn:
        case Style.USUAL:
            start, events = _draw_usual(random, _needs_force(surroundings))
        case Style.STUBBORN:
            start, events = _draw_stubborn(random, _needs_force(surroundings))
        case Style.SLOW:
            start, events = _draw_slow(random, _needs_force(surroundings))
    ordered = sorted(events, key=lambda event: event.at_s)
    for_s = max(end_s(event) for event in (*ordered, HangUp(LATEST_S, ""))) + AFTER_S
    return Scenario(seed, surroundings, start, tuple(ordered), round(for_s, 3))


def _needs_force(surroundings: Surroundings) -> bool:
    """Return whether the watchdogs of the drives cannot be read, so that they are armed by force."""
    return ":AK" in surroundings.drive_type


def _draw_usual(random: Random, forced: bool) -> tuple[str, list[Event]]:
    start = random.choices(list(WEIGHTS), list(WEIGHTS.values()))[0]
    harms = sorted(_draw_failures(random), key=lambda event: event.at_s)
    moments_s = [0.0, *(each for event in harms for each in (event.at_s, end_s(event)))]
    return start, [*harms, *_draw_calls(random, start, moments_s, forced)]


def _draw_stubborn(random: Random, forced: bool) -> tuple[str, list[Event]]:
    """Draw a failure that stays while an operator clears its faults, arms and walks, as if nothing had happened."""
    for_s = round(random.uniform(2.0, 4.0), 3)
    at_s = round(random.uniform(EARLIEST_S, LATEST_S), 3)
    harm = _draw_harm(random, at_s)
    if isinstance(harm, LASTING):
        harm = harm._replace(for_s=for_s - at_s)
    return random.choice(("hold", "path", "stance")), [harm, *_insist(random, for_s, 0.7, forced)]


def _draw_slow(random: Random, forced: bool) -> tuple[str, list[Event]]:
    for_s = round(random.uniform(15.0, 60.0), 3)
    drifts = [_draw_drift(random, round(random.uniform(0.0, 3.0), 3)) for _ in range(random.choice((1, 1, 2)))]
    drifts = [each._replace(for_s=for_s - each.at_s, over_s=round(random.uniform(0.0, for_s), 3)) for each in drifts]
    return "hold", [*drifts, *_insist(random, for_s, random.choice((2.0, 7.0, 20.0)), forced)]


def _force(random: Random, forced: bool, probability: float) -> str:
    return FORCED if forced or random.random() < probability else ""


def _insist(random: Random, for_s: float, every_s: float, forced: bool) -> Iterator[Event]:
    """Draw an operator who walks, and clears, arms and walks again every now and then."""
    yield Call(0.0, "pilot", "walk", {})
    at_s = every_s
    while at_s < for_s:
        yield Call(round(at_s, 3), "pilot", "clear", {})
        yield Call(round(at_s + 0.1, 3), "pilot", "arm", {"force": _force(random, forced, 0.5)})
        yield Call(round(at_s + 0.4, 3), "pilot", random.choice(("walk", "walk", "stop", "disarm")), {})
        at_s += every_s


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
        drive_type=(drive_type := _draw_drive_type(random, number)),
        drives=(drives := tuple(_draw_drives(random))),
        configuration=tuple(_draw_configuration(random, stuck, drive_type, "current_lag_s" in dict(drives))),
    )


def _draw_drive_type(random: Random, number: int) -> str:
    """Return every type in turn, so that few seeds have all of them; one with models has any of those."""
    name = list(DRIVE_TYPES)[number % len(DRIVE_TYPES)]
    models = [each for each in DRIVES if each.startswith(f"{name}:")]
    return random.choice(models) if models else name


def _draw_drives(random: Random) -> Iterator[tuple[str, float]]:
    if random.random() < 0.3:
        yield "current_lag_s", random.choice((0.0005, 0.001))
    if random.random() < 0.3:
        yield "cogging_nm", random.choice((0.003, 0.01))
    if random.random() < 0.3:
        yield "message_delay_s", 0.0005
    if random.random() < 0.3:
        yield "overspeed_fraction", 1.2


def _draw_configuration(random: Random, stuck: bool, drive_type: str, lags: bool) -> Iterator[tuple[str, Any]]:
    """Draw changes that keep a sound robot healthy: quick paths, other gains, limits and recoveries.

    A drive that answers only when asked is a tick later: 12 N·m/rad leave its joint, which mud throws, oscillating. A
    joint whose current lags swings to and fro four times with them, so it has at most the usual gains.
    """
    yield "motion.path_speed_rad_s", round(random.uniform(1.5, 3.0), 1)
    yield "motion.fade_in_s", random.choice((0.1, 0.3, 0.5))
    yield "gait.swing_duration_s", random.choice((0.4, 0.6, 0.8))
    if random.random() < 0.5:
        yield "gait.insertion_speed_m_s", random.choice((0.1, 0.2))
    if random.random() < 0.3:
        asked = DRIVE_TYPES[drive_type.partition(":")[0]].parameters.answers_only
        usual = GAINS_OF_ASKED_DRIVES if asked else JointGains()
        sweep, adduction = (1.0, 1.0) if lags else (1.25, 1.2)  # of the usual stiffness, at most
        yield "gains.sweep_stiffness_nm_rad", round(random.uniform(6.0, sweep * usual.sweep_stiffness_nm_rad), 1)
        yield (
            "gains.adduction_stiffness_nm_rad",
            round(random.uniform(8.0, adduction * usual.adduction_stiffness_nm_rad), 1),
        )
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


def _draw_failures(random: Random) -> Iterator[Harm]:
    count = random.choices(list(FAILURES), list(FAILURES.values()))[0]
    at_s = round(random.uniform(EARLIEST_S, LATEST_S), 3)
    for _ in range(count):
        event = _draw_harm(random, at_s)
        if isinstance(event, Failure) and random.random() < FLAPPING:
            yield from _flapping(random, event)
        else:
            yield event
        at_s = round(at_s + random.choice((0.0, 0.003, 0.01, 0.03, 0.1, 0.3)) * random.random(), 3)


def _draw_harm(random: Random, at_s: float) -> Harm:
    draw = random.choices((_draw_failure, _draw_drift, _draw_restart, _draw_suspension), (12, 4, 1, 2))[0]
    return draw(random, at_s)


def _log_uniform(random: Random, low: float, high: float) -> float:
    return round(exp(random.uniform(log(low), log(high))), 3)


def _draw_slip(random: Random) -> dict[str, float]:
    """Draw an encoder that slips, whose reported speed slips too or does not."""
    slip_rad_s = random.choice((-1.0, 1.0)) * _log_uniform(random, 0.05, 1.0)
    return {"encoder_slip_rad_s": slip_rad_s} | ({"velocity_slip_rad_s": slip_rad_s} if random.random() < 0.5 else {})


DRIFTS: dict[str, Callable[[Random], dict[str, Any]]] = {
    "constant": lambda random: {"torque_constant_error": round(_log_uniform(random, 0.2, 5.0) - 1.0, 3)},
    "slip": _draw_slip,
    "speed": lambda random: {"velocity_error": round(_log_uniform(random, 0.5, 2.0) - 1.0, 3)},
    "commutation": lambda random: {"commutation_error_deg": round(random.uniform(30.0, 180.0), 1)},
    "warming": lambda random: {"temperature_c": round(random.uniform(60.0, 100.0), 1)},
    "sagging": lambda random: {"bus_voltage_v": round(random.uniform(15.0, 22.0), 1)},
    "noise": lambda random: {"encoder_noise_rad": _log_uniform(random, 0.001, 0.02)},
    "cogging": lambda random: {"cogging_nm": _log_uniform(random, 0.003, 0.03)},
    "lag": lambda random: {"current_lag_s": _log_uniform(random, 0.001, 0.02)},
    "delay": lambda random: {"message_delay_s": _log_uniform(random, 0.001, 0.01)},
    "repeats": lambda random: {"repeated_fraction": round(random.uniform(0.1, 0.7), 2)},
}
DRAWN = list(DRIFTS.values())
LARGEST_SHIFT_RAD = 0.6


def _draw_drift(random: Random, at_s: float) -> Drift:
    values = random.choice(DRAWN)(random)
    over_s = random.choice((0.0, 0.0, 0.1, 0.5))
    return Drift(at_s, random.choice(JOINTS), values, for_s=round(random.uniform(0.3, 1.2), 3), over_s=over_s)


def _draw_restart(random: Random, at_s: float) -> Restart:
    shift_rad = round(random.uniform(-LARGEST_SHIFT_RAD, LARGEST_SHIFT_RAD), 3) if random.random() < 0.7 else 0.0
    return Restart(at_s, random.choice(JOINTS), _log_uniform(random, 0.02, 1.0), shift_rad)


def _draw_suspension(random: Random, at_s: float) -> Suspend:
    return Suspend(at_s, _log_uniform(random, 0.003, 1.0), random.choice(PLACES))


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


def _draw_calls(random: Random, start: str, moments_s: list[float], forced: bool) -> Iterator[Event]:
    """Draw the operators' calls, at or shortly after the times at which something begins or ends."""

    def moment_s() -> float:
        return round(random.choice(moments_s) + random.choice((0.0, 0.003, 0.02, 0.1)) * random.random(), 3)

    if start in ("power-on", "idle"):
        yield Call(0.0 if start == "idle" else 0.75, "pilot", "arm", {"force": _force(random, forced, 0.3)})
        yield Call(round(random.uniform(0.2, 0.4), 3), "pilot", "walk", {})
    if start == "hold":
        yield Call(0.0, "pilot", *random.choice((("walk", {}), _move(random))))
    if random.random() < 0.3:
        yield from _attend(random)
    if random.random() < 0.5:
        yield Call(moment_s(), random.choice(("pilot", "guest")), random.choice(("stop", "stop", "disarm")))
    for _ in range(random.choice((0, 1, 2, 4))):
        yield _draw_call(random, moment_s())
    if random.random() < HOSTILE:
        yield from _draw_hostility(random, moment_s())
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
            ("arm", {"force": FORCED if random.random() < 0.5 else ""}),
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


def _draw_hostility(random: Random, at_s: float) -> Iterator[Event]:
    """Draw a second operator who takes every connection, sends what is no request, or acts under another's lease."""
    for number in range(random.choice((1, 4, INTRUDERS))):
        client = f"intruder{number}"
        yield Send(round(at_s + 0.001 * number, 3), client, random.choice(NO_REQUESTS))
        if random.random() < 0.5:
            method, params = random.choice(ATTACKS)
            yield Call(round(at_s + 0.02 * random.random(), 3), client, method, params)
        if random.random() < 0.3:
            yield HangUp(round(at_s + 0.1 * random.random(), 3), client)
