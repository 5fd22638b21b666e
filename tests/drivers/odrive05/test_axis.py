"""One ODrive with firmware 0.5 as a joint: counts before it has moved, held currents, errors, its watchdog."""

from collections.abc import Callable
from itertools import pairwise
from math import isnan, pi
from typing import Any

import pytest

from control.rate import PERIOD_S
from control.records import Joints
from drivers.can.frames import Frame
from drivers.drives import SUPPLY_TICKS, Drives
from drivers.odrive import codec
from drivers.odrive.codec import arbitration_id
from drivers.odrive05 import codec as codec05
from drivers.odrive05.parameters import Odrive05Parameters
from tests.drivers.odrive.odrive_bench import OdriveBench

NODE = 3
COUNTS = Frame(arbitration_id(NODE, codec05.GET_ENCODER_COUNT), is_remote=True)
VERSION = Frame(arbitration_id(NODE, codec.GET_VERSION), is_remote=True)
CLEAR = Frame(arbitration_id(NODE, codec05.CLEAR_ERRORS))
ZERO = Frame(arbitration_id(NODE, codec.SET_INPUT_TORQUE), bytes(4))
TO_IDLE = Frame(arbitration_id(NODE, codec.SET_AXIS_STATE), bytes((1, 0, 0, 0)))
IDLE, CLOSED_LOOP = 1, 8
EXPIRED, ENCODER = codec05.ERROR_WATCHDOG, codec05.ERROR_ENCODER
HEARTBEAT_TICKS = 38


class Bench(OdriveBench):
    """One drive whose reports the tests write, and a clock that ticks as the loop does."""

    def __init__(self, **changes: Any) -> None:
        super().__init__({"left_sweep": Odrive05Parameters("left", NODE, **changes)})
        self.now_s = 0.0
        self.state_of_axis, self.error, self.parts = IDLE, 0, (0, 0, 0)
        self.expires = True  # after a tenth of a second without a frame
        self.counts: int | None = 0
        self.estimates = (0.0, 0.0)
        self.sent: list[Frame] = []
        self._silent_ticks = self._tick = 0

    def commands(self) -> list[Frame]:
        """Return the frames that this program has sent."""
        return self.far["left"].receive()

    def read(self) -> None:
        self.now_s += PERIOD_S
        self.drives.read(self.now_s)

    def tick(self, poll: bool = False) -> list[Frame]:
        """Reports motion, and a heartbeat when it is due; returns what the program sends then."""
        self._tick += 1
        if self.expires and self._silent_ticks > HEARTBEAT_TICKS:
            self.error |= EXPIRED
        self.report(codec.GET_ENCODER_ESTIMATES, *self.estimates)
        if self.counts is not None and COUNTS in self.sent:
            self.report(codec05.GET_ENCODER_COUNT, self.counts, self.counts % 8192)
        if self._tick % HEARTBEAT_TICKS == 0:
            self.report(codec05.HEARTBEAT, self.error, self.state_of_axis, *self.parts)
        self.read()
        if poll:
            self.drives.poll()
        else:
            self.drives.send(Joints(0.0), PERIOD_S)
        self.sent = self.commands()
        if CLEAR in self.sent:
            self.error = 0
        self._silent_ticks = 0 if self.sent else self._silent_ticks + 1
        return self.sent

    def run(self, duration_s: float = 1.0, poll: bool = False) -> list[list[Frame]]:
        return [self.tick(poll) for _ in range(round(duration_s / PERIOD_S))]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.parametrize("poll", [False, True])
def test_before_it_was_in_closed_loop_its_position_is_that_of_its_counts(bench: Bench, poll: bool) -> None:
    bench.counts = -4096
    bench.run(poll=poll)
    assert bench.state.angle_rad == pytest.approx(-pi)
    assert bench.state.velocity_rad_s == 0.0
    assert bench.now_s - bench.state.angle_stamp_s < 2.0 * PERIOD_S
    assert COUNTS in bench.sent


