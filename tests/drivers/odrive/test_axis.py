"""The state of one drive over time: restarts, a duplicate node id, the settings of its watchdog."""

from collections.abc import Iterable
from dataclasses import replace
from math import isnan, nan
from random import Random

import pytest

from control.rate import PERIOD_S
from control.records import Joints
from drivers.can.frames import Frame
from drivers.drive import WatchdogEndpoints
from drivers.odrive.codec import (
    ADDRESS,
    GET_ENCODER_ESTIMATES,
    GET_ERROR,
    GET_IQ,
    GET_VERSION,
    HEARTBEAT,
    RX_SDO,
    SDO_READ,
    TX_SDO,
    Message,
)
from drivers.odrive.settings import REFRESH_S
from tests.drivers.odrive.odrive_bench import PARAMETERS, OdriveBench

BUILD = WatchdogEndpoints("0.6.11", "4.4.58", enable=219, timeout=218)
PRO = (2, 4, 4, 58, 0, 6, 11, 0)
AT_REST: dict[Message, tuple[float, ...]] = {
    HEARTBEAT: (0, 1, 0, 0),
    GET_ENCODER_ESTIMATES: (0.0, 0.0),
    GET_IQ: (0.0, 0.0),
}


class Bench(OdriveBench):
    """The drives, of which the tests examine the first one, and a clock."""

    def __init__(self, heartbeat_period_s: float = 0.1) -> None:
        parameters = {joint: replace(each, heartbeat_period_s=heartbeat_period_s) for joint, each in PARAMETERS.items()}
        super().__init__(parameters, endpoints=(BUILD,))
        self.now_s = 0.0

    def request_watchdogs(self, now_s: float) -> list[Frame]:
        """Return the requests for parameters; versions are requested by remote frames."""
        self.drives.request_settings(now_s)
        return [frame for frame in self.far["left"].receive() if not frame.is_remote]

    def report_setting(self, endpoint: int, value: str) -> None:
        self.far["left"].send(Frame(0x005, TX_SDO.encode(0, endpoint, 0) + bytes.fromhex(value)))

    def read(self, now_s: float) -> None:
        self.now_s = now_s
        self.drives.read(now_s)

    def live(self, until_s: float, read: bool = True, drives: int = 1, turns: tuple[float, ...] = (0.0,)) -> None:
        """Send encoders every 2 ms and heartbeats every 0.1 s from `drives` drives, and read in every tick or not at
        all.
        """
        for number in range(round(self.now_s / 0.002) + 1, round(until_s / 0.002) + 1):
            now_s = 0.002 * number
            for drive in range(drives):
                self.report(GET_ENCODER_ESTIMATES, turns[drive % len(turns)], 0.0, stamp_s=now_s)
                if number % 50 == 25 * drive:
                    self.heartbeat(stamp_s=now_s)
            if read:
                self.read(now_s)
        self.now_s = until_s


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_frames_with_stamps_of_another_clock_make_no_restart_and_no_duplicate(bench: Bench) -> None:
    for number in range(2000):
        bench.report(GET_IQ, 0.0, 0.0, stamp_s=1e9 * (1 + number % 3))
        if number % 50 == 0:
            bench.heartbeat(stamp_s=-1e9 * (1 + number % 7))
        bench.read(0.002 * number)
    assert (bench.health.restarts, bench.health.duplicate_id) == (0, False)


@pytest.mark.parametrize("reported", [HEARTBEAT, GET_ENCODER_ESTIMATES])
def test_one_message_that_was_missing_alone_is_no_restart(bench: Bench, reported: Message) -> None:
    bench.live(1.0)
    for number in range(500):
        if number % 25 == 0:
            bench.report(reported, *AT_REST[reported])
        bench.read(1.0 + 0.002 * number)
    bench.live(3.0)
    assert bench.health.restarts == 0


@pytest.mark.parametrize(("error", "state"), [(0x1, 1), (0x1000001, 8), (0, 0)])
def test_a_drive_that_initialises_or_has_no_state_was_restarted_once(bench: Bench, error: int, state: int) -> None:
    bench.live(0.4)
    for _ in range(3):
        bench.heartbeat(state, error)
        bench.read(0.5)
    assert bench.health.restarts == 1
    bench.heartbeat()
    bench.heartbeat(state, error)
    bench.read(0.6)
    assert bench.health.restarts == 2


