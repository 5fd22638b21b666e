"""An independent reader finds named scalars, poses, forces, frames and diagnostics in what viewers are served."""

from itertools import pairwise
from math import isfinite, nan
from typing import Any

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from scipy.spatial.transform import Rotation

from command_line.live.standard_messages import MESSAGE_HZ, ROS, TOPICS, StandardMessages, flipper_pose
from control.geometry import FlipperGeometry
from control.modes import Mode
from control.records import FLIPPERS, JOINTS
from logs.files.log_reader import Log, read_log
from tests.folders import ROOT

GEOMETRY = FlipperGeometry()
Messages = dict[str, list[tuple[int, Any]]]  # by topic, each with its time in ns


@pytest.fixture(scope="module")
def log() -> Log:
    return read_log(ROOT / "tests/fixtures/walk_0_1.mcap")


@pytest.fixture(scope="module")
def served(log: Log) -> Messages:
    """Return the messages of a recorded walk, as bytes."""
    standard = StandardMessages(GEOMETRY)
    coming = sorted([*log.strides, *log.events], key=lambda row: float(row["stamp_s"]), reverse=True)
    messages: Messages = {}
    for tick in log.ticks:
        while coming and coming[-1]["stamp_s"] <= tick["stamp_s"]:
            row = coming.pop()
            (standard.add_stride if "flipper" in row else standard.add_event)(row)
        if standard.is_due(int(tick["tick"])):
            time_ns = round(tick["stamp_s"] * 1e9)
            for topic, message in standard.of_tick(time_ns, tick).items():
                messages.setdefault(topic, []).append((time_ns, message))
    return messages


@pytest.fixture(scope="module")
def decoded(served: Messages) -> Messages:
    """Return the messages decoded by another library than that which encodes them, with the definitions served."""
    found: Messages = {}
    for number, (topic, messages) in enumerate(served.items(), 1):
        definition = ROS.generate_msgdef(TOPICS[topic], ros_version=2)[0].encode()
        decode = DecoderFactory().decoder_for("cdr", Schema(number, definition, "ros2msg", TOPICS[topic]))
        assert decode is not None
        found[topic] = [(time_ns, decode(message)) for time_ns, message in messages]
    return found


@pytest.fixture
def tick(log: Log) -> dict[str, Any]:
    first = log.ticks[0]
    return {name: first[name] for name in log.ticks.dtype.names or ()}


def test_ticks_have_messages_once_their_number_begins_again(tick: dict[str, Any]) -> None:
    standard = StandardMessages(GEOMETRY)
    standard.of_tick(0, tick | {"tick": 2**32 - 1})
    assert standard.is_due(0) and not standard.is_due(2**32 - 1)


def test_a_body_whose_pose_is_missing_stays_where_it_was_measured_last(tick: dict[str, Any]) -> None:
    standard, positions_m = StandardMessages(GEOMETRY), []
    for body_x_m in (nan, 1.2, nan):
        messages = standard.of_tick(0, tick | {"body_x_m": body_x_m})
        assert ("/odom" in messages) == isfinite(body_x_m)
        frames: Any = ROS.deserialize_cdr(messages["/tf"], TOPICS["/tf"])
        positions_m.append(frames.transforms[0].transform.translation.x)
    assert positions_m == [0.0, 1.2, 1.2]


def test_joints_that_were_not_heard_yet_are_left_out(tick: dict[str, Any]) -> None:
    messages = StandardMessages(GEOMETRY).of_tick(0, tick | {"angle_rad": [0.1, nan, 0.3, 0.4]})
    decoded: Any = {topic: ROS.deserialize_cdr(content, TOPICS[topic]) for topic, content in messages.items()}
    state, frames = decoded["/joint_states"], decoded["/tf"].transforms
    assert state.name == ["left_sweep", "right_sweep", "right_adduction"] and state.position.tolist() == [0.1, 0.3, 0.4]
    assert [frame.child_frame_id for frame in frames] == ["base_link", "right_edge", "right_flipper"]
    assert not {"/left/pose", "/left/force"} & decoded.keys()