@pytest.mark.parametrize(("sign", "zero_turn"), [(1, 0.0), (-1, 0.25)])
def test_counts_and_estimates_give_the_same_angle(sign: int, zero_turn: float) -> None:
    bench = Bench(sign=sign, zero_turn=zero_turn, encoder_counts=4000)
    bench.counts = 1000
    bench.run()
    counted_rad = bench.state.angle_rad
    bench.estimates = (0.25, 1.0)
    bench.tick()
    assert bench.state.angle_rad == pytest.approx(counted_rad) == sign * (0.25 - zero_turn) * 2.0 * pi
    assert bench.state.velocity_rad_s == pytest.approx(sign * 2.0 * pi)
    assert COUNTS not in bench.tick()  # the estimates are enough


def test_zeros_of_a_drive_in_closed_loop_are_a_position(bench: Bench) -> None:
    bench.run()
    bench.state_of_axis, bench.counts = CLOSED_LOOP, 4000
    bench.run(0.2)
    assert (bench.state.angle_rad, bench.state.velocity_rad_s) == (0.0, 0.0)
    assert bench.now_s - bench.state.angle_stamp_s < PERIOD_S


def test_a_joint_that_is_moved_has_the_velocity_between_two_counts_unless_it_jumps() -> None:
    bench = Bench(encoder_counts=4000)
    bench.run()
    for counts, moved in ((20, 20), (40, 20), (0, -40), (160, 160), (321, 0)):
        bench.counts = counts
        bench.tick()
        assert bench.state.velocity_rad_s == pytest.approx(moved / 4000 * 2.0 * pi / PERIOD_S)


def test_a_joint_that_comes_to_rest_at_exactly_zero_has_no_velocity_since_its_old_counts(bench: Bench) -> None:
    bench.counts, near = 164, (0.02, 0.0)
    bench.run()
    bench.state_of_axis, bench.estimates = CLOSED_LOOP, near
    bench.run(0.2)
    bench.state_of_axis, bench.estimates, bench.counts = IDLE, (0.0, 0.0), 0
    speeds_rad_s = []
    for _ in range(HEARTBEAT_TICKS * 2):
        bench.tick()
        speeds_rad_s.append(bench.state.velocity_rad_s)
    assert not any(speeds_rad_s) and COUNTS in bench.sent


def test_the_position_waits_until_the_watchdog_is_proven_and_the_drive_is_left_in_silence_once(bench: Bench) -> None:
    sent = []
    while isnan(bench.health.watchdog_s):
        assert isnan(bench.state.angle_rad) and bench.now_s < 1.0
        sent.append(bench.tick())
        bench.drives.request_settings(float(len(sent)))  # is due each time
        for _ in range(SUPPLY_TICKS):
            bench.drives.request_supply()
        assert sent[-1] or not bench.commands()
    assert bench.health.watchdog_s == 0.1
    silent = [not frames for frames in sent]
    assert sum(before and not after for before, after in pairwise(silent)) == 1
    assert sum(silent) > HEARTBEAT_TICKS
    assert all(bench.run(0.5))  # and never again
    assert not isnan(bench.state.angle_rad)


@pytest.mark.parametrize(
    ("command", "sent"),
    [
        (lambda drives: drives.disarm(0.0, at_once=True), [ZERO, TO_IDLE]),
        (lambda drives: drives.clear_errors(), [CLEAR]),
    ],
    ids=["disarm", "clear errors"],
)
def test_a_command_ends_that_silence_or_that_it_is_to_follow_and_the_proof_begins_again(
    bench: Bench, command: Callable[[Drives], None], sent: list[Frame]
) -> None:
    for arms in (False, True):
        while bench.tick():
            assert bench.now_s < 3.0
        if arms:
            bench.drives.arm(0.0, at_once=True)
            bench.commands()
            assert all(bench.run(0.5))
        command(bench.drives)
        assert bench.commands() == sent
        assert bench.tick()
    bench.run()
    assert bench.health.watchdog_s == 0.1


@pytest.mark.parametrize("poll", [False, True])
def test_a_watchdog_that_expired_before_is_cleared_tried_again_and_is_no_error(bench: Bench, poll: bool) -> None:
    bench.error = EXPIRED
    sent = bench.run(poll=poll)
    assert sum(frames.count(CLEAR) for frames in sent) == 1
    assert bench.health.watchdog_s == 0.1
    assert (bench.state.error_flags, bench.health.errors, bench.health.watchdog_expired) == (0, "", False)


