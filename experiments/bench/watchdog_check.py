"""Checks that the drives switch off by themselves when commands stop.

The flippers lie, and the adduction motors press them down a little, so that a current flows and nothing moves. Then the
program sends nothing more. A heartbeat reports idle with a delay of up to one period; the current is exact to a tick.
"""

from math import nan

from control.rate import PERIOD_S
from control.records import DriveStates, Joints, Torques
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Sample, TestRig, first_lasting

PRESSING_NM = 0.08  # down, twice the weight of an arm; none for a sweep joint, which would move
PRESSING_S = 0.5
PATIENCE_S = 0.5  # after the longest watchdog: then torque is switched off by command
REPORTING_S = 0.3  # for the drives to report the reason
LATE_TICKS = 3  # for the message, its transfer, and the tick that reads it
GONE_FRACTION = 0.5  # of the current
GONE_TICKS = 5  # in a row, with less than that


def press(held: Torques, states: DriveStates) -> Torques:
    """A hold law: down, with the adduction motors alone."""
    return Joints(0.0, -PRESSING_NM, 0.0, -PRESSING_NM)


def let_watchdogs_trip(test_rig: TestRig) -> tuple[list[Sample], list[Sample]]:
    """Return the samples with torque, and those after the last command."""
    test_rig.arm(press)
    pressed = test_rig.run_for(PRESSING_S)
    silence: list[Sample] = []
    for _ in range(round((test_rig.configuration.faults.longest_watchdog_s + PATIENCE_S) / PERIOD_S)):
        silence.append(test_rig.tick_silently())
        if not any(state.closed_loop for sample in silence[-GONE_TICKS:] for state in sample.states):
            break
    test_rig.drives.disarm(test_rig.rig.now_s, at_once=True)
    return pressed, silence


def check_watchdog_times(test_rig: TestRig) -> Readings:
    pressed, silence = let_watchdogs_trip(test_rig)
    last_s = pressed[-1].tick.now_s
    late_s = LATE_TICKS * PERIOD_S
    for index, health in enumerate(test_rig.drives.health):
        timeout_s, joint = health.watchdog_s, health.joint
        advice = f"set enable_watchdog and watchdog_timeout of {joint}, and look for another program that feeds it"
        idle_s = next((s.tick.now_s - last_s for s in silence if not s.states[index].closed_loop), nan)
        latest_s = timeout_s + late_s + test_rig.configuration.drive[joint].heartbeat_period_s
        yield Reading(f"{joint}: idle after the last command", idle_s, "s", timeout_s - late_s, latest_s, advice)
        if "adduction" in joint:
            gone_s = _gone_s(pressed, silence, index)
            yield Reading(f"{joint}: no current after it", gone_s, "s", timeout_s - late_s, timeout_s + late_s, advice)
    yield from _reasons(test_rig)


def _gone_s(pressed: list[Sample], silence: list[Sample], index: int) -> float:
    """Return the time until the current stays below half of its earlier value."""
    flowed_a = sum(sample.states[index].current_a for sample in pressed[-40:]) / 40.0
    low = [sample.states[index].current_a / flowed_a < GONE_FRACTION for sample in silence]
    first = first_lasting(low, GONE_TICKS)
    return nan if first is None else silence[first].tick.now_s - pressed[-1].tick.now_s


def _reasons(test_rig: TestRig) -> Readings:
    """Check the reason that the drives report, and clear it."""
    for _ in range(round(REPORTING_S / PERIOD_S)):
        test_rig.tick()
    reported = test_rig.drives.health
    test_rig.clear_fault()
    for health in reported:
        advice = f"the drive reports {health.errors or 'no reason'}, not its watchdog: see the watchdog in stage 1"
        yield Reading(f"{health.joint}: switched off by its watchdog", health.watchdog_expired, "", 1, 1, advice)