def test_joints_have_names_and_the_values_of_the_log(log: Log, decoded: Messages) -> None:
    states = decoded["/joint_states"]
    assert all(tuple(state.name) == JOINTS for _, state in states)
    chosen = log.ticks[:: round(380 / MESSAGE_HZ)]
    assert np.array_equal(np.stack([state.position for _, state in states]), chosen["angle_rad"])
    assert np.array_equal(np.stack([state.effort for _, state in states]), chosen["torque_command_nm"])
    time_ns, state = states[-1]
    assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == time_ns


def test_messages_come_at_50_to_100_hz_in_the_order_of_time(decoded: Messages) -> None:
    for topic in TOPICS.keys() - {"/diagnostics"}:
        times_ns = [time_ns for time_ns, _ in decoded[topic]]
        steps_s = [(after - before) / 1e9 for before, after in pairwise(times_ns)]
        assert min(steps_s) >= 0.01 and max(steps_s) <= 0.02, topic


def test_forces_and_frames_are_those_of_the_geometry(log: Log, decoded: Messages) -> None:
    chosen = log.ticks[:: round(380 / MESSAGE_HZ)]
    for number, flipper in enumerate(FLIPPERS):
        forces = [message.wrench.force for _, message in decoded[f"/{flipper}/force"]]
        assert np.array_equal([force.z for force in forces], chosen["force_z_n"][:, number], equal_nan=True)
        poses = [message.pose.position for _, message in decoded[f"/{flipper}/pose"]]
        depths_m = np.array([-(position.z + GEOMETRY.axis_height_m) for position in poses])
        differences_m = np.abs(depths_m - chosen["depth_m"][:, number])  # the loop takes it at the current's stamp
        assert np.median(differences_m) < 1e-4 and differences_m.max() < 0.005
    _, frames = decoded["/tf"][-1]
    parents = {each.child_frame_id: each.header.frame_id for each in frames.transforms}
    assert parents["base_link"] == "odom" and parents["left_flipper"] == "left_edge"
    assert frames.transforms[0].transform.translation.x == chosen["body_x_m"][-1]
    positions_m = [message.pose.pose.position.x for _, message in decoded["/odom"]]
    assert np.array_equal(positions_m, chosen["body_x_m"])


@pytest.mark.parametrize("flipper", FLIPPERS)
def test_the_frame_of_a_flipper_turns_with_its_arm(flipper: str) -> None:
    """The lower edge is l along the arm and h below it, in the frame of the flipper."""
    side = 1.0 if flipper == "left" else -1.0
    for sweep_rad, adduction_rad in ((0.0, 0.0), (0.6, 0.0), (0.0, -0.4), (-0.5, 0.7)):
        pose = flipper_pose(GEOMETRY, flipper, sweep_rad, adduction_rad)
        arm_m = np.array([0.0, side * GEOMETRY.flipper_length_m, -GEOMETRY.drop_m])
        assert Rotation.from_quat(pose.quaternion).apply(arm_m) == pytest.approx(pose.position_m)


def test_diagnostics_name_mode_joints_and_mud(log: Log, decoded: Messages) -> None:
    time_ns, last = decoded["/diagnostics"][-1]
    statuses = {status.name: {item.key: item.value for item in status.values} for status in last.status}
    assert statuses.keys() == {"robot", *JOINTS, "left mud", "right mud"}
    tick = log.ticks[np.argmin(np.abs(log.ticks["stamp_s"] - time_ns / 1e9))]
    assert statuses["robot"]["mode"] == Mode(tick["mode"]).name.lower()
    assert float(statuses["left_sweep"]["current_a"]) == pytest.approx(tick["current_a"][0], rel=1e-5)
    assert float(statuses["left mud"]["k_p"]) == pytest.approx(log.strides[-2]["k_p"], rel=1e-5)
    assert len(decoded["/diagnostics"]) < 40