def test_other_errors_are_neither_cleared_nor_hidden_by_the_watchdog_s(bench: Bench) -> None:
    bench.error = EXPIRED | ENCODER
    sent = bench.run()
    assert not any(CLEAR in frames for frames in sent)
    assert isnan(bench.health.watchdog_s) and bench.state.error_flags == ENCODER
    assert not isnan(bench.state.angle_rad)  # a robot that waits for it would neither report nor clear the error
    bench.drives.clear_errors()
    bench.commands()
    bench.error = 0
    bench.run()
    assert bench.health.watchdog_s == 0.1


def test_a_watchdog_that_does_not_expire_is_off_until_errors_are_cleared(bench: Bench) -> None:
    bench.expires = False
    bench.run()
    assert bench.health.watchdog_s == 0.0
    bench.expires = True
    bench.run()
    assert bench.health.watchdog_s == 0.0
    bench.drives.clear_errors()
    assert isnan(bench.health.watchdog_s)
    bench.run()
    bench.drives.clear_errors()
    assert bench.health.watchdog_s == 0.1


def test_a_watchdog_that_expires_with_torque_on_is_an_error(bench: Bench) -> None:
    bench.run()
    bench.error, bench.state_of_axis = 0, CLOSED_LOOP
    bench.run(0.2)
    bench.error, bench.state_of_axis = EXPIRED, IDLE
    bench.run(0.2)
    assert bench.state.error_flags == EXPIRED
    assert bench.health.watchdog_expired and bench.health.active_errors == "watchdog expired"


def test_arming_clears_a_watchdog_that_expired_while_idle_first(bench: Bench) -> None:
    bench.drives.arm(bench.now_s, at_once=True)
    assert CLEAR not in bench.commands()
    bench.drives.disarm(bench.now_s, at_once=True)
    bench.run()
    assert bench.error == EXPIRED  # since the proof
    bench.drives.arm(bench.now_s, at_once=True)
    sent = bench.commands()
    assert sent[0] == CLEAR and sent.count(CLEAR) == 1
    bench.error = 0
    bench.run(0.2)
    bench.drives.arm(bench.now_s, at_once=True)
    assert CLEAR not in bench.commands()


def test_while_it_is_to_follow_no_silence_begins_even_where_arming_was_forced(bench: Bench) -> None:
    bench.expires = False
    bench.run(0.15)
    assert isnan(bench.health.watchdog_s)
    bench.drives.arm(bench.now_s)
    bench.commands()
    assert all(bench.run(0.5))
    bench.state_of_axis = CLOSED_LOOP
    assert all(ZERO in frames for frames in bench.run(0.2))
    assert all(frames == [ZERO] for frames in bench.run(0.3))  # and no question
    assert isnan(bench.health.watchdog_s)
    bench.state_of_axis, bench.expires = IDLE, True
    bench.run()
    assert bench.health.watchdog_s == 0.1


def test_an_idle_drive_repeats_its_last_current_which_is_none(bench: Bench) -> None:
    bench.report(codec.GET_IQ, 2.0, 2.5)
    bench.read()
    assert bench.state.current_a == 0.0
    bench.state_of_axis = CLOSED_LOOP
    bench.run(0.2)
    for current_a in (2.0, 2.5, 2.5):
        bench.report(codec.GET_IQ, 2.0, current_a)
        bench.read()
        assert bench.state.current_a == current_a  # two equal ones with torque on are both measured
    bench.state_of_axis = IDLE
    bench.run(0.2)
    assert bench.state.current_a == 0.0
    for current_a, reported_a in ((2.5, 0.0), (2.5, 0.0), (40.0, 40.0), (2.5, 2.5), (2.5, 0.0)):
        bench.report(codec.GET_IQ, 2.0, current_a)
        bench.read()
        assert bench.state.current_a == reported_a


