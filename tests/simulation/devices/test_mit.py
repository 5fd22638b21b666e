"""The simulated drive in MIT mode, and the axis that commands it: what no drive of another type has."""

from copy import deepcopy
from math import isnan

import pytest

from drivers.can.frames import Frame
from drivers.mit import codec
from drivers.mit.codec import Answer
from drivers.mit.models import MODELS
from drivers.mit.settings import CONTROL_MODE, REGISTERS, TIMEOUT, TMAX
from simulation.devices.mit.device import SimulatedMit
from simulation.devices.mit.registers import write_frame
from tests.drivers.bench.simulated_bus import simulated
from tests.simulation.devices.driven_drives import DrivenDrives

STEP_NM = MODELS["DM4310"].torque_step_nm
DAMIAO, CUBEMARS, ROBSTRIDE = "mit", "mit:AK80-9", "mit:RS05"


@pytest.fixture
def drive() -> SimulatedMit:
    made = simulated("mit", 7, current_noise_a=0.0)
    assert isinstance(made, SimulatedMit)
    return made


def ask(drive: SimulatedMit, data: bytes = codec.LEAVE, now_s: float = 0.0) -> Answer:
    (frame,) = drive.receive(Frame(7, data), now_s)
    assert frame.arbitration_id == codec.feedback_id(7, MODELS["DM4310"])
    return codec.decode_answer(frame.data, MODELS["DM4310"])


def test_it_sends_nothing_but_one_answer_to_each_command_with_the_values_of_before(drive: SimulatedMit) -> None:
    assert list(drive.cyclic_frames(0.1)) == []
    assert drive.receive(Frame(codec.REGISTER_ID, bytes(4)), 0.1) == []  # malformed
    assert drive.receive(Frame(8, codec.LEAVE), 0.1) == [] == drive.receive(Frame(23, codec.LEAVE), 0.1)
    ask(drive, codec.encode_torque(0.5, 10.0))
    assert ask(drive, codec.ENTER).status == codec.DISABLED
    assert drive.torque_nm(0.001) == pytest.approx(0.5, abs=STEP_NM)  # the drive stored the command
    answer = ask(drive, codec.encode_torque(0.0, 10.0))
    assert answer.status == codec.ENABLED and answer.torque_nm == pytest.approx(0.5, abs=1.5 * STEP_NM)
    assert drive.torque_nm(0.002) == pytest.approx(0.5 * STEP_NM)  # no code is zero


def test_an_expired_watchdog_is_not_fed_by_questions_and_latched_until_errors_are_cleared(drive: SimulatedMit) -> None:
    ask(drive, codec.ENTER)
    for tick in range(102):
        drive.receive(Frame(codec.REGISTER_ID, codec.encode_read(7, TIMEOUT)), 0.001 * tick)
        torque_nm = drive.torque_nm(0.001 * tick)
    assert torque_nm == 0.0 and drive.failed
    for data, status in (
        (codec.ENTER, codec.LOST_COMMANDS),
        (codec.CLEAR, codec.LOST_COMMANDS),
        (codec.ENTER, codec.DISABLED),
        (codec.LEAVE, codec.ENABLED),
    ):
        assert ask(drive, data, 0.11).status == status  # of before the command


def test_without_commands_a_cubemars_is_limp_reports_nothing_and_follows_the_next_command() -> None:
    drives = DrivenDrives(CUBEMARS)
    drives.arm()
    drives.wait(0.2)
    assert not drives.devices[0].energised and not drives.devices[0].failed
    drives.tick(0.5, count=2)
    assert drives.torque_nm() == pytest.approx(0.5, abs=0.01) and drives.state.error_flags == 0


# registers


@pytest.mark.parametrize(
    ("register", "value", "found"),
    [
        (21, 3.14, ("PMAX", "3.14", "12.5")),
        (22, 45.0, ("VMAX", "45", "30")),
        (TMAX, 28.0, ("TMAX", "28", "10")),
        (CONTROL_MODE, 2, ("CTRL_MODE", "2", "1")),
        (CONTROL_MODE, 1, ()),
    ],
)
def test_an_axis_reads_limits_and_watchdog_back_and_names_a_setting_that_differs(
    register: int, value: float, found: tuple[str, ...]
) -> None:
    drives = DrivenDrives(DAMIAO, {"serial_number": "0badcafe"})
    drives.devices[0].receive(write_frame(1, register, value), 10.0)
    drives.tick(count=3 * len(REGISTERS))
    first, second, *_ = drives.drives.health
    assert bool(first.setting_problem) is bool(found) and all(word in first.setting_problem for word in found)
    assert second.setting_problem == "" and second.firmware_supported
    assert second.watchdog_s == pytest.approx(0.1) and second.serial_number == "0badcafe"


@pytest.mark.parametrize(("range_nm", "fits"), [(4.0, True), (0.0, False)])
def test_the_range_of_torque_may_be_configured_and_is_then_compared(range_nm: float, fits: bool) -> None:
    drives = DrivenDrives(DAMIAO, {"torque_range_nm": range_nm}, torque_range_nm=4.0)
    drives.tick(count=3 * len(REGISTERS))
    assert (drives.axis.health.setting_problem == "") is fits


def test_the_watchdog_of_a_cubemars_stays_unknown() -> None:
    drives = DrivenDrives(CUBEMARS)
    drives.tick(count=300)
    health = drives.axis.health
    assert isnan(health.watchdog_s) and health.watchdog_advice
    assert health.firmware_supported and drives.drives.unknown_frames == 0


def test_a_copied_robot_hears_its_own_drives_under_the_id_that_they_share() -> None:
    """Random schedules begin with copies of one walk."""
    drives = DrivenDrives(ROBSTRIDE)
    drives.arm()
    copied, stamp_s = deepcopy(drives), drives.state.angle_stamp_s
    copied.tick(0.1, count=5)
    assert copied.state.angle_stamp_s > stamp_s == drives.state.angle_stamp_s


def test_old_cubemars_that_all_answer_under_id_0_are_distinguished_by_their_first_byte() -> None:
    drives = DrivenDrives(CUBEMARS)
    for index in range(4):
        answer = Answer(index + 1, 0, 0.1 * index, 0.0, 0.0, 30.0, 0)
        drives.far.send(Frame(0, codec.encode_answer(answer, MODELS["AK80-9"])))
    states = drives.drives.read(drives.now_s)
    assert [state.angle_rad for state in states] == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-3)
    assert drives.drives.malformed_frames == drives.drives.unknown_frames == 0
