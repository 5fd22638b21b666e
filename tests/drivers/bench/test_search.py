"""A search of a bus finds every drive, names ids that answer twice, and never sends a frame that commands torque."""

import pytest

from drivers.bench.drive_setup import FoundDrive
from drivers.bench.search import SearchResult, expectation_problems, id_problems, search
from drivers.can.frames import Frame
from drivers.drive_types import DRIVE_BENCHES, DRIVE_TYPES
from drivers.odrive import codec as odrive
from drivers.odrive.parameters import OdriveParameters
from simulation.devices.drive import Forgery
from simulation.devices.simulated_drive import SimulatedDrive
from tests.drivers.bench.simulated_bus import SimulatedBus, simulated
from tests.drivers.gate_bench import GateBench


def search_of(bus: SimulatedBus, *names: str, fd: bool = False) -> SearchResult:
    """Search a bus for drives of these types, or of all."""
    return search(bus.bench_port(), DRIVE_BENCHES, fd, names)


def found(*drives: SimulatedDrive, fd: bool = False) -> tuple[FoundDrive, ...]:
    return search_of(SimulatedBus(*drives), fd=fd).found


@pytest.mark.parametrize(
    ("drives", "expected"),
    [
        (
            [simulated("odrive", 0, "385f324d3037"), simulated("odrive", 62, "385f324d3038")],
            [("odrive", 0, "0.0.0", "0.6.11", "385f324d3037"), ("odrive", 62, "0.0.0", "0.6.11", "385f324d3038")],
        ),
        (
            [simulated("moteus", 1, "0123456789abcdef01234567"), simulated("moteus", 126, "89abcdef0123456789abcdef")],
            [
                ("moteus", 1, "model 0", "1.1.0", "0123456789abcdef01234567"),
                ("moteus", 126, "model 0", "1.1.0", "89abcdef0123456789abcdef"),
            ],
        ),
        (
            [
                simulated("mit", 1, "0badcafe", model="DM8009"),
                simulated("mit", 7, model="RS05"),
                simulated("mit", 15, model="AK80-9"),
            ],
            [
                ("mit", 1, "DM8009", "5013", "0badcafe"),
                ("mit", 7, "a RobStride", "", ""),
                ("mit", 15, "a CubeMars, or firmware without registers", "", ""),
            ],
        ),
    ],
)
def test_drives_are_found_at_both_ends_of_their_ids_with_model_firmware_and_serial_number(
    drives: list[SimulatedDrive], expected: list[tuple[object, ...]]
) -> None:
    assert [each[:5] for each in found(*drives, fd=True)] == expected


def test_a_cubemars_that_reports_by_extended_ids_is_named_as_unsupported() -> None:
    bus = SimulatedBus(simulated("mit", 15, model="AK80-9"))
    report = Frame(0x2900 | 104, bytes.fromhex("0000 0000 0000 1e00"), is_extended=True)
    bus.each_step = lambda: bus._far.send(report)
    drives = {each.node_id: each.problem for each in search_of(bus).found}
    assert drives.keys() == {15, 104} and drives[15] == "" and "0x29xx" in drives[104]


def test_ranges_of_no_model_are_a_problem() -> None:
    (drive,) = found(simulated("mit", 1, torque_range_nm=3.3))
    assert drive.hardware == "" and "TMAX" in drive.model_problem


def test_firmware_0_5_is_found_by_its_heartbeat_and_the_counts_of_its_encoder() -> None:
    bus = SimulatedBus(simulated("odrive05", 7), simulated("odrive", 3, "385f324d3037"))
    assert [each[:5] for each in search_of(bus).found] == [
        ("odrive", 3, "0.0.0", "0.6.11", "385f324d3037"),
        ("odrive05", 7, "", "0.5", ""),
    ]
    asked = {frame.arbitration_id for frame in bus.sent if frame.arbitration_id & 0x1F == 0x0A}
    assert asked == {7 << 5 | 0x0A}


def test_an_unknown_sender_of_heartbeats_is_a_problem() -> None:
    old = simulated("odrive", 7)
    heartbeat = Frame(odrive.arbitration_id(7, odrive.HEARTBEAT), odrive.HEARTBEAT.encode(0, 1, 0, 0))
    old.receive = lambda frame, now_s: []  # type: ignore[method-assign]
    old.cyclic_frames = lambda now_s: [heartbeat]  # type: ignore[method-assign]
    (drive,) = found(old)
    assert (drive.type, drive.node_id) == ("odrive05", 7) and "heartbeat" in drive.problem


@pytest.mark.parametrize(("revision", "asked"), [(8, False), (9, True)])
def test_firmware_without_serial_numbers_is_not_asked_for_one(
    monkeypatch: pytest.MonkeyPatch, revision: int, asked: bool
) -> None:
    """Before 0.6.9 the message was another one, which sets the node id."""
    monkeypatch.setattr("simulation.devices.odrive.device.VERSION_FIELDS", (2, 0, 0, 0, 0, 6, revision, 0))
    bus = SimulatedBus(simulated("odrive", 3, "385f324d3037"))
    (drive,) = search_of(bus).found
    address = odrive.arbitration_id(3, odrive.ADDRESS)
    assert (address in {frame.arbitration_id for frame in bus.sent}) == asked == bool(drive.serial_number)


