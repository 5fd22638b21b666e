"""The bounds of an encoder's faults, pinned from both sides with figures instead of the module's own constants."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, nextafter

from control.monitors.encoder_monitor import EncoderMonitor
from control.rate import PERIOD_S
from control.records import DriveState

JUMP_RAD = 0.05
Sample = tuple[float, float, float]  # stamp in s, angle in rad, velocity in rad/s


def found(samples: Iterable[Sample], encoder: EncoderMonitor | None = None) -> list[str]:
    """Return the name of each sample's fault, or an empty text."""
    encoder = encoder or EncoderMonitor("left_sweep", JUMP_RAD)
    names = []
    for stamp_s, angle_rad, velocity_rad_s in samples:
        state = DriveState(angle_rad=angle_rad, velocity_rad_s=velocity_rad_s, angle_stamp_s=stamp_s)
        fault = encoder.update(state, PERIOD_S)
        names.append(fault.name if fault else "")
    return names


def frozen(gap_s: float, velocities_rad_s: Iterable[float]) -> list[str]:
    """Return the faults of samples with an unchanging angle, after the first sample."""
    return found((number * gap_s, 0.3, velocity) for number, velocity in enumerate(velocities_rad_s))[1:]


def noisy(velocity_rad_s: float, count: int) -> list[float]:
    """Return a velocity whose last bits change."""
    return [velocity_rad_s * (1.0 + 1e-9 * (number % 2)) for number in range(count)]


def test_an_angle_may_stay_while_the_velocity_moves_thirty_milliradians() -> None:
    for velocity_rad_s, expected in ((1.4, ""), (1.6, "encoder_stuck"), (-1.4, ""), (-1.6, "encoder_stuck")):
        assert frozen(0.021, noisy(velocity_rad_s, 2)) == [expected if abs(velocity_rad_s) * 0.021 > 0.03 else ""]
    assert frozen(0.0625, [0.5, 0.48]) == [""]  # exactly the bound of the path
    assert frozen(0.01, noisy(0.99, 4)) == ["", "", ""]
    assert frozen(0.01, noisy(1.01, 4)) == ["", "", "encoder_stuck"]


def test_a_fast_angle_may_be_repeated_for_twenty_milliseconds() -> None:
    assert frozen(0.0099, noisy(20.0, 4)) == ["", "", "encoder_stuck"]
    assert frozen(0.0101, noisy(20.0, 3)) == ["", "encoder_stuck"]
    assert frozen(0.02, noisy(20.0, 2)) == [""]  # exactly the bound of the time


def test_motion_to_and_fro_is_no_travel() -> None:
    assert set(frozen(0.01, [2.0 * (-1.0) ** number for number in range(100)])) == {""}


def test_a_velocity_may_repeat_to_the_last_bit_for_a_tenth_of_a_second() -> None:
    assert frozen(0.0249, [0.01] * 6) == ["", "", "", "", "encoder_stuck"]
    assert frozen(0.0251, [0.01] * 5) == ["", "", "", "encoder_stuck"]
    assert frozen(0.1, [0.01] * 2) == [""]  # exactly the bound of the time


def test_a_velocity_that_changes_in_its_last_bit_begins_the_wait_again() -> None:
    live = nextafter(0.01, inf)
    assert set(frozen(0.0249, [0.01] * 4 + [live] * 4)) == {""}


def test_a_new_angle_begins_every_wait_again() -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    for turn in range(6):
        angle_rad = 0.3 + 1e-4 * turn
        samples = [(0.1 * turn + 0.02 * number, angle_rad, 0.3) for number in range(4)]
        assert set(found(samples, encoder)) == {""}


def test_rest_is_slower_than_a_nanoradian_per_second() -> None:
    assert set(frozen(0.02, [1e-9] * 20)) == {""}
    assert "encoder_stuck" in frozen(0.02, [2e-9] * 20)
    assert "encoder_stuck" in frozen(0.02, [-2e-9] * 20)


def pushed(gap_s: float, torques_nm: Iterable[float], velocity_rad_s: float = 0.0) -> list[bool]:
    """Return whether each sample of an unchanging angle is a fault under these torques."""
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    return [
        encoder.update(DriveState(0.3, velocity_rad_s, number * gap_s), PERIOD_S, torque_nm) is not None
        for number, torque_nm in enumerate(torques_nm)
    ]


