"""`mudskipper init --from-bus` writes the drives that answer, and refuses a bus that does not fit the rig."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.drives import opened_buses
from control.records import JOINTS
from firmware_host.buses import BusError
from firmware_host.configuration.loading import load_configuration
from simulation.devices.simulated_drive import SimulatedDrive
from tests.command_line.command_lines import run
from tests.drivers.bench.simulated_bus import SimulatedBus, simulated

SERIALS = {"odrive": "385f324d303{}", "moteus": "0123456789abcdef0123456{}", "mit": "0badcaf{}"}


Attach = Callable[..., None]


@pytest.fixture
def attach(monkeypatch: pytest.MonkeyPatch) -> Attach:
    """Return a function that attaches simulated drives to channels."""

    def attach(**drives: Sequence[SimulatedDrive]) -> None:
        buses = {name: SimulatedBus(*each) for name, each in drives.items()}
        by_port = {bus.port: bus for bus in buses.values()}
        monkeypatch.setattr(opened_buses, "open_ports", lambda given: {name: buses[name].port for name in given})
        monkeypatch.setattr(opened_buses, "make_bench_port", lambda port: by_port[port].bench_port())

    return attach


def drives_of(name: str, *node_ids: int) -> list[SimulatedDrive]:
    return [simulated(name, node_id, SERIALS[name].format(node_id), model="DM8009") for node_id in node_ids]


def init(path: Path, *arguments: str) -> tuple[int, str]:
    ended = run("init", str(path), "--from-bus", "--interface", "virtual", *arguments)
    return ended.returncode, ended.stderr


@pytest.mark.parametrize("name", SERIALS)
def test_type_ids_serial_numbers_and_models_are_written(tmp_path: Path, attach: Attach, name: str) -> None:
    attach(can0=drives_of(name, 9, 4, 7, 5))
    path = tmp_path / "robot.toml"
    status, message = init(path, "--channel", "can0", "--fd")
    assert status == exit_codes.OK, message
    drives = load_configuration(path).drive
    assert {joint: drives[joint].node_id for joint in JOINTS} == dict(zip(JOINTS, (4, 5, 7, 9), strict=True))
    assert {drive.type for drive in drives.values()} == {name}
    assert {drive.serial_number for drive in drives.values()} == {SERIALS[name].format(each) for each in (4, 5, 7, 9)}
    if name == "mit":
        assert "DM8009" in path.read_text(encoding="utf-8")


def test_a_named_joint_leaves_the_other_ids_to_the_other_joints(tmp_path: Path, attach: Attach) -> None:
    attach(can0=drives_of("odrive", 0, 1, 2, 3))
    path = tmp_path / "robot.toml"
    status, message = init(path, "--channel", "can0", "--node", "left_sweep=3")
    assert status == exit_codes.OK, message
    drives = load_configuration(path).drive
    assert [drives[joint].node_id for joint in JOINTS] == [3, 0, 1, 2]


def test_each_flipper_s_bus_gives_its_own_joints(tmp_path: Path, attach: Attach) -> None:
    attach(can0=drives_of("odrive", 0, 1), can1=drives_of("odrive", 0, 1))
    path = tmp_path / "robot.toml"
    status, _ = init(
        path, "--channel", "can0", "--channel", "can1", "--node", "right_sweep=1", "--node", "right_adduction=0"
    )
    drives = load_configuration(path).drive
    assert status == exit_codes.OK
    assert [drives[joint].node_id for joint in JOINTS] == [0, 1, 1, 0]


@pytest.mark.parametrize(
    ("node_ids", "arguments", "words"),
    [
        ((0, 1), (), "2 drives answer (0, 1) for the 4 joints"),
        ((), (), "0 drives answer (none)"),
        ((0, 1, 2, 3, 4), (), "5 drives answer"),
        ((0, 1, 2, 3), ("--node", "left_sweep=8"), "no drive answers under id 8"),
        ((0, 1, 2, 2), (), "id 2 answers 2 times"),
    ],
)
def test_a_bus_that_does_not_fit_the_rig_is_refused(
    tmp_path: Path, attach: Attach, node_ids: Sequence[int], arguments: tuple[str, ...], words: str
) -> None:
    attach(can0=[simulated("odrive", node_id, f"{place}") for place, node_id in enumerate(node_ids)])
    path = tmp_path / "robot.toml"
    status, message = init(path, "--channel", "can0", *arguments)
    assert status == exit_codes.CONFIGURATION and words in message and not path.exists()


def test_a_bus_that_does_not_open_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(buses: object) -> None:
        raise BusError("bus.can0 (virtual can0) does not open: it is missing")

    monkeypatch.setattr(opened_buses, "open_ports", refuse)
    path = tmp_path / "robot.toml"
    status, message = init(path, "--channel", "can0")
    assert status == exit_codes.UNHEALTHY and "does not open" in message and not path.exists()
