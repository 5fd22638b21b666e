"""The source of the body's pose: its configuration, opening, and report."""

import time
from contextlib import closing
from math import isfinite
from pathlib import Path
from typing import Any

import pytest

from drivers.pose.natnet_bridge import NatNetBridge
from drivers.pose.natnet_port import NatNetPort
from drivers.pose.natnet_sockets import parse_axis
from drivers.pose.pose_port import NoPose, PosePort, PoseReport, PoseSender, PoseSourceError
from drivers.pose.rail_encoder import RailEncoder
from firmware_host.configuration.configuration import PoseParameters
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from firmware_host.daemon import EXIT_FAILED, main
from firmware_host.operator.arming_checks import arming_checks
from firmware_host.pose_sources import open_pose
from simulation.devices.natnet_server import NatNetServer, RecordedPose
from simulation.devices.rail_encoder_emulator import EmulatedRailEncoder
from simulation.harness.local_setup import write_local_setup
from tests.firmware_host.recorded_robot import RecordedRobot
from tests.waiting import LONGEST_S

NATNET = 'source = "natnet"\n'
TABLE = NATNET + "[pose.natnet]\n"
ENCODER = 'source = "rail_encoder"\n[pose.rail_encoder]\n'


def pose_of(example_text: str, section: str) -> PoseParameters:
    return parse_configuration(f"{example_text}\n[pose]\n{section}").pose


