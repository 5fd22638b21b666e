"""From the tick of a command to the tick in which the answering current is seen, and how large it is.

The flippers lie, and nothing holds them: before the delay is known, stiffness may make a joint tremble. Now and then,
at a phase that chance shifts against the drives' own clocks, the joint under test gets a quick +T, -T, -T, +T, which
leaves it about where it was. The steps from +T to -T and back are twice T, so half of them stands far above the
current's noise. A delay of one tick is the least there is: what is sent at the end of a tick can be answered in the
next. Plateaus are compared with the torque that was commanded, by the configured torque constant: the drive converts by
its own, so the two must agree.
"""

from __future__ import annotations

from random import Random
from statistics import median
from typing import NamedTuple

from control.records import NO_TORQUE, DriveStates, Joints, Torques
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Sample, Stand, joint_place

PULSE_NM = 0.08  # a tenth of what the motors may do: some ten times a current's noise
QUARTER_TICKS = 4  # 11 ms: the joint comes to 2 rad/s and moves by 2 degrees
SETTLED_TICKS = 2  # at the end of a plateau, when a slow current has come as well
PULSES = 16  # two steps each
LEAST_WAIT_TICKS, MOST_WAIT_TICKS = 25, 45  # between two of them: for the joint to come to rest
LONGEST_TICKS = 2 * QUARTER_TICKS  # after which an answer belongs to another step
MEDIAN_TICKS = 2  # of the delay, with which the joints' damping is stable
WORST_TICKS = 3  # beyond, a drive counts as silent
RATIO_FRACTION = 0.1  # by which current and command may disagree


class Pulse(NamedTuple):
    begins: int  # tick
    sign: int


class Pulses:
    """A law: quick doublets on one joint, no torque on the others."""

    def __init__(self, place: int, random: Random) -> None:
        self.place = place
        self.schedule: list[Pulse] = []
        tick = 0
        for _ in range(PULSES):
            tick += random.randint(LEAST_WAIT_TICKS, MOST_WAIT_TICKS)
            self.schedule.append(Pulse(tick, random.choice((-1, 1))))
            tick += 4 * QUARTER_TICKS
        self.ticks = tick + LEAST_WAIT_TICKS
        self._tick = 0

    def __call__(self, held: Torques, states: DriveStates) -> Torques:
        pulse_nm = self._pulse_nm(self._tick)
        self._tick += 1
        a, b, c, d = (pulse_nm if place == self.place else 0.0 for place in range(4))
        return Joints(a, b, c, d)

    def _pulse_nm(self, tick: int) -> float:
        for begins, sign in self.schedule:
            quarter, before = divmod(tick - begins, QUARTER_TICKS)[0], tick < begins
            if not before and quarter < 4:
                return sign * PULSE_NM * (1.0 if quarter in (0, 3) else -1.0)
        return 0.0


def step_response(stand: Stand, joint: str, seed: int = 1) -> Readings:
    """Raises BenchError where a fault ends it."""
    pulses = Pulses(joint_place(joint), Random(f"{joint} {seed}"))
    stand.arm(lambda held, states: NO_TORQUE)
    stand.controller.hold_law = pulses
    samples = [stand.tick_soundly() for _ in range(pulses.ticks)]
    stand.let_go()
    constant_nm_a = stand.configuration.drive[joint].torque_constant_nm_a
    delays = [
        delay_ticks(samples, pulses.place, pulse.begins + quarter * QUARTER_TICKS, constant_nm_a)
        for pulse in pulses.schedule
        for quarter in (1, 3)
    ]
    slow = "look for a slow current loop (current_control_bandwidth), late messages or a busy bus"
    yield Reading(f"{joint}: delay of the current, median", median(delays), "ticks", 1, MEDIAN_TICKS, slow)
    yield Reading(f"{joint}: delay of the current, worst", max(delays), "ticks", 1, WORST_TICKS, slow)
    ratio = size_ratio(samples, pulses, constant_nm_a)
    stated = f"drive.{joint}.torque_constant_nm_a must be what the drive has in motor.torque_constant"
    yield Reading(f"{joint}: current over command", ratio, "", 1.0 - RATIO_FRACTION, 1.0 + RATIO_FRACTION, stated)


def delay_ticks(samples: list[Sample], place: int, step: int, constant_nm_a: float) -> float:
    """Of the step that was sent in sample `step`: until the current has gone half of its way, missed ticks included."""
    before_nm, after_nm = (samples[tick].sent_nm[place] for tick in (step - 1, step))
    half_nm, upward = (before_nm + after_nm) / 2.0, after_nm > before_nm
    for sample in samples[step + 1 : step + LONGEST_TICKS]:
        given_nm = sample.states[place].current_a * constant_nm_a
        if (given_nm > half_nm) == upward:
            return min(sample.tick.number - samples[step].tick.number, LONGEST_TICKS)
    return LONGEST_TICKS


def size_ratio(samples: list[Sample], pulses: Pulses, constant_nm_a: float) -> float:
    """Of the long plateaus' ends against what was sent; bias and noise go out by the pulses' two signs."""
    given_nm = sent_nm = 0.0
    for pulse in pulses.schedule:
        end, way = pulse.begins + 3 * QUARTER_TICKS, -pulse.sign
        for tick in range(end - SETTLED_TICKS + 1, end + 1):  # the answer to a command is in the tick after it
            given_nm += way * samples[tick].states[pulses.place].current_a * constant_nm_a
            sent_nm += way * samples[tick - 1].sent_nm[pulses.place]
    return given_nm / sent_nm