def test_a_drive_that_starts_with_us_was_not_restarted(bench: Bench) -> None:
    for state in (0, 0, 1):
        bench.heartbeat(state, error=1 - state)
        bench.read(bench.now_s + 0.1)
    assert bench.health.restarts == 0


def test_a_silence_and_initialising_after_it_are_one_restart(bench: Bench) -> None:
    bench.live(1.0)
    for number in range(400):
        bench.read(1.0 + 0.002 * number)
    bench.report(GET_ENCODER_ESTIMATES, 0.0, 0.0)
    bench.read(1.85)
    assert bench.health.restarts == 1
    bench.heartbeat(error=0x1)
    bench.read(1.9)
    assert bench.health.restarts == 1


@pytest.mark.parametrize(
    ("turns", "least_s", "most_s"),
    [((0.1, 0.1), 0.3, 0.85), ((0.1, 0.4), 0.0, 10 * PERIOD_S)],
    ids=["by its heartbeats", "by its readings"],
)
def test_a_second_drive_is_noticed(bench: Bench, turns: tuple[float, ...], least_s: float, most_s: float) -> None:
    bench.live(2.0)
    assert not bench.health.duplicate_id
    while not bench.health.duplicate_id and bench.now_s < 7.0:
        bench.live(bench.now_s + 0.002, drives=2, turns=turns)
    assert least_s < bench.now_s - 2.0 < most_s


def test_a_duplicate_is_forgotten_when_one_of_the_drives_is_removed(bench: Bench) -> None:
    bench.live(2.0, drives=2, turns=(0.1, 0.4))
    assert bench.health.duplicate_id
    bench.live(5.0)
    assert not bench.health.duplicate_id


def test_a_reset_forgets_a_duplicate_and_a_calibration(bench: Bench) -> None:
    bench.live(2.0, drives=2, turns=(0.1, 0.4))
    bench.heartbeat(4)
    bench.read(2.1)
    assert bench.health.duplicate_id and bench.health.busy_state
    bench.axis.reset()
    assert not bench.health.duplicate_id and not bench.health.busy_state


@pytest.mark.parametrize("period_s", [0.02, 0.1, 0.5])
def test_the_heartbeat_s_period_is_the_configured_one(period_s: float) -> None:
    bench = Bench(heartbeat_period_s=period_s)
    for number in range(1, 200):
        bench.heartbeat()
        bench.read(number * period_s)
        assert not bench.health.duplicate_id
    for number in range(1, 40):
        bench.heartbeat()
        bench.read(199 * period_s + number * period_s / 2.0)
    assert bench.health.duplicate_id


@pytest.mark.parametrize("stall_s", [0.3, 3.0])
def test_heartbeats_that_are_read_late_in_a_burst_are_no_duplicate(bench: Bench, stall_s: float) -> None:
    """Four stalls follow each other, with a second of ticks between them."""
    for _ in range(4):
        start_s = bench.now_s
        bench.live(start_s + stall_s, read=False)
        bench.read(start_s + stall_s)
        bench.live(start_s + stall_s + 1.0)
        assert (bench.health.restarts, bench.health.duplicate_id) == (0, False)


def test_heartbeats_that_an_adapter_delays_by_half_a_second_are_no_duplicate(bench: Bench) -> None:
    for number in range(1, 4000):
        now_s = number * 0.005
        bench.report(GET_IQ, 0.0, 0.0)
        if number % 100 == 0:
            for _ in range(5):
                bench.heartbeat()
        bench.read(now_s)
        assert not bench.health.duplicate_id


def readings(bench: Bench, turns: Iterable[float]) -> None:
    for value in turns:
        bench.report(GET_ENCODER_ESTIMATES, value, 0.0)
        bench.read(bench.now_s + 0.002)


def test_a_fast_joint_or_a_jumping_or_faulty_encoder_is_no_duplicate(bench: Bench) -> None:
    random = Random(1)
    readings(bench, (0.01 * number for number in range(500)))  # 5 turns/s
    readings(bench, (0.0, 0.5, 0.5, 0.5, 0.0, 0.0))
    readings(bench, (random.uniform(-1.0, 1.0) for _ in range(5000)))
    readings(bench, (random.choice([0.0, random.uniform(-1.0, 1.0)]) for _ in range(5000)))
    assert not bench.health.duplicate_id