def problems_of(example_text: str, section: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        pose_of(example_text, section)
    return caught.value.problems


@pytest.mark.parametrize(
    ("section", "chosen"),
    [
        ("", "none"),
        ('socket = "/run/pose"', "socket"),
        ('source = "socket"\nsocket = "/run/pose"', "socket"),
        ('source = "none"\nsocket = "/run/pose"', "none"),
        (TABLE + 'server = "192.168.1.10"', "natnet"),
        (TABLE + 'version = "4.1"', "natnet"),
        (
            NATNET + 'axis = [0.7, 0, -0.7]\n[pose.natnet]\nserver = "10.0.0.1"\ngroup = ""\ninterface = "eth0"',
            "natnet",
        ),
        (ENCODER + 'device = "/dev/ttyACM0"\nmetres_per_count = -0.00001', "rail_encoder"),
    ],
)
def test_the_pose_section_chooses_the_source(example_text: str, section: str, chosen: str) -> None:
    assert pose_of(example_text, section).chosen == chosen


@pytest.mark.parametrize(
    ("section", "reported"),
    [
        ('source = "gps"', "pose.source = 'gps': should be"),
        ('source = "socket"', "pose.socket = '': must name a socket where pose.source = 'socket'"),
        (NATNET + 'socket = "/s"\n[pose.natnet]\nversion = "4.1"', "pose.socket = '/s': must be left out where"),
        ('axis = "w"', "pose.axis = 'w': must be x, y or z"),
        ("axis = [inf, 0, 0]", "pose.axis = [inf, 0, 0]: must be"),
        ("axis = 1979-05-27", "pose.axis = datetime.date(1979, 5, 27): must be"),
        (NATNET, "pose.natnet.version = '': must be given where no pose.natnet.server can be asked for it"),
        (TABLE + 'group = ""\nversion = "4.1"', "pose.natnet.server = '': must be given where"),
        (TABLE + 'server = "motive.lab"', "pose.natnet.server = 'motive.lab': must be an address"),
        (TABLE + 'version = "4.1"\ngroup = "10.0.0.1"', "pose.natnet.group = '10.0.0.1': must be from"),
        (TABLE + 'version = "2.5"', "pose.natnet.version = '2.5': must be from 2.6"),
        (TABLE + 'version = "4.1"\nbody = "a"', "pose.natnet.body = 'a': needs a pose.natnet.server"),
        (
            TABLE + 'server = "10.0.0.1"\nbody = "a"\nbody_id = 3',
            "pose.natnet.body_id = 3: must be left out",
        ),
        (TABLE + 'version = "4.1"\ninterface = "a/b"', "pose.natnet.interface = 'a/b': must be a name"),
        (ENCODER + "metres_per_count = 0.001", "pose.rail_encoder.device = '': must name a serial port"),
        (ENCODER + 'device = "/dev/ttyACM0"', "pose.rail_encoder.metres_per_count = 0.0: must be given, and not 0"),
    ],
)
def test_invalid_pose_sections_are_refused_with_key_and_value(example_text: str, section: str, reported: str) -> None:
    assert any(message.startswith(reported) for message in problems_of(example_text, section))


def test_the_section_that_the_example_shows_is_valid(example_text: str) -> None:
    before, heading, shown = example_text.partition("# [pose]\n")
    text = before + "".join(line.removeprefix("# ").removeprefix("#") for line in (heading + shown).splitlines(True))
    pose = parse_configuration(text).pose
    assert pose.chosen == "natnet" and pose.natnet.body == "mudskipper"
    assert pose.rail_encoder.metres_per_count == 1e-5


def test_an_axis_is_a_unit_vector() -> None:
    assert parse_axis("x") == (1.0, 0.0, 0.0)
    assert parse_axis("-z") == (0.0, 0.0, -1.0)
    assert parse_axis([0, 3, -4.0]) == (0.0, 0.6, -0.8)
    for malformed in ("--x", "", 3, ["x", 0, 0], [10**400, 0, 0]):
        assert parse_axis(malformed) is None


def test_the_chosen_source_is_opened(example_text: str, short_folder: Path) -> None:
    assert isinstance(open_pose(PoseParameters()), NoPose)
    with closing(open_pose(PoseParameters(socket=str(short_folder / "pose")))) as pose:
        assert isinstance(pose, PosePort)
    natnet = pose_of(
        example_text, NATNET + 'axis = "-y"\norigin_m = 1.0\n[pose.natnet]\nserver = "127.0.0.1"\ngroup = ""'
    )
    with closing(open_pose(natnet)) as pose:
        assert isinstance(pose, NatNetPort)


def test_motion_capture_is_received_by_a_process_of_its_own(example_text: str) -> None:
    """A body moves along -y; the process ends with its owner, and its end is reported."""
    with NatNetServer() as server:
        section = NATNET + 'axis = "-y"\norigin_m = 1.0\n[pose.natnet]\nserver = "127.0.0.1"\ngroup = ""\n'
        section += f"command_port = {server.address[1]}"
        stream = NatNetBridge(pose_of(example_text, section).natnet, (0.0, -1.0, 0.0))
        with closing(NatNetPort(stream, 1.0)) as pose:
            begun_s = time.monotonic()
            while not isfinite(x_m := pose.read(now_s := time.monotonic()).x_m) and now_s < begun_s + LONGEST_S:
                server.add(RecordedPose(now_s, (0.0, -3.0 - 1e-6 * (now_s - begun_s), 0.0)))
                server.step(now_s)
                time.sleep(0.005)
            assert x_m == pytest.approx(2.0, abs=1e-3)
            stream._program.kill()
            stream._program.wait()
            pose.read(time.monotonic() + 1.0)
            assert "has ended" in pose.report().trouble


def test_a_refusal_of_that_process_is_the_daemon_s(example_text: str) -> None:
    section = TABLE + 'server = "127.0.0.1"\ngroup = ""\ninterface = "nothing0"'
    with pytest.raises(PoseSourceError, match="from 127.0.0.1 on nothing0: No such device"):
        open_pose(pose_of(example_text, section))


def test_a_rail_encoder_is_opened(example_text: str, tmp_path: Path) -> None:
    pytest.importorskip("serial", reason="pyserial is not installed")
    counter = EmulatedRailEncoder(tmp_path / "encoder", 1e-5)
    section = f'{ENCODER}device = "{counter.device}"\nmetres_per_count = 1e-5'
    with closing(open_pose(pose_of(example_text, section))) as pose:
        assert isinstance(pose, RailEncoder)
    counter.unplug()
    with pytest.raises(PoseSourceError, match="does not open"):
        open_pose(pose_of(example_text, section))


def test_the_daemon_exits_with_a_message_if_the_source_does_not_open(
    short_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("serial", reason="pyserial is not installed")
    path = write_local_setup(short_folder, short_folder / "logs")
    text = path.read_text(encoding="utf-8")
    before, _, after = text.partition("[pose]\n")
    after = after.partition("\n\n")[2]
    path.write_text(
        f'{before}[pose]\n{ENCODER}device = "/dev/nothing"\nmetres_per_count = 1e-5\n\n{after}', encoding="utf-8"
    )
    assert main(["--config", str(path)]) == EXIT_FAILED
    weakened, reported = capsys.readouterr().err.splitlines(keepends=True)
    assert weakened.startswith("mudskipperd: warning: protection is weakened")
    assert reported == "mudskipperd: the rail encoder /dev/nothing does not open: No such file or directory\n"


def pose_line(robot: RecordedRobot) -> dict[str, Any]:
    (line,) = [item for item in arming_checks(robot.loop, []) if item["id"] == "pose"]
    return line


def test_check_reports_trouble_of_the_pose_source_without_blocking_arming(
    robot: RecordedRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = NoPose()
    robot.loop.pose = source
    reported = PoseReport("camera", 12, 3, 4)
    monkeypatch.setattr(source, "report", lambda: reported)
    line = pose_line(robot)
    assert line["ok"] and line["text"] == "camera: 12 poses, 3 malformed messages, 4 without the body"
    reported = reported._replace(trouble="it is dark.", what_to_do="switch on the light")
    line = pose_line(robot)
    assert line["ok"] and line["warning"] and line["fix"] == "switch on the light"
    assert line["text"].startswith("it is dark. camera: 12 poses")


def test_a_socket_s_poses_reach_the_loop(robot: RecordedRobot, short_folder: Path) -> None:
    with closing(open_pose(PoseParameters(socket=str(short_folder / "pose")))) as pose:
        robot.loop.pose = pose
        sender = PoseSender(short_folder / "pose")
        sender.send(0.0, 0.25)
        robot.step()
        assert robot.loop.body.x_m == 0.25
        robot.run_for(0.3)
        assert not isfinite(robot.loop.body.x_m)
        assert "pose_lost" in robot.fault_names
        line = pose_line(robot)
        assert line["warning"] and line["fix"] and f"no pose arrives at {short_folder}/pose any more" in line["text"]
        sender.close()