def test_a_resting_joint_yields_within_fifty_milliseconds_to_a_torque_that_changes_by_four_tenths() -> None:
    for sign in (-1.0, 1.0):
        changing_nm = [0.0, sign * 0.41, 0.0, 0.0, 0.0, 0.0]
        assert pushed(0.0124, changing_nm) == [False] * 5 + [True]
        assert pushed(0.0126, changing_nm) == [False] * 4 + [True, True]
        assert not any(pushed(0.0125, changing_nm[:5]))  # exactly the bound of the time
        assert not any(pushed(0.02, [0.0] * 3 + [sign * 0.4] * 100))


def test_a_joint_starts_to_yield_within_ten_milliseconds_of_the_change() -> None:
    """The answer to a command was measured before it: a flipper that the mud held until then has not moved yet."""
    rest = [0.0] * 30
    assert not any(pushed(0.0024, [*rest, *[0.41] * 5]))
    assert pushed(0.0024, [*rest, *[0.41] * 6]) == [False] * 35 + [True]


def test_the_torque_counts_from_the_first_repeated_sample_on() -> None:
    """The torque of the sample before may have moved the joint to where it is."""
    assert not any(pushed(0.02, [0.7] + [0.0] * 100))
    assert any(pushed(0.02, [0.7, 0.7] + [0.0] * 100))


def test_a_velocity_that_changes_begins_the_wait_for_a_torque_again() -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    torques_nm = {0: 0.7, 1: 0.0}
    for number in range(400):
        velocity_rad_s = 1e-12 * (number // 3 % 2)  # each is repeated twice
        state = DriveState(0.3, velocity_rad_s, 0.02 * number)
        assert encoder.update(state, PERIOD_S, torques_nm[number % 2]) is None


def test_the_torque_of_a_message_that_is_seen_again_is_not_counted() -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    for number in range(100):
        for torque_nm in (0.0, 0.7):
            assert encoder.update(DriveState(0.3, 0.0, 0.02 * number), PERIOD_S, torque_nm) is None


def test_two_velocities_give_the_path_over_thirty_milliseconds_and_no_longer() -> None:
    assert found([(0.0, 0.0, 0.0), (0.03, 1.0, 0.0)]) == ["", "encoder_jump"]
    assert found([(0.0, 0.0, 0.0), (nextafter(0.03, 1.0), 1.0, 0.0)]) == ["", ""]


def test_a_jump_is_more_than_the_noise_of_an_encoder() -> None:
    assert found([(0.0, 0.0, 0.0), (0.002, 0.05, 0.0)]) == ["", ""]
    assert found([(0.0, 0.0, 0.0), (0.002, nextafter(0.05, 1.0), 0.0)]) == ["", "encoder_jump"]


def test_the_path_is_that_of_the_mean_of_the_two_velocities() -> None:
    """From 10 to 20 rad/s in 0.02 s the path is 0.3 rad; a stamp that is a tick late explains 20 rad/s times a tick
    more.
    """
    slack_rad = JUMP_RAD + 20.0 * PERIOD_S
    for sign in (-1.0, 1.0):
        for beyond_rad, expected in ((-1e-9, ""), (1e-9, "encoder_jump")):
            for first, second in ((10.0, 20.0), (20.0, 10.0)):
                step_rad = 0.3 + sign * (slack_rad + beyond_rad)
                assert found([(0.0, 0.0, first), (0.02, step_rad, second)]) == ["", expected]


def test_a_stamp_that_goes_back_has_no_path_and_no_time() -> None:
    assert found([(1.0, 0.0, 5.0), (0.9, 0.06, 5.0)]) == ["", ""]
    assert found([(1.0, 0.0, 5.0), (0.9, 0.07, 5.0)]) == ["", "encoder_jump"]
    assert set(found([(1.0 - 0.05 * number, 0.3, 5.0) for number in range(10)])) == {""}


def test_the_report_has_the_step_in_degrees_and_the_gap_in_milliseconds() -> None:
    encoder = EncoderMonitor("left_sweep", JUMP_RAD)
    encoder.update(DriveState(angle_rad=0.0, velocity_rad_s=0.0, angle_stamp_s=0.0), PERIOD_S)
    fault = encoder.update(DriveState(angle_rad=-1.0, velocity_rad_s=0.0, angle_stamp_s=0.002), PERIOD_S)
    assert fault is not None and fault.subject == "left_sweep"
    values = {name: round(float(value), 6) for name, value in fault.values}
    assert values == {"step_deg": 57.29578, "gap_ms": 2.0}
