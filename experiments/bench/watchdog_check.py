"""Checks that the drives switch off by themselves when commands stop, also while other frames arrive.

The flippers lie, and the adduction motors press them down a little, so that a current flows and nothing moves. Then the
program sends nothing more. A heartbeat reports idle with a delay of up to one period. The current is exact to a tick,
unless the drive repeats its last current until its next heartbeat.

Then the same again among frames of each kind that another program may send at any time. A watchdog that they feed keeps
the torque of a dead controller for as long as anything on the bus asks for telemetry.

A drive that can only be asked by a command is not asked meanwhile: its watchdog would be fed. Its answer to the first
command states torque and status of before that command. So it is asked twice, shortly before and shortly after its
time-out. Where the time-out cannot be read, the torque must be gone after the longest one that is allowed.
"""

from collections.abc import Sequence
from datetime import date
from math import inf, isnan, nan

import numpy as np

from control.rate import PERIOD_S
from control.records import DriveStates, Joints, Torques
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.drive import DriveHealth
from drivers.drive_types import type_of
from experiments.bench.reading import BenchReading, BenchReadings, left_out
from experiments.bench.test_rig import TestRig, TickSample, first_lasting, signals
from firmware_host.configuration.configuration import Configuration

PRESSING_NM = 0.08  # down, twice the weight of an arm; none for a sweep joint, which would move
PRESSING_S = 0.5
PATIENCE_S = 0.5  # after the longest watchdog: then torque is switched off by command
REPORTING_S = 0.3  # for the drives to report the reason
LATE_TICKS = 3  # for the message, its transfer, and the tick that reads it
LATE_S = LATE_TICKS * PERIOD_S
GONE_FRACTION = 0.5  # of the current
GONE_TICKS = 5  # in a row, with less than that


def press(held: Torques, states: DriveStates) -> Torques:
    """A hold law: down, with the adduction motors alone."""
    return Joints(*(0.0, -PRESSING_NM) * len(held.flippers))


Others = Sequence[tuple[CanPort, Frame]]  # frames of another program in every tick, and their ports


def let_watchdogs_trip(test_rig: TestRig, others: Others = ()) -> tuple[list[TickSample], list[TickSample]]:
    """Return the samples with torque, and those after the last command."""
    test_rig.arm(press)
    pressed = test_rig.run_for(PRESSING_S)
    silence: list[TickSample] = []
    for _ in range(round((test_rig.configuration.faults.longest_watchdog_s + PATIENCE_S) / PERIOD_S)):
        silence.append(test_rig.tick_silently(others))
        if not any(state.closed_loop for sample in silence[-GONE_TICKS:] for state in sample.states):
            break
    test_rig.drives.disarm(test_rig.rig.now_s, at_once=True)
    return pressed, silence


def check_watchdog_times(test_rig: TestRig) -> BenchReadings:
    if not all(_asked_by_command(test_rig)):
        fed = "set enable_watchdog and watchdog_timeout of {joint}, and look for another program that feeds it"
        yield from _observed_readings(test_rig, "after the last command", fed)
        yield from _reasons(test_rig)
    if any(_asked_by_command(test_rig)):
        known_s = [  # a proven one is only the longest that it may be
            health.watchdog_s
            for health in test_rig.drives.health
            if health.watchdog_s > 0.0 and test_rig.configuration.drive[health.joint].reports_settings
        ]
        if known_s:
            yield from _asked_readings(test_rig, min(known_s) - LATE_S, True, "after the last command")
            clear(test_rig)
        yield from _asked_readings(test_rig, _longest_s(test_rig) + LATE_S, False, "after the last command")
        yield from _reasons(test_rig)


def proven_watchdogs(configuration: Configuration) -> dict[str, str]:
    """Return the key that records a passed trial, by joint, for drives that cannot report their watchdog.

    Only an adduction motor had torque to lose: a sweep joint cannot press against anything.
    """
    today, longest_s = date.today().isoformat(), configuration.faults.longest_watchdog_s
    return {
        joint: f'proven_watchdog = {{ watchdog_s = {longest_s:g}, bus = "{drive.bus}", node_id = {drive.node_id},'
        f' model = "{getattr(drive, "model", "")}", date = "{today}" }}'
        for joint, drive in configuration.drive.items()
        if not drive.reports_settings and "adduction" in joint
    }


def _asked_by_command(test_rig: TestRig) -> list[bool]:
    return [axis.parameters.asking_ends_torque for axis in test_rig.drives.axes]