def test_the_set_point_that_an_idle_drive_repeats_until_its_heartbeat_is_no_mismatch(bench: Bench) -> None:
    """Its set-point still follows the commands, also those of another program; its current repeats."""
    bench.run()
    bench.state_of_axis = CLOSED_LOOP
    bench.run(0.2)

    def run(currents_a: list[float]) -> None:
        for current_a in currents_a:
            bench.report(codec.GET_IQ, 4.0 + current_a, current_a)  # below the limit, beyond which one counts
            bench.tick()

    run([4.0] * 30)
    assert not bench.health.setpoint_problem
    bench.run(0.1)
    run([4.0 + 0.01 * index for index in range(30)])  # a drive that follows it
    assert bench.health.setpoint_problem


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("direction", [-1, 1])
def test_the_encoder_s_direction_turns_currents_into_the_sign_of_torque_and_position(sign: int, direction: int) -> None:
    bench = Bench(sign=sign, encoder_direction=direction)
    bench.state_of_axis = CLOSED_LOOP
    bench.run(0.3)
    bench.drives.gate.open()
    for setpoint_nm, current_a in ((0.2, 2.0), (-0.2, 0.0)):
        for noise_a in (0.1, 0.0) * 200:
            bench.drives.send(Joints(0.2), PERIOD_S)
            currents_a = setpoint_nm / 0.083, current_a + noise_a
            bench.report(codec.GET_IQ, *(sign * direction * each_a for each_a in currents_a))
            bench.read()
        assert bench.state.current_a == current_a
        problem = bench.health.setpoint_problem
        assert ("-0.2 N·m" in problem) is (problem != "") is (setpoint_nm < 0.0)


def test_errors_of_the_parts_are_named_and_only_where_they_have_failed(bench: Bench) -> None:
    bench.parts = (1, 1, 1)
    bench.run(0.2)
    assert bench.health.errors == "motor failed, encoder failed, controller failed"
    bench.parts = (0, 0, 0)
    bench.report(codec05.GET_MOTOR_ERROR, 0x8)
    bench.report(codec05.GET_ENCODER_ERROR, 0x4)
    bench.report(codec05.GET_CONTROLLER_ERROR, 0x1)
    bench.run(0.2)
    assert bench.health.errors == ""
    bench.parts = (1, 0, 1)
    bench.run(0.2)
    assert bench.state.error_flags == codec05.ERROR_MOTOR | codec05.ERROR_CONTROLLER
    named = "motor failed, controller failed; motor: gate driver fault; controller: overspeed"
    assert bench.health.active_errors == bench.health.errors == named
    bench.report(codec05.GET_MOTOR_ERROR, 0x10)
    bench.read()
    assert "motor: control deadline missed" in bench.health.errors
    bench.parts = (0, 1, 0)
    bench.run(0.2)
    assert bench.health.errors == "encoder failed; encoder: no response"


def test_a_drive_that_answers_for_its_counts_and_not_for_its_version_has_this_firmware(bench: Bench) -> None:
    assert (bench.health.firmware, bench.health.firmware_supported) == ("", False)
    bench.drives.request_settings(1.0)
    bench.drives.request_settings(1.1)
    assert bench.commands() == [VERSION, COUNTS]
    bench.report(codec05.GET_ENCODER_COUNT, 0, 0)
    bench.read()
    assert (bench.health.firmware, bench.health.firmware_supported) == ("0.5", True)


def test_a_drive_with_a_version_has_another_firmware(bench: Bench) -> None:
    bench.report(codec.GET_VERSION, 2, 4, 4, 58, 0, 6, 11, 0)
    bench.report(codec05.GET_ENCODER_COUNT, 0, 0)
    bench.read()
    assert (bench.health.firmware, bench.health.firmware_supported) == ("0.6.11", False)
    assert bench.health.supported_firmware == "0.5"
    for now_s in (1.0, 12.0):
        bench.drives.request_settings(now_s)
    assert set(bench.commands()) <= {VERSION, COUNTS}  # firmware 0.5 would take a question for its id as a new one
    assert bench.drives.refused_commands == 0
    assert (bench.health.firmware, bench.health.firmware_supported) == ("0.5", True)  # it was not repeated


