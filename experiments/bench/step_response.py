"""Measures the delay from a torque command to the current that answers it, and the size of that current.

The flippers lie and are not held, because stiffness may make a joint oscillate before the delay is known. At random
times, and so at random phases of the drives' clocks, the joint gets a quick +T, -T, -T, +T, which leaves it about where
it was. The steps between +T and -T are 2 T, so half of a step is far above the noise of the current. The least delay is
one tick: a command sent at the end of a tick can be answered in the next. The plateaus are compared with the commanded
torque by the configured torque constant, which must agree with the drive's own.
"""

from random import Random
from statistics import median

from experiments.bench.reading import BenchReading, BenchReadings
from experiments.bench.test_rig import TestRig, TickSample, idle, torque_on

PULSE_NM = 0.08  # a tenth of the torque limit, and about ten times the noise of the current
QUARTER_TICKS = 4  # 11 ms: the joint reaches 2 rad/s and moves by 2 degrees
SETTLED_TICKS = 2  # at the end of a plateau, when a slow current has settled
PULSES = 16  # two steps each
LEAST_WAIT_TICKS, MOST_WAIT_TICKS = 25, 45  # between two pulses, for the joint to come to rest
LONGEST_TICKS = 2 * QUARTER_TICKS  # after which an answer belongs to another step
MEDIAN_TICKS = 2  # of the delay, with which the joints' damping is stable
WORST_TICKS = 3  # beyond, a drive counts as silent
RATIO_FRACTION = 0.1  # allowed difference between current and command


def pulse_train(random: Random) -> tuple[list[tuple[int, int]], list[float]]:
    """Return the tick in which each pulse begins and its sign, and the torque of every tick."""
    pulses, torques_nm = list[tuple[int, int]](), list[float]()
    for _ in range(PULSES):
        torques_nm += [0.0] * random.randint(LEAST_WAIT_TICKS, MOST_WAIT_TICKS)
        pulses.append((len(torques_nm), sign := random.choice((-1, 1))))
        for quarter in (1, -1, -1, 1):
            torques_nm += [sign * quarter * PULSE_NM] * QUARTER_TICKS
    return pulses, torques_nm + [0.0] * LEAST_WAIT_TICKS


def check_step_response(test_rig: TestRig, joint: str) -> BenchReadings:
    """Check the delay and size of one joint's current. Raises BenchError where a fault ends it."""
    index, (pulses, torques_nm) = test_rig.index_of(joint), pulse_train(Random(f"{joint} 1"))
    left_nm = iter(torques_nm)
    test_rig.arm(idle)
    test_rig.controller.hold_law = lambda held, states: torque_on(held, index, next(left_nm, 0.0))
    samples = [test_rig.tick_checked() for _ in torques_nm]
    test_rig.switch_off()
    constant_nm_a = test_rig.configuration.drive[joint].torque_constant_nm_a
    delays = [
        delay_ticks(samples, index, begins + quarter * QUARTER_TICKS, constant_nm_a)
        for begins, _ in pulses
        for quarter in (1, 3)
    ]
    slow = "look for a slow current loop (current_control_bandwidth), late messages or a busy bus"
    yield BenchReading(f"{joint}: delay of the current, median", median(delays), "ticks", 1, MEDIAN_TICKS, slow)
    yield BenchReading(f"{joint}: delay of the current, worst", max(delays), "ticks", 1, WORST_TICKS, slow)
    # at the ends of the long plateaus; the two signs of the pulses cancel a bias
    given_nm = sent_nm = 0.0
    for begins, sign in pulses:
        end = begins + 3 * QUARTER_TICKS
        for tick in range(end - SETTLED_TICKS + 1, end + 1):  # the answer to a command is in the tick after it
            given_nm += sign * samples[tick].states[index].current_a * constant_nm_a
            sent_nm += sign * samples[tick - 1].sent_nm[index]
    stated = f"drive.{joint}.torque_constant_nm_a must be what the drive has in motor.torque_constant"
    low, high = 1.0 - RATIO_FRACTION, 1.0 + RATIO_FRACTION
    yield BenchReading(f"{joint}: current over command", given_nm / sent_nm, "", low, high, stated)


def delay_ticks(samples: list[TickSample], index: int, step: int, constant_nm_a: float) -> float:
    """Return the ticks from the command in sample `step` until the current has made half of its change."""
    before_nm, after_nm = (samples[tick].sent_nm[index] for tick in (step - 1, step))
    half_nm, upward = (before_nm + after_nm) / 2.0, after_nm > before_nm
    for sample in samples[step + 1 : step + LONGEST_TICKS]:
        given_nm = sample.states[index].current_a * constant_nm_a
        if (given_nm > half_nm) == upward:
            return min(sample.tick.number - samples[step].tick.number, LONGEST_TICKS)
    return LONGEST_TICKS
