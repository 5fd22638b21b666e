"""The daemon's frames on the kernel's own CAN buses, observed with can-utils."""

from collections import Counter

import pytest

from control.rate import RATE_HZ
from drivers.odrive.codec import GET_ENCODER_ESTIMATES, GET_IQ, HEARTBEAT, SET_INPUT_TORQUE
from verification.virtual_machine.robot import Robot

LISTENING_S = 2
DRIVE_HZ = {GET_ENCODER_ESTIMATES.command: 500.0, GET_IQ.command: 500.0, HEARTBEAT.command: 10.0}  # by the guide
NODES = {"vcan0": (0, 1), "vcan1": (2, 3)}
MALFORMED = (
    *("123#", "7FF#1122334455667788", "00000123#DEADBEEF", "1FFFFFFF#FF"),  # of no drive
    *("009#", "009#0011", "001#00", "029#000000000000"),  # too short for what a drive would send
    *("009#FFFFFFFFFFFFFFFF", "034#0000C07F0000C07F"),  # not finite numbers
    *("009#R", "7E0#R8"),  # requests to a drive
)
WARNING, OFF, RESTARTED = "20000004#0004", "20000040#", "20000100#"  # linux/can/error.h


def rates_hz(robot: Robot) -> dict[str, dict[int, float]]:
    """Return the rate by bus and identifier, from the stamps of candump."""
    text = robot.shell(f"timeout {LISTENING_S} candump -L vcan0 vcan1; true")
    frames = [line.split() for line in text.splitlines()]
    stamps_s = [float(stamp.strip("()")) for stamp, _, _ in frames]
    counts = Counter((bus, int(frame.partition("#")[0], 16)) for _, bus, frame in frames)
    lasted_s = stamps_s[-1] - stamps_s[0]
    return {bus: {name: n / lasted_s for (where, name), n in counts.items() if where == bus} for bus in NODES}


def inject(robot: Robot, *frames: str) -> None:
    robot.shell("; ".join(f"cansend vcan0 {frame.ljust(25, '0') if frame[0] == '2' else frame}" for frame in frames))
    robot.shell("sleep 0.3")


def test_the_expected_messages_are_on_the_buses_at_their_rates(walking: Robot) -> None:
    for bus, seen_hz in rates_hz(walking).items():
        for node in NODES[bus]:
            for command, hz in (DRIVE_HZ | {SET_INPUT_TORQUE.command: RATE_HZ}).items():
                assert seen_hz[node << 5 | command] == pytest.approx(hz, rel=0.1 if hz > 100.0 else 0.2)
        assert {name >> 5 for name in seen_hz} == set(NODES[bus])


def test_a_walk_continues_through_malformed_frames(walking: Robot) -> None:
    before = walking.status()["bus"]
    inject(walking, *MALFORMED * 5)
    report = walking.status()
    assert report["mode"] == "walking"
    assert report["bus"]["unknown_frames"] == before["unknown_frames"]  # the kernel filters unknown ids
    assert report["bus"]["malformed_frames"] > before["malformed_frames"]
    assert walking.unit("NRestarts") == "0"


def test_a_bus_warning_is_reported_and_stops_nothing(walking: Robot) -> None:
    inject(walking, WARNING)
    report = walking.status()
    assert report["mode"] == "walking"
    assert "bus_warning" in {fault["name"] for fault in report["faults"]}
    inject(walking, RESTARTED)
    assert "bus_warning" not in {fault["name"] for fault in walking.status()["faults"]}


def test_a_controller_that_left_the_bus_takes_the_torque_away_until_an_operator_clears_it(walking: Robot) -> None:
    inject(walking, OFF)
    walking.wait_for('mudskipper status --json | grep -q \'"mode": "fault"\'')
    assert walking.status()["fault"]["name"] == "bus_off"
    assert walking.torque_is_off()
    inject(walking, RESTARTED)
    assert walking.status()["mode"] == "fault"
    assert walking.succeed("clear") == "idle\n"


def test_an_interface_that_goes_down_ends_the_walk_and_comes_back_disarmed(walking: Robot) -> None:
    process = walking.unit("MainPID")
    walking.shell("ip link set vcan0 down; sleep 2")
    report = walking.status()
    assert report["mode"] in ("fault", "damping", "boot")
    walking.shell("ip link set vcan0 up; sleep 1")
    inject(walking, RESTARTED)  # instead of a frame from a wire: on vcan all of them come from this very machine
    assert walking.torque_is_off()
    walking.put_back()  # without the bus a drive keeps its torque until its watchdog ends it
    walking.succeed("clear")
    walking.wait_until_ready()
    assert walking.unit("MainPID") == process


def test_an_interface_that_vanishes_ends_the_daemon_and_starts_it_disarmed_when_it_is_back(walking: Robot) -> None:
    process = walking.unit("MainPID")
    walking.shell("ip link delete vcan1")
    walking.wait_for("test $(systemctl is-active mudskipper) = inactive")
    walking.shell("ip link add vcan1 type vcan; ip link set vcan1 up")
    walking.wait_until_ready()
    assert walking.unit("MainPID") != process
    assert walking.torque_is_off()