def _observed_readings(test_rig: TestRig, when: str, advice: str, others: Others = ()) -> BenchReadings:
    """Let the watchdogs trip and watch the reports of the drives that need not be asked by a command."""
    pressed, silence = let_watchdogs_trip(test_rig, others)
    for index, (health, by_command) in enumerate(zip(test_rig.drives.health, _asked_by_command(test_rig), strict=True)):
        if by_command:
            continue
        joint, drive = health.joint, test_rig.configuration.drive[health.joint]
        earliest_s, gone_s = health.watchdog_s - LATE_S, health.watchdog_s + LATE_S
        latest_s, todo = gone_s + drive.heartbeat_period_s, advice.format(joint=joint)
        first_idle = (sample for sample in silence if not sample.states[index].closed_loop)
        idle_s = next((sample.tick.now_s - pressed[-1].tick.now_s for sample in first_idle), nan)
        yield BenchReading(f"{joint}: idle {when}", idle_s, "s", earliest_s, latest_s, todo)
        if "adduction" in joint and not others:
            seen_s = _current_gone_s(pressed, silence, index)
            latest_s = latest_s if drive.holds_idle_current else gone_s
            yield BenchReading(f"{joint}: no current after it", seen_s, "s", earliest_s, latest_s, todo)


def _current_gone_s(pressed: Sequence[TickSample], silence: Sequence[TickSample], index: int) -> float:
    """Return how long after the last command the current of a drive had gone; NaN if it did not."""
    flowed_a = np.mean(signals(pressed[-40:], "current_a")[:, index])
    low = signals(silence, "current_a")[:, index] / flowed_a < GONE_FRACTION
    first = first_lasting(silence, low, GONE_TICKS)
    return nan if first is None else first.tick.now_s - pressed[-1].tick.now_s


def _longest_s(test_rig: TestRig) -> float:
    """Return the longest time-out of the drives; the longest that is allowed where one is unknown."""
    unknown_s = test_rig.configuration.faults.longest_watchdog_s
    return max(unknown_s if isnan(health.watchdog_s) else health.watchdog_s for health in test_rig.drives.health)


def _asked_readings(
    test_rig: TestRig, silence_s: float, energised: bool, when: str, others: Others = ()
) -> BenchReadings:
    """Ask the drives that must be asked by a command, after a silence, whether they still have torque."""
    before, answers = ask_after_silence(test_rig, silence_s, others)
    for index, (joint, drive) in enumerate(test_rig.configuration.drive.items()):
        if not drive.asking_ends_torque:
            continue
        what, advice = f"{silence_s:.2f} s {when}", f"set the watchdog of {joint}; see the guide of its type of drive"
        if drive.reports_settings:
            status = float(answers[index].closed_loop)
            yield BenchReading(f"{joint}: in closed loop {what}", status, "", energised, energised, advice)
        if "adduction" in joint:
            fraction = answers[index].current_a / before[index].current_a
            low, high = (GONE_FRACTION, inf) if energised else (-inf, GONE_FRACTION)
            yield BenchReading(f"{joint}: part of its current {what}", fraction, "", low, high, advice)
        elif not drive.reports_settings:  # no torque can be held on a joint that swings freely
            yield left_out(f"{joint}: part of its current {what}")


def ask_after_silence(test_rig: TestRig, silence_s: float, others: Others = ()) -> tuple[DriveStates, DriveStates]:
    """Return the last states with torque, and the answers to the command that ends a silence."""
    test_rig.arm(press)
    before = test_rig.run_for(PRESSING_S)[-1].states
    for _ in range(round(silence_s / PERIOD_S)):
        test_rig.tick_silently(others)
    test_rig.drives.disarm(test_rig.rig.now_s, at_once=True)
    for _ in range(LATE_TICKS):
        answered = test_rig.tick_silently()
    test_rig.switch_off()
    return before, answered.states


def check_what_feeds_watchdogs(test_rig: TestRig) -> BenchReadings:
    drives = test_rig.configuration.drive.values()
    harmless = [(test_rig.drives.ports[drive.bus], type_of(drive).harmless_frames(drive.node_id)) for drive in drives]
    for kind in dict.fromkeys(kind for _, frames in harmless for kind in frames):
        others = [(port, frames[kind]) for port, frames in harmless if kind in frames]
        if any(_asked_by_command(test_rig)):
            latest_s = _longest_s(test_rig) + LATE_S
            yield from _asked_readings(test_rig, latest_s, False, f"among {kind}", others)
            clear(test_rig)
        if not all(_asked_by_command(test_rig)):
            advice = f"{kind} feed its watchdog: no program may send them while torque is on; update its firmware"
            yield from _observed_readings(test_rig, f"among {kind}", advice, others)
            clear(test_rig)


def clear(test_rig: TestRig) -> Sequence[DriveHealth]:
    """Wait for the drives' reports, which are returned, and clear the fault that the check has caused."""
    for _ in range(round(REPORTING_S / PERIOD_S)):
        test_rig.tick()
    reported = test_rig.drives.health
    test_rig.clear_fault()
    return reported


def _reasons(test_rig: TestRig) -> BenchReadings:
    """Check the reason that the drives report, and clear it."""
    readable = [drive.reports_settings for drive in test_rig.configuration.drive.values()]
    for health, can_report in zip(clear(test_rig), readable, strict=True):
        if not can_report:
            yield left_out(f"{health.joint}: switched off by its watchdog")
            continue
        advice = f"the drive reports {health.errors or 'no reason'}, not its watchdog: see the watchdog in stage 1"
        yield BenchReading(f"{health.joint}: switched off by its watchdog", health.watchdog_expired, "", 1, 1, advice)
