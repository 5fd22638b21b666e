"""Independent readers find named scalars, poses, forces, frames and diagnostics in an export."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from control.geometry import FlipperGeometry
from control.modes import Mode
from control.records import FLIPPERS, JOINTS
from logs.export.ros_definitions import full_definition, schema_name
from logs.export.ros_log import write_ros_log
from logs.export.ros_messages import TOPICS, flipper_pose
from logs.export.standard_messages import MESSAGE_HZ
from logs.files.log_reader import Log, read_log
from tests.folders import ROOT

GEOMETRY = FlipperGeometry()


@pytest.fixture(scope="module")
def log() -> Log:
    return read_log(ROOT / "tests/fixtures/walk_0_1.mcap")


@pytest.fixture(scope="module")
def path(log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "walk-ros.mcap"
    write_ros_log(log, GEOMETRY, path)
    return path


@pytest.fixture(scope="module")
def by_rosbags(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return all messages by topic, decoded by an independent reader, each with its time in ns."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        for connection, time_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time_ns, message))
    return found


@pytest.mark.parametrize("message", sorted(set(TOPICS.values())))
def test_definitions_are_those_of_ros(message: str) -> None:
    expected, _ = get_typestore(Stores.ROS2_HUMBLE).generate_msgdef(schema_name(message), ros_version=2)
    parts = [sorted(text.strip().split("\n" + "=" * 80 + "\n")) for text in (full_definition(message), expected)]
    assert parts[0] == parts[1]


def test_joints_have_names_and_the_values_of_the_log(log: Log, by_rosbags: dict[str, list[tuple[int, Any]]]) -> None:
    states = by_rosbags["/joint_states"]
    assert all(tuple(state.name) == JOINTS for _, state in states)
    chosen = log.ticks[:: round(380 / MESSAGE_HZ)]
    assert np.array_equal(np.stack([state.position for _, state in states]), chosen["angle_rad"])
    assert np.array_equal(np.stack([state.effort for _, state in states]), chosen["torque_command_nm"])
    offset_ns = int(log.metadata["wall_minus_monotonic_ns"])
    time_ns, state = states[-1]
    assert abs(time_ns - offset_ns - chosen["stamp_s"][-1] * 1e9) < 1000
    assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == time_ns


def test_another_reader_sees_the_same(path: Path, by_rosbags: dict[str, list[tuple[int, Any]]]) -> None:
    counts: dict[str, int] = {}
    for read in read_ros2_messages(str(path)):
        topic = read.channel.topic
        if topic == "/joint_states":
            _, state = by_rosbags[topic][counts.get(topic, 0)]
            assert (read.ros_msg.name, read.ros_msg.position) == (list(JOINTS), state.position.tolist())
        counts[topic] = counts.get(topic, 0) + 1
    assert counts == {topic: len(messages) for topic, messages in by_rosbags.items()}
    assert counts.keys() == {*TOPICS, "/tick", "/stride", "/event"}


def test_messages_come_at_50_to_100_hz_in_the_order_of_time(by_rosbags: dict[str, list[tuple[int, Any]]]) -> None:
    for topic in TOPICS.keys() - {"/diagnostics"}:
        times_ns = [time_ns for time_ns, _ in by_rosbags[topic]]
        steps_s = [(after - before) / 1e9 for before, after in pairwise(times_ns)]
        assert min(steps_s) >= 0.01 and max(steps_s) <= 0.02, topic


def test_own_rows_are_preserved(log: Log, path: Path) -> None:
    copied = read_log(path)
    assert copied.complete and copied.events == log.events
    assert repr(copied.strides) == repr(log.strides)  # as text, because NaN is not equal to NaN
    for name in log.ticks.dtype.names or ():
        assert np.array_equal(copied.ticks[name], log.ticks[name], equal_nan=True), name


def test_forces_and_frames_are_those_of_the_geometry(log: Log, by_rosbags: dict[str, list[tuple[int, Any]]]) -> None:
    chosen = log.ticks[:: round(380 / MESSAGE_HZ)]
    for number, flipper in enumerate(FLIPPERS):
        forces = [message.wrench.force for _, message in by_rosbags[f"/{flipper}/force"]]
        assert np.array_equal([force.z for force in forces], chosen["force_z_n"][:, number], equal_nan=True)
        poses = [message.pose.position for _, message in by_rosbags[f"/{flipper}/pose"]]
        depths_m = np.array([-(position.z + GEOMETRY.axis_height_m) for position in poses])
        differences_m = np.abs(depths_m - chosen["depth_m"][:, number])  # the loop takes it at the current's stamp
        assert np.median(differences_m) < 1e-4 and differences_m.max() < 0.005
    _, frames = by_rosbags["/tf"][-1]
    parents = {each.child_frame_id: each.header.frame_id for each in frames.transforms}
    assert parents["base_link"] == "track" and parents["left_flipper"] == "left_edge"
    assert frames.transforms[0].transform.translation.x == chosen["body_x_m"][-1]


@pytest.mark.parametrize("flipper", FLIPPERS)
def test_the_frame_of_a_flipper_turns_with_its_arm(flipper: str) -> None:
    """The lower edge is l along the arm and h below it, in the frame of the flipper."""
    side = 1.0 if flipper == "left" else -1.0
    for sweep_rad, adduction_rad in ((0.0, 0.0), (0.6, 0.0), (0.0, -0.4), (-0.5, 0.7)):
        pose = flipper_pose(GEOMETRY, flipper, sweep_rad, adduction_rad)
        arm_m = np.array([0.0, side * GEOMETRY.flipper_length_m, -GEOMETRY.drop_m])
        assert Rotation.from_quat(pose.quaternion).apply(arm_m) == pytest.approx(pose.position_m)


def test_diagnostics_name_mode_joints_and_mud(log: Log, by_rosbags: dict[str, list[tuple[int, Any]]]) -> None:
    time_ns, last = by_rosbags["/diagnostics"][-1]
    statuses = {status.name: {item.key: item.value for item in status.values} for status in last.status}
    assert statuses.keys() == {"robot", *JOINTS, "left mud", "right mud"}
    stamp_s = (time_ns - int(log.metadata["wall_minus_monotonic_ns"])) / 1e9
    tick = log.ticks[np.argmin(np.abs(log.ticks["stamp_s"] - stamp_s))]
    assert statuses["robot"]["mode"] == Mode(tick["mode"]).name.lower()
    assert float(statuses["left_sweep"]["current_a"]) == pytest.approx(tick["current_a"][0], rel=1e-5)
    assert float(statuses["left mud"]["k_p"]) == pytest.approx(log.strides[-2]["k_p"], rel=1e-5)
    assert len(by_rosbags["/diagnostics"]) < 40
