"""Standard ROS 2 messages of a tick: joints, frames, the pose of and the force on each flipper, diagnostics.

The frames follow REP 103: x forward, y left, z up, in metres. `track` is fixed, its z = 0 is the nominal surface of the
mud; `base_link` is the intersection of the flippers' axes (the configuration knows no distance between left and right);
`left_edge` is the middle of the plate's lower edge with the axes of the body, and `left_flipper` is there too and turns
with the flipper, its y axis along the arm.
"""

from collections.abc import Mapping
from math import cos, isfinite, sin
from typing import Any, NamedTuple

from command_line.live.cdr import CdrMessage
from control.geometry import FlipperGeometry
from control.modes import Mode
from control.records import TWO_FLIPPERS, Rig
from firmware_host.log.rows import COEFFICIENTS, TICK

TRACK, BASE = "track", "base_link"
DIAGNOSTICS = "/diagnostics"
OK, WARN, ERROR = range(3)
STRIDE_VALUES = ("index", *(f"{k}{part}" for k in COEFFICIENTS for part in ("", "_std_error")), "depth_m", "step_m")
JOINT_VALUES = ("current_a", "temperature_c", "angle_age_s", "current_age_s")
WORDS = {field.name: dict(enumerate(field.words)) for field in TICK.fields}
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
Row = Any  # one element of the array of ticks, or a mapping with its fields


def topics_of(rig: Rig) -> dict[str, str]:
    """Return the message of each topic."""
    return {
        "/joint_states": "sensor_msgs/JointState",
        "/tf": "tf2_msgs/TFMessage",
        **{f"/{flipper}/pose": "geometry_msgs/PoseStamped" for flipper in rig.flippers},
        **{f"/{flipper}/force": "geometry_msgs/WrenchStamped" for flipper in rig.flippers},
        DIAGNOSTICS: "diagnostic_msgs/DiagnosticArray",
    }


TOPICS = topics_of(TWO_FLIPPERS)  # that a rig may have


class FlipperPose(NamedTuple):
    position_m: tuple[float, float, float]  # of the lower edge's middle, from base_link
    quaternion: tuple[float, float, float, float]  # x, y, z, w


def flipper_pose(geometry: FlipperGeometry, flipper: str, sweep_rad: float, adduction_rad: float) -> FlipperPose:
    """Left is R_x(β)·R_z(-α); right is its mirror image in the plane y = 0."""
    side = 1.0 if flipper == "left" else -1.0
    x_m, y_m, z_m = geometry.edge_position(sweep_rad, adduction_rad)
    sin_a, cos_a = sin(-side * sweep_rad / 2.0), cos(sweep_rad / 2.0)
    sin_b, cos_b = sin(side * adduction_rad / 2.0), cos(adduction_rad / 2.0)
    return FlipperPose((x_m, side * y_m, z_m), (sin_b * cos_a, -sin_b * sin_a, cos_b * sin_a, cos_b * cos_a))


def tick_messages(stamp_ns: int, tick: Row, geometry: FlipperGeometry, rig: Rig) -> dict[str, bytes]:
    """Return the messages of one tick by topic, all but the diagnostics."""
    angles = tick["angle_rad"]
    poses = {
        flipper: flipper_pose(geometry, flipper, float(angles[2 * number]), float(angles[2 * number + 1]))
        for number, flipper in enumerate(rig.flippers)
    }
    messages = {"/joint_states": _joint_state(stamp_ns, tick, rig), "/tf": _frames(stamp_ns, tick, geometry, poses)}
    for number, (flipper, pose) in enumerate(poses.items()):
        posed = CdrMessage(BASE, stamp_ns)
        posed.numbers(*pose.position_m, *pose.quaternion)
        force = CdrMessage(f"{flipper}_edge", stamp_ns)
        force.numbers(tick["force_x_n"][number], 0.0, tick["force_z_n"][number], 0.0, 0.0, 0.0)
        messages |= {f"/{flipper}/pose": posed.encoded(), f"/{flipper}/force": force.encoded()}
    return messages


def _joint_state(stamp_ns: int, tick: Row, rig: Rig) -> bytes:
    message = CdrMessage(BASE, stamp_ns)
    message.count(len(rig.joints))
    for joint in rig.joints:
        message.text(joint)
    for name in ("angle_rad", "velocity_rad_s", "torque_command_nm"):
        message.sequence(tick[name])
    return message.encoded()


def _frames(stamp_ns: int, tick: Row, geometry: FlipperGeometry, poses: Mapping[str, FlipperPose]) -> bytes:
    """Without a pose of the body it stands at the beginning of the track: viewers cannot draw NaN."""
    body_x_m = float(tick["body_x_m"])
    base_m = (body_x_m if isfinite(body_x_m) else 0.0, 0.0, geometry.axis_height_m)
    message = CdrMessage()
    message.count(1 + 2 * len(poses))
    _add_transform(message, stamp_ns, (TRACK, BASE), (*base_m, *UPRIGHT))
    for flipper, pose in poses.items():
        edge = f"{flipper}_edge"
        _add_transform(message, stamp_ns, (BASE, edge), (*pose.position_m, *UPRIGHT))
        _add_transform(message, stamp_ns, (edge, f"{flipper}_flipper"), (0.0, 0.0, 0.0, *pose.quaternion))
    return message.encoded()


def _add_transform(message: CdrMessage, stamp_ns: int, frames: tuple[str, str], numbers: tuple[float, ...]) -> None:
    message.header(stamp_ns, frames[0])
    message.text(frames[1])
    message.numbers(*numbers)


def diagnostics(stamp_ns: int, tick: Row, strides: Mapping[str, Mapping[str, Any]], event: str, rig: Rig) -> bytes:
    """Return the state of the robot, of each joint, and of the mud at each flipper; `strides` are the latest ones."""
    mode = _word("mode", tick)
    level = ERROR if tick["mode"] in (Mode.FAULT, Mode.DAMPING) else OK
    message = CdrMessage("", stamp_ns)
    message.count(1 + len(rig.joints) + len(strides))
    numbers = {name: tick[name] for name in ("stride", "stride_depth_m", "missed_ticks", "limited")}
    _add_status(message, level, "robot", event or mode, {"mode": mode, "phase": _word("phase", tick), **numbers})
    for number, joint in enumerate(rig.joints):
        _add_status(message, OK, joint, "", {name: tick[name][number] for name in JOINT_VALUES})
    for flipper, stride in strides.items():
        valid = all(stride[f"{name}_valid"] for name in COEFFICIENTS)
        values = {name: stride[name] for name in STRIDE_VALUES}
        text = "" if valid else "not all coefficients are valid"
        _add_status(message, OK if valid else WARN, f"{flipper} mud", text, values)
    return message.encoded()


def _word(name: str, tick: Row) -> str:
    return WORDS[name].get(int(tick[name]), str(tick[name]))


def _add_status(message: CdrMessage, level: int, name: str, text: str, values: Mapping[str, Any]) -> None:
    message.byte(level)
    for part in (name, text, "mudskipper"):
        message.text(part)
    message.count(len(values))
    for key, value in values.items():
        message.text(key)
        message.text(value if isinstance(value, str) else f"{value:.6g}")
