"""Do the drives let go by themselves when commands stop coming?

The flippers lie, and the adduction motors press them down a little, so that a current flows and nothing moves. Then
this program only listens. What a drive's heartbeat says is up to a heartbeat old; the current tells to the tick.
"""

from __future__ import annotations

from math import nan

from control.rate import PERIOD_S
from control.records import DriveStates, Joints, Torques
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Sample, Stand, first_lasting

PRESSING_NM = 0.08  # down: what an arm weighs twice more; a sweep joint gets none, nothing would hold it
PRESSING_S = 0.5
PATIENCE_S = 0.5  # beyond the longest watchdog: then torque is taken off by command
TELLING_S = 0.3  # for the drives to tell why
LATE_TICKS = 3  # of the message that tells it, its way, and the tick that reads it
GONE_FRACTION = 0.5  # of the current
GONE_TICKS = 5  # in a row, with less than that


def press(held: Torques, states: DriveStates) -> Torques:
    """A law: down, with the adduction motors alone."""
    return Joints(0.0, -PRESSING_NM, 0.0, -PRESSING_NM)


def let_watchdogs_trip(stand: Stand) -> tuple[list[Sample], list[Sample]]:
    """What was pressed, and what came after the last command."""
    stand.arm(press)
    pressed = stand.run_for(PRESSING_S)
    silence: list[Sample] = []
    for _ in range(round((stand.configuration.faults.longest_watchdog_s + PATIENCE_S) / PERIOD_S)):
        silence.append(stand.listen())
        if not any(state.closed_loop for sample in silence[-GONE_TICKS:] for state in sample.states):
            break
    stand.drives.disarm(stand.rig.now_s, at_once=True)
    return pressed, silence


def watchdog_times(stand: Stand) -> Readings:
    pressed, silence = let_watchdogs_trip(stand)
    last_s = pressed[-1].tick.now_s
    late_s = LATE_TICKS * PERIOD_S
    for place, health in enumerate(stand.drives.health):
        timeout_s, joint = health.watchdog_s, health.joint
        advice = f"set enable_watchdog and watchdog_timeout of {joint}, and look for another program that feeds it"
        idle_s = next((s.tick.now_s - last_s for s in silence if not s.states[place].closed_loop), nan)
        latest_s = timeout_s + late_s + stand.configuration.drive[joint].heartbeat_period_s
        yield Reading(f"{joint}: idle after the last command", idle_s, "s", timeout_s - late_s, latest_s, advice)
        if "adduction" in joint:
            gone_s = _gone_s(pressed, silence, place)
            yield Reading(f"{joint}: no current after it", gone_s, "s", timeout_s - late_s, timeout_s + late_s, advice)
    yield from _reasons(stand)


def _gone_s(pressed: list[Sample], silence: list[Sample], place: int) -> float:
    """Until the current is less than half of what flowed, and stays so."""
    flowed_a = sum(sample.states[place].current_a for sample in pressed[-40:]) / 40.0
    gone = [sample.states[place].current_a / flowed_a < GONE_FRACTION for sample in silence]
    first = first_lasting(gone, GONE_TICKS)
    return nan if first is None else silence[first].tick.now_s - pressed[-1].tick.now_s


def _reasons(stand: Stand) -> Readings:
    """What the drives give as their reason, and that all of it can be cleared."""
    for _ in range(round(TELLING_S / PERIOD_S)):
        stand.tick()
    reported = stand.drives.health
    stand.clear()
    for health in reported:
        advice = f"the drive tells {health.errors or 'no reason'}; its watchdog must be what let go"
        yield Reading(f"{health.joint}: let go by its watchdog", health.watchdog_expired, "", 1, 1, advice)