@pytest.mark.parametrize(
    ("enable", "timeout", "watchdog_s"),
    [("01", "cdcccc3d", 0.1), ("00", "cdcccc3d", 0.0), ("01", "00000000", 0.0), ("01000000", "0000803f", 1.0)],
)
def test_the_watchdog_is_read_back_by_the_numbers_of_the_drive_s_build(
    bench: Bench, enable: str, timeout: str, watchdog_s: float
) -> None:
    assert bench.request_watchdogs(0.0) == []  # its version is not known
    bench.report(GET_VERSION, *PRO)
    bench.read(0.1)
    assert isnan(bench.health.watchdog_s)
    asked = [Frame(0x004, bytes.fromhex("00 db 00 00")), Frame(0x004, bytes.fromhex("00 da 00 00"))]
    assert bench.request_watchdogs(1.0) == asked
    bench.report_setting(218, timeout)
    bench.read(1.1)
    assert isnan(bench.health.watchdog_s)
    bench.report_setting(219, enable)
    bench.read(1.2)
    assert bench.health.watchdog_s == pytest.approx(watchdog_s)
    assert bench.request_watchdogs(2.0) == []


@pytest.mark.parametrize(
    "version",
    [(2, 4, 4, 58, 0, 6, 10, 0), (2, 5, 2, 0, 0, 6, 11, 0)],
)
def test_a_build_whose_numbers_are_not_known_is_not_asked_and_counts_as_not_read(
    bench: Bench, version: tuple[int, ...]
) -> None:
    bench.report(GET_VERSION, *version)
    bench.report_setting(219, "01")
    bench.report_setting(218, "cdcccc3d")
    bench.read(0.1)
    assert bench.request_watchdogs(1.0) == []
    assert isnan(bench.axis.settings.watchdog_s)
    hardware, firmware = (".".join(map(str, version[part])) for part in (slice(1, 4), slice(4, 7)))
    assert f"of firmware {firmware}, hardware {hardware} in" in bench.health.watchdog_advice
    assert bench.drives.malformed_frames == 0


@pytest.mark.parametrize(("endpoint", "value"), [(219, "02"), (218, "0000c07f"), (218, "000080bf"), (218, "0000")])
def test_a_setting_that_makes_no_sense_is_malformed_and_stays_unknown(bench: Bench, endpoint: int, value: str) -> None:
    bench.report(GET_VERSION, *PRO)
    bench.report_setting(219, "01")
    bench.read(0.1)
    bench.report_setting(7, "00000000")  # the answer to another program changes nothing
    bench.report_setting(endpoint, value)
    bench.read(0.2)
    assert bench.drives.malformed_frames == 1
    assert isnan(bench.axis.settings.watchdog_s)


@pytest.mark.parametrize("torque_nm", [nan, 1e300, -1e300, float("inf")])
def test_a_torque_that_no_bytes_hold_raises_nothing_and_becomes_zero(bench: Bench, torque_nm: float) -> None:
    bench.drives.gate.open()
    bench.drives.send(Joints(torque_nm, 0.0, 0.0, 0.0), PERIOD_S)
    assert {frame.data for frame in bench.far["left"].receive()} <= {bytes(4), bytes.fromhex("00000080")}
    assert bench.drives.gate.refused == 1


def test_settings_are_asked_for_again_and_a_change_over_usb_is_seen(bench: Bench) -> None:
    bench.report(GET_VERSION, *PRO)
    bench.report_setting(BUILD.enable, "01")
    bench.report_setting(BUILD.timeout, "cdcccc3d")
    bench.read(0.0)
    assert bench.health.watchdog_s == pytest.approx(0.1) and bench.health.serial_number == ""
    bench.report(ADDRESS, 0, 1, 2)
    bench.read(0.0)
    assert (bench.health.supported_firmware, bench.health.serial_number) == ("0.6", "000200000001")
    asked = []
    for tick in range(round(3.0 * REFRESH_S / PERIOD_S)):
        bench.axis.request_settings(tick * PERIOD_S)
        asked.append(len(bench.far["left"].receive()))
    assert [count for count in asked if count] == [1 + 2] * 3  # the version, the flag and the time-out
    bench.report_setting(BUILD.enable, "00")
    bench.read(6.0)
    assert bench.health.watchdog_s == 0.0