@pytest.mark.parametrize(
    ("version", "longest_s"), [((2, 4, 4, 58, 193, 6, 11, 0), 1.5), ((2, 4, 4, 58, 0, 6, 11, 0), 4.5)]
)
def test_a_version_counts_until_it_is_not_repeated(bench: Bench, version: tuple[int, ...], longest_s: float) -> None:
    bench.run(poll=True)
    for _ in range(5):
        bench.report(codec.GET_VERSION, *version)
        while VERSION not in bench.tick(poll=True):
            assert not bench.health.firmware_supported and bench.now_s < 20.0
        assert not bench.health.firmware_supported
    bench.run(longest_s, poll=True)
    assert (bench.health.firmware, bench.health.firmware_supported) == ("0.5", True)


def test_counts_that_do_not_fit_the_position_name_the_key() -> None:
    bench = Bench(encoder_counts=4000)
    bench.state_of_axis = CLOSED_LOOP
    bench.run()
    for counts, problem in ((0, False), (-200, False), (-201, True)):
        bench.report(codec05.GET_ENCODER_COUNT, counts, 0)
        bench.read()
        assert ("encoder_counts = 4000" in bench.health.setting_problem) is problem


@pytest.mark.parametrize("estimates", [(1.5, 0.0), (0.0, 0.0)])
def test_a_garbled_position_or_count_is_no_problem_once_they_fit_again(
    bench: Bench, estimates: tuple[float, float]
) -> None:
    bench.estimates, bench.counts = estimates, round(estimates[0] * 8192)
    bench.run()
    assert bench.health.watchdog_s == 0.1 and bench.health.setting_problem == ""
    bench.report(codec.GET_ENCODER_ESTIMATES, 1e30, 0.0)
    bench.report(codec05.GET_ENCODER_COUNT, bench.counts, 0)
    bench.read()
    assert bench.health.setting_problem
    bench.run()
    assert bench.health.setting_problem == ""


def test_a_restart_forgets_what_was_proven_and_that_it_was_to_follow(bench: Bench) -> None:
    bench.run()
    bench.drives.arm(bench.now_s)
    for _ in range(200):
        bench.read()
    bench.report(codec.GET_ENCODER_ESTIMATES, 0.0, 0.0, stamp_s=bench.state.angle_stamp_s + 0.1)
    bench.read()
    assert bench.health.restarts == 0  # it was delayed
    bench.commands()
    bench.error = 0
    bench.run(0.15)
    assert bench.health.restarts == 1
    assert isnan(bench.health.watchdog_s)
    bench.run()
    assert bench.health.watchdog_s == 0.1 and bench.health.firmware_supported
    bench.drives.reset()
    assert isnan(bench.health.watchdog_s) and not bench.health.firmware_supported


@pytest.mark.parametrize("reports_zeros", [False, True])
def test_a_first_count_is_a_position_and_no_velocity_if_the_drive_has_an_error_and_reports_no_position(
    bench: Bench, reports_zeros: bool
) -> None:
    for count in (0, 20):
        bench.drives.reset()
        bench.report(codec05.HEARTBEAT, ENCODER, IDLE, 0, 0, 0)
        if reports_zeros:
            bench.report(codec.GET_ENCODER_ESTIMATES, 0.0, 0.0)
        bench.report(codec05.GET_ENCODER_COUNT, count, 0)
        bench.read()
    assert isnan(bench.state.angle_rad) is not reports_zeros
    assert not bench.state.velocity_rad_s > 0.0


def test_zeros_after_a_restart_are_no_position_although_the_last_heartbeat_said_closed_loop(bench: Bench) -> None:
    bench.run()
    bench.state_of_axis, bench.estimates = CLOSED_LOOP, (0.3, 0.0)
    bench.run(0.5)
    for _ in range(200):
        bench.read()
    bench.state_of_axis, bench.estimates, bench.counts = IDLE, (0.0, 0.0), 4096
    for _ in range(2 * HEARTBEAT_TICKS):
        bench.tick()
        assert bench.state.angle_rad == pytest.approx(0.6 * pi, abs=1e-3) and not bench.state.closed_loop
        assert bench.health.setting_problem == ""
    bench.run()
    assert bench.state.angle_rad == pytest.approx(pi) and bench.health.setting_problem == ""
    assert bench.health.restarts == 1


def test_nothing_is_asked_of_a_drive_that_was_never_heard(bench: Bench) -> None:
    for _ in range(100):
        bench.read()
        bench.drives.poll()
    assert bench.commands() == []
