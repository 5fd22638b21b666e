"""Measures the delay from a torque command to the current that answers it, and the size of that current.

The flippers lie and are not held, because stiffness may make a joint oscillate before the delay is known. At random
times, and so at random phases of the drives' clocks, the joint gets a quick +T, -T, -T, +T, which leaves it about where
it was. The steps between +T and -T are 2 T, so half of a step is far above the noise of the current. The least delay is
one tick: a command sent at the end of a tick can be answered in the next. The plateaus are compared with the commanded
torque by the configured torque constant, which must agree with the drive's own.
"""

from random import Random
from statistics import median
from typing import NamedTuple

from control.records import DriveStates, Torques
from experiments.bench.reading import Reading, Readings
from experiments.bench.test_rig import Sample, TestRig, idle, torque_on

PULSE_NM = 0.08  # a tenth of the torque limit, and about ten times the noise of the current
QUARTER_TICKS = 4  # 11 ms: the joint reaches 2 rad/s and moves by 2 degrees
SETTLED_TICKS = 2  # at the end of a plateau, when a slow current has settled
PULSES = 16  # two steps each
LEAST_WAIT_TICKS, MOST_WAIT_TICKS = 25, 45  # between two pulses, for the joint to come to rest
LONGEST_TICKS = 2 * QUARTER_TICKS  # after which an answer belongs to another step
MEDIAN_TICKS = 2  # of the delay, with which the joints' damping is stable
WORST_TICKS = 3  # beyond, a drive counts as silent
RATIO_FRACTION = 0.1  # allowed difference between current and command


class Pulse(NamedTuple):
    begins: int  # tick
    sign: int


class Pulses:
    """A hold law: quick doublets on one joint, no torque on the others."""

    def __init__(self, index: int, random: Random) -> None:
        self.index = index
        self.schedule: list[Pulse] = []
        tick = 0
        for _ in range(PULSES):
            tick += random.randint(LEAST_WAIT_TICKS, MOST_WAIT_TICKS)
            self.schedule.append(Pulse(tick, random.choice((-1, 1))))
            tick += 4 * QUARTER_TICKS
        self.ticks = tick + LEAST_WAIT_TICKS
        self._tick = 0

    def __call__(self, held: Torques, states: DriveStates) -> Torques:
        pulse_nm = 0.0
        for begins, sign in self.schedule:
            if 0 <= self._tick - begins < 4 * QUARTER_TICKS:
                quarter = (self._tick - begins) // QUARTER_TICKS
                pulse_nm = sign * PULSE_NM * (1.0 if quarter in (0, 3) else -1.0)
        self._tick += 1
        return torque_on(held, self.index, pulse_nm)


def check_step_response(test_rig: TestRig, joint: str, seed: int = 1) -> Readings:
    """Check the delay and size of one joint's current. Raises BenchError where a fault ends it."""
    pulses = Pulses(test_rig.index_of(joint), Random(f"{joint} {seed}"))
    test_rig.arm(idle)
    test_rig.controller.hold_law = pulses
    samples = [test_rig.tick_checked() for _ in range(pulses.ticks)]
    test_rig.switch_off()
    constant_nm_a = test_rig.configuration.drive[joint].torque_constant_nm_a
    delays = [
        delay_ticks(samples, pulses.index, pulse.begins + quarter * QUARTER_TICKS, constant_nm_a)
        for pulse in pulses.schedule
        for quarter in (1, 3)
    ]
    slow = "look for a slow current loop (current_control_bandwidth), late messages or a busy bus"
    yield Reading(f"{joint}: delay of the current, median", median(delays), "ticks", 1, MEDIAN_TICKS, slow)
    yield Reading(f"{joint}: delay of the current, worst", max(delays), "ticks", 1, WORST_TICKS, slow)
    ratio = size_ratio(samples, pulses, constant_nm_a)
    stated = f"drive.{joint}.torque_constant_nm_a must be what the drive has in motor.torque_constant"
    yield Reading(f"{joint}: current over command", ratio, "", 1.0 - RATIO_FRACTION, 1.0 + RATIO_FRACTION, stated)


def delay_ticks(samples: list[Sample], index: int, step: int, constant_nm_a: float) -> float:
    """Return the ticks from the command in sample `step` until the current has made half of its change."""
    before_nm, after_nm = (samples[tick].sent_nm[index] for tick in (step - 1, step))
    half_nm, upward = (before_nm + after_nm) / 2.0, after_nm > before_nm
    for sample in samples[step + 1 : step + LONGEST_TICKS]:
        given_nm = sample.states[index].current_a * constant_nm_a
        if (given_nm > half_nm) == upward:
            return min(sample.tick.number - samples[step].tick.number, LONGEST_TICKS)
    return LONGEST_TICKS


def size_ratio(samples: list[Sample], pulses: Pulses, constant_nm_a: float) -> float:
    """Return current over command at the ends of the long plateaus; the two signs of the pulses cancel a bias."""
    given_nm = sent_nm = 0.0
    for pulse in pulses.schedule:
        end, sign = pulse.begins + 3 * QUARTER_TICKS, -pulse.sign
        for tick in range(end - SETTLED_TICKS + 1, end + 1):  # the answer to a command is in the tick after it
            given_nm += sign * samples[tick].states[pulses.index].current_a * constant_nm_a
            sent_nm += sign * samples[tick - 1].sent_nm[pulses.index]
    return given_nm / sent_nm