@pytest.mark.parametrize(
    ("data", "commands"),
    [(RX_SDO.encode(1, 100, 0) + bytes(4), 1), (RX_SDO.encode(SDO_READ, 100, 0), 0), (b"", 0)],
    ids=["written", "read", "empty"],
)
def test_a_parameter_that_another_program_writes_is_its_command(bench: Bench, data: bytes, commands: int) -> None:
    bench.far["left"].send(Frame(0x004, data))
    bench.read(0.1)
    assert bench.health.foreign_commands == commands


def test_a_current_that_is_no_number_is_none_in_a_drive_that_lets_none_flow(bench: Bench) -> None:
    bench.live(0.5)
    bench.report(GET_IQ, 0.0, float("nan"))
    bench.read(0.6)
    assert bench.state.current_a == 0.0


@pytest.mark.parametrize("message", AT_REST)
@pytest.mark.parametrize(("silent_s", "restarts"), [(0.29, 0), (0.32, 1), (60.0, 1)])
def test_any_message_after_a_silence_of_all_is_a_restart(
    bench: Bench, message: Message, silent_s: float, restarts: int
) -> None:
    for each, values in AT_REST.items():
        bench.report(each, *values, stamp_s=1.0)
    bench.report(GET_VERSION, *PRO)
    bench.read(1.0)
    assert bench.health.restarts == 0
    for tick in range(1, round(silent_s / 0.01) + 1):
        bench.read(1.0 + 0.01 * tick)
    bench.report(message, *AT_REST[message], stamp_s=bench.now_s + 0.01)
    bench.read(bench.now_s + 0.01)
    assert bench.health.restarts == restarts
    assert (bench.axis.settings.version is None) == bool(restarts)


@pytest.mark.parametrize("message", AT_REST)
def test_a_message_that_arrives_late_is_no_restart_where_its_stamp_says_so(bench: Bench, message: Message) -> None:
    for each, values in AT_REST.items():
        bench.report(each, *values, stamp_s=1.0)
    for tick in range(50):
        bench.read(1.0 + 0.01 * tick)
    bench.report(message, *AT_REST[message], stamp_s=1.2)
    bench.read(1.5)
    assert bench.health.restarts == 0


def test_a_state_that_nobody_asked_for_is_reported_while_it_lasts(bench: Bench) -> None:
    for state, busy in ((1, ""), (3, "axis state 3"), (8, ""), (3, "axis state 3"), (1, "")):
        bench.heartbeat(state)
        bench.read(bench.now_s + 0.1)
        assert bench.health.busy_state == busy


def test_errors_are_named_while_they_last_and_the_reason_of_disarming_after_them(bench: Bench) -> None:
    for message, values, active, errors in (
        (HEARTBEAT, (0x200, 1, 0, 0), "bus under-voltage", "bus under-voltage"),
        (GET_ERROR, (0x200, 0x100), "bus under-voltage", "bus over-voltage, bus under-voltage"),
        (HEARTBEAT, (0, 1, 0, 0), "", "bus over-voltage"),
        (GET_ERROR, (0, 0), "", ""),
    ):
        bench.report(message, *values)
        bench.read(bench.now_s + 0.1)
        assert (bench.health.active_errors, bench.health.errors) == (active, errors)


@pytest.mark.parametrize(("state", "turns_s", "found"), [(8, 0.0, True), (8, 0.5, True), (1, 0.0, False)])
def test_set_points_that_were_not_commanded_are_another_program_s_in_closed_loop(
    bench: Bench, state: int, turns_s: float, found: bool
) -> None:
    constant_nm_a = bench.axis.parameters.torque_constant_nm_a
    for setpoint_nm, problem in ((0.1, False), (-0.3, found)):
        bench.heartbeat(state)
        for _ in range(40):
            bench.axis.send_torque(0.1)
            bench.report(GET_ENCODER_ESTIMATES, 0.0, turns_s)
            bench.report(GET_IQ, setpoint_nm / constant_nm_a, 0.0)
            bench.read(bench.now_s + 0.01)
        assert bool(bench.health.setpoint_problem) is problem
    bench.heartbeat()  # it left closed loop
    bench.read(bench.now_s + 0.01)
    assert bench.health.setpoint_problem == ""
