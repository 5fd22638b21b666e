"""The daemon with moteus drives on the kernel's CAN FD buses, observed with can-utils."""

from collections import Counter
from collections.abc import Iterator

import pytest

from control.rate import RATE_HZ
from drivers.moteus.codec import command_id, reply_id
from verification.virtual_machine.robot import Robot

LISTENING_S = 2
NODES = {"vcan0": (1, 2), "vcan1": (3, 4)}
CLASSIC_MTU, FD_MTU = 16, 72  # linux/can.h
BIT_RATE_SWITCH = 1  # of the flags that candump prints after ##
WITH_MOTEUS = """\
cd /etc/mudskipper
cp mudskipper.toml good.toml
/opt/mudskipper/venv/bin/python - <<'END'
from pathlib import Path
import tomlkit
from simulation.harness.drive_presets import calibrated
path = Path("mudskipper.toml")
configuration = tomlkit.parse(path.read_text())
for bus in configuration["bus"].values():
    bus["data_bit_rate_kbit_s"] = 5000
for number, joint in enumerate(("left_sweep", "left_adduction", "right_sweep", "right_adduction"), 1):
    configuration["drive"][joint] |= {"type": "moteus", "node_id": number, "torque_constant_nm_a": 0.0719}
configuration["gains"] = {
    "sweep_stiffness_nm_rad": 6.4,
    "sweep_damping_nm_s_rad": 0.054,
    "adduction_stiffness_nm_rad": 8.0,
    "adduction_damping_nm_s_rad": 0.072,
}
path.write_text(calibrated(tomlkit.dumps(configuration)))
END
"""


def set_up(robot: Robot, mtu: int) -> None:
    """Start daemon and simulated robot on buses of this frame size."""
    robot.shell("systemctl stop mudskipper simulated-robot")
    for bus in NODES:  # one after the other: the kernel refuses another size while the interface is up
        robot.shell(f"ip link set {bus} down && ip link set {bus} mtu {mtu} && ip link set {bus} up")
    robot.shell("systemctl start simulated-robot mudskipper; true")


@pytest.fixture
def moteus(robot: Robot) -> Iterator[Robot]:
    """The robot with moteus drives; afterwards with ODrives again."""
    robot.shell(WITH_MOTEUS)
    try:
        yield robot
    finally:
        robot.shell(
            "systemctl stop mudskipper simulated-robot; mv /etc/mudskipper/good.toml /etc/mudskipper/mudskipper.toml"
        )
        set_up(robot, CLASSIC_MTU)


def test_moteus_drives_answer_one_fd_frame_with_another_in_every_tick_of_a_walk(moteus: Robot) -> None:
    set_up(moteus, FD_MTU)
    moteus.wait_until_ready()
    moteus.walk()
    text = moteus.shell(f"timeout {LISTENING_S} candump -L {' '.join(NODES)}; true")
    frames = [line.split() for line in text.splitlines()]
    assert all(int(frame.partition("##")[2][:1], 16) & BIT_RATE_SWITCH for _, _, frame in frames)
    lasted_s = float(frames[-1][0].strip("()")) - float(frames[0][0].strip("()"))
    counts = Counter((bus, int(frame.partition("#")[0], 16)) for _, bus, frame in frames)
    expected = {
        (bus, id_of(node)) for bus, nodes in NODES.items() for node in nodes for id_of in (command_id, reply_id)
    }
    assert set(counts) == expected
    assert {name: count / lasted_s for name, count in counts.items()} == dict.fromkeys(
        expected, pytest.approx(RATE_HZ, rel=0.1)
    )
    assert moteus.status()["mode"] == "walking"
    assert moteus.succeed("stop") == "hold\n"
    assert moteus.succeed("disarm") == "idle\n"


def test_an_interface_without_can_fd_is_refused_before_anything_is_energised(moteus: Robot) -> None:
    set_up(moteus, CLASSIC_MTU)
    moteus.wait_for("test $(systemctl is-active mudskipper) != active")
    assert "set up without CAN FD" in moteus.journal()
