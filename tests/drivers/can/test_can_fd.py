"""CAN FD on every kind of port, and its refusal where an interface does not carry it."""

from pathlib import Path

import can
import pytest

from drivers.can.can_fd import CLASSIC_INTERFACES, FD_MTU, carries_fd, fd_options
from drivers.can.can_port import CanPort, PythonCanPort, open_port
from drivers.can.frames import Frame
from drivers.moteus import codec
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import with_drive_type
from tests.folders import ROOT

TORQUE = Frame(0x8001, codec.encode_torque(0.25), is_extended=True, is_fd=True, bit_rate_switch=True)
EXAMPLE = with_drive_type((ROOT / "systemd" / "mudskipper.toml").read_text(encoding="utf-8"), "moteus")


def interface_of(tmp_path: Path, mtu: str) -> Path:
    folder = tmp_path / "sys/class/net/can0"
    folder.mkdir(parents=True)
    (folder / "mtu").write_text(mtu)
    return folder


def crosses(near: CanPort, far: CanPort) -> bool:
    near.send(TORQUE)
    (frame,) = far.receive()
    return frame[:5] == TORQUE[:5] and frame[6:] == TORQUE[6:]


@pytest.mark.parametrize("interface", ["virtual", "mudskipper_local"])
def test_a_torque_command_crosses_a_bus_that_was_opened_for_can_fd(interface: str, tmp_path: Path) -> None:
    near, far = (open_port(interface, str(tmp_path), {}, fd=True) for _ in range(2))
    assert crosses(near, far)
    near.close()
    far.close()


def test_a_frame_is_not_sent_on_a_bus_without_can_fd_and_counted() -> None:
    near, far = (PythonCanPort(can.Bus(interface="virtual", channel="classic")) for _ in range(2))
    near.send(TORQUE)
    assert (near.failed_sends, far.receive()) == (1, []) and "CAN FD" in near.last_send_error
    near.close()
    far.close()


@pytest.mark.parametrize("interface", sorted(CLASSIC_INTERFACES))
def test_an_adapter_without_can_fd_is_refused_by_name(interface: str) -> None:
    with pytest.raises(ValueError, match=f"^{interface} carries no CAN FD"):
        open_port(interface, "/dev/ttyACM0", {}, fd=True)


@pytest.mark.parametrize(("mtu", "carries"), [("16\n", False), (f"{FD_MTU}\n", True), ("nonsense", None)])
def test_the_mtu_shows_whether_an_interface_carries_can_fd(mtu: str, carries: bool | None, tmp_path: Path) -> None:
    assert carries_fd(interface_of(tmp_path, mtu)) is carries
    if carries is False:
        with pytest.raises(ValueError, match="can0 is set up without CAN FD"):
            fd_options("socketcan", "can0", tmp_path)
    else:
        assert fd_options("socketcan", "can0", tmp_path) == {"fd": True}


def test_an_interface_that_is_missing_is_the_opening_s_own_problem(tmp_path: Path) -> None:
    assert fd_options("socketcan", "can7", tmp_path) == {"fd": True}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("node_id = 2", "node_id = 127", "drive.left_adduction.node_id = 127: must be at most 126"),
        (
            'type = "moteus"',
            'type = "moteus"\nserial_number = "012345678901"',
            "drive.left_sweep.serial_number = '012345678901': must be 24 hexadecimal digits",
        ),
    ],
)
def test_an_id_or_a_serial_number_that_no_moteus_has_is_refused_by_its_key(old: str, new: str, message: str) -> None:
    assert old in EXAMPLE
    with pytest.raises(ConfigurationError) as refused:
        parse_configuration(EXAMPLE.replace(old, new, 1))
    assert any(problem.startswith(message) for problem in refused.value.problems), refused.value.problems