@pytest.mark.parametrize(
    ("name", "serials", "changes"),
    [
        ("odrive", ("385f324d3037", "385f324d3038"), {}),
        ("moteus", ("0123456789abcdef01234567", "89abcdef0123456789abcdef"), {}),
        ("mit", ("00000001", "00000002"), {}),
        ("mit", ("", ""), {"model": "AK80-9"}),  # without registers
    ],
)
def test_two_drives_with_one_id_are_named_with_both_serial_numbers(
    name: str, serials: tuple[str, str], changes: dict[str, str]
) -> None:
    (problem,) = id_problems(found(*(simulated(name, 3, serial, **changes) for serial in serials), fd=True))
    assert f"id 3 answers 2 times ({name}" in problem and all(serial in problem for serial in serials)


@pytest.mark.parametrize("old_first", [True, False])
def test_no_serial_number_is_asked_for_where_one_of_two_drives_would_take_it_for_a_new_id(old_first: bool) -> None:
    old = simulated("odrive", 3)
    version, identifier = bytes([2, 0, 0, 0, 0, 6, 8, 0]), odrive.arbitration_id(3, odrive.GET_VERSION)
    old.receive = lambda frame, now_s: [  # type: ignore[method-assign]
        Frame(identifier, version) for _ in range(frame.is_remote and frame.arbitration_id == identifier)
    ]
    drives = [old, simulated("odrive", 3)]
    bus = SimulatedBus(*drives[:: 1 if old_first else -1])
    (problem,) = id_problems(search_of(bus).found)
    assert "id 3 answers 2 times" in problem
    assert odrive.arbitration_id(3, odrive.ADDRESS) not in {frame.arbitration_id for frame in bus.sent}


def test_an_id_that_answers_in_two_protocols_is_named() -> None:
    bus = SimulatedBus(simulated("odrive", 3), simulated("mit", 3))
    (problem,) = id_problems(search_of(bus, "odrive", "mit").found)
    assert "id 3 answers as mit and as odrive" in problem


def test_a_joint_whose_drive_speaks_another_protocol_is_named() -> None:
    expected = {"left_sweep": OdriveParameters("can", 3), "left_adduction": OdriveParameters("can", 4)}
    other, silent = expectation_problems(found(simulated("moteus", 3), fd=True), expected)
    assert "left_sweep" in other and "type moteus answers" in other
    assert "left_adduction" in silent and "nothing answers" in silent


def test_another_serial_number_than_the_configured_one_is_named() -> None:
    expected = {"left_sweep": OdriveParameters("can", 3, serial_number="ab")}
    (problem,) = expectation_problems(found(simulated("odrive", 3, "385f324d3037")), expected)
    assert "385f324d3037, not ab" in problem


def test_where_an_odrive_answers_no_other_protocol_is_asked() -> None:
    bus = SimulatedBus(simulated("odrive", 0))
    result = search_of(bus, fd=True)
    assert set(result.not_asked) == {"mit", "moteus"}
    assert {frame.is_remote for frame in bus.sent} == {True}


def test_where_a_moteus_answers_no_classic_frame_that_it_takes_for_a_mode_is_sent() -> None:
    bus = SimulatedBus(simulated("moteus", 3))
    assert set(search_of(bus, fd=True).not_asked) == {"mit"}
    assert all(frame.is_remote or frame.is_fd for frame in bus.sent)


def test_no_fd_frame_is_sent_on_a_bus_without_fd() -> None:
    bus = SimulatedBus()
    assert search_of(bus, "moteus").not_asked == {"moteus": "the bus is configured without CAN FD"} and not bus.sent


@pytest.mark.parametrize("name", DRIVE_BENCHES)
def test_no_question_is_a_command_of_torque(name: str) -> None:
    """The daemon's own gate, closed, lets every question of a search pass, and no drive follows torque after it."""
    bus = SimulatedBus(simulated(name, 5))
    search_of(bus, name, fd=True)
    drive_type = DRIVE_TYPES[name]
    own = [frame for frame in bus.sent if (content := drive_type.read_frame(frame)) and content.node_id == 5]
    parameters = drive_type.parameters(bus="can", node_id=5, type=name, serial_number="1")
    gate = GateBench([drive_type.gate_table(parameters)])
    assert own and [frame for frame in own if gate.passed(frame) != [frame]] == []
    assert not bus.energised


def test_a_damiao_as_delivered_is_found_by_its_answers_on_id_0() -> None:
    drive = simulated("mit", 2)
    drive._feedback_id = 0  # type: ignore[attr-defined]
    (each,) = found(drive)
    assert each.node_id == 2 and "MST_ID" in each.problem


def test_old_registers_of_a_moteus_are_a_problem() -> None:
    old = simulated("moteus", 4)
    answer = [old.forge(Forgery.OLD_FIRMWARE)]
    old.receive = lambda frame, now_s: answer if frame.arbitration_id & 0xFF == 4 else []  # type: ignore[method-assign]
    (drive,) = found(old, fd=True)
    assert "register map 4" in drive.problem
