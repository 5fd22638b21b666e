"""Standard ROS 2 messages of ticks: joints, frames, the pose of and the force on each flipper, diagnostics.

Every fourth tick has its messages (95 Hz; ticks that were thinned at rest all have them), and the diagnostics come once
a second and with the first such tick after a stride or an event. rosbags knows the definitions and encodes.

The frames follow REP 103 and 105: x forward, y left, z up, in metres. `odom` is fixed, its z = 0 is the nominal surface
of the mud; `base_link` is the intersection of the flippers' axes (the configuration knows no distance between left and
right); `left_edge` is the middle of the plate's lower edge with the axes of the body, and `left_flipper` is there too
and turns with the flipper, its y axis along the arm.
"""

from collections.abc import Iterator, Mapping
from math import cos, inf, isfinite, sin
from typing import Any, NamedTuple

import numpy as np
from rosbags.typesys import Stores, get_typestore

from control.geometry import FlipperGeometry
from control.modes import Mode
from control.rate import RATE_HZ
from control.records import COEFFICIENTS, FLIPPERS, TWO_FLIPPERS, Rig
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from firmware_host.log.rows import EVENT, STRIDE, TICK, TICK_KIND, rig_of
from operator_client.live_rows import LiveRow, LiveRows

ROS = get_typestore(Stores.ROS2_HUMBLE)
MESSAGE_HZ = 95.0
TICKS_A_MESSAGE = max(1, round(RATE_HZ / MESSAGE_HZ))
UNMEASURED = 1e6  # variance, in m² or rad², of what no sensor measures
DIAGNOSTICS_S = 1.0  # between two of them
ODOM, BASE = "odom", "base_link"
OK, WARN, ERROR = range(3)
STRIDE_VALUES = ("index", *(f"{k}{part}" for k in COEFFICIENTS for part in ("", "_std_error")), "depth_m", "step_m")
JOINT_VALUES = ("current_a", "temperature_c", "angle_age_s", "current_age_s")
WORDS = {field.name: dict(enumerate(field.words)) for field in TICK.fields}
TOPICS = {  # that a robot may have, with their messages
    "/joint_states": "sensor_msgs/msg/JointState",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    **{f"/{flipper}/pose": "geometry_msgs/msg/PoseStamped" for flipper in FLIPPERS},
    **{f"/{flipper}/force": "geometry_msgs/msg/WrenchStamped" for flipper in FLIPPERS},
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
Row = Any  # one element of the array of ticks, or a mapping with its fields


def make(name: str, *values: Any) -> Any:
    """Return a message or a part of one, such as geometry_msgs/Vector3, of its fields in ROS's order."""
    return ROS.types[name.replace("/", "/msg/")](*values)


def vector(x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/Vector3", float(x), float(y), float(z))


class FlipperPose(NamedTuple):
    position_m: tuple[float, float, float]  # of the lower edge's middle, from base_link
    quaternion: tuple[float, float, float, float]  # x, y, z, w


UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def flipper_pose(geometry: FlipperGeometry, flipper: str, sweep_rad: float, adduction_rad: float) -> FlipperPose:
    """Left is R_x(β)·R_z(-α); right is its mirror image in the plane y = 0."""
    side = 1.0 if flipper == "left" else -1.0
    x_m, y_m, z_m = geometry.edge_position(sweep_rad, adduction_rad)
    sin_a, cos_a = sin(-side * sweep_rad / 2.0), cos(sweep_rad / 2.0)
    sin_b, cos_b = sin(side * adduction_rad / 2.0), cos(adduction_rad / 2.0)
    return FlipperPose((x_m, side * y_m, z_m), (sin_b * cos_a, -sin_b * sin_a, cos_b * sin_a, cos_b * cos_a))


def variances(x_is_measured: bool) -> Any:
    """Return a covariance in which what no sensor measures is unknown, and the error of x is not given."""
    return np.diag([0.0 if x_is_measured else UNMEASURED, *[UNMEASURED] * 5]).ravel()


class StandardMessages:
    """Owns the latest stride of each flipper, the latest event, and the position of the body."""

    def __init__(self, geometry: FlipperGeometry, rig: Rig = TWO_FLIPPERS) -> None:
        self._geometry, self._rig = geometry, rig
        self._strides: dict[str, Mapping[str, Any]] = {}
        self._event = ""
        self._body_x_m = 0.0  # measured last
        self._last_tick, self._diagnosed_s = -TICKS_A_MESSAGE, -inf

    def of_row(self, row: LiveRow, stamp_ns: int, wanted: bool = True) -> dict[str, bytes]:
        """Return the messages of a tick that is due, if they are wanted; the next diagnostics have the other rows."""
        if row.kind.topic == STRIDE.topic:
            self.add_stride(row.values)
        elif row.kind.topic == EVENT.topic:
            self.add_event(row.values)
        elif wanted and self.is_due((tick := row.values)["tick"]):
            return self.of_tick(stamp_ns, tick)
        return {}

    def add_stride(self, stride: Mapping[str, Any]) -> None:
        self._strides[FLIPPERS[bool(stride["flipper"])]] = stride
        self._diagnosed_s = -inf

    def add_event(self, event: Mapping[str, Any]) -> None:
        self._event = str(event["text"])
        self._diagnosed_s = -inf

    def is_due(self, tick: int) -> bool:
        return not 0 <= tick - self._last_tick < TICKS_A_MESSAGE  # ticks begin again after 130 days

    def of_tick(self, stamp_ns: int, tick: Row) -> dict[str, bytes]:
        """Return the messages of a tick that is due, encoded, by topic."""
        self._last_tick, stamp_s = int(tick["tick"]), float(tick["stamp_s"])
        stamp = make("builtin_interfaces/Time", *divmod(stamp_ns, 1_000_000_000))
        messages = dict(self._messages(stamp, tick))
        if stamp_s >= self._diagnosed_s + DIAGNOSTICS_S:
            self._diagnosed_s = stamp_s
            header = make("std_msgs/Header", stamp, "")
            messages["/diagnostics"] = make("diagnostic_msgs/DiagnosticArray", header, list(self._statuses(tick)))
        return {topic: bytes(ROS.serialize_cdr(message, TOPICS[topic])) for topic, message in messages.items()}

    def _messages(self, stamp: Any, tick: Row) -> Iterator[tuple[str, Any]]:
        """Yield all but the diagnostics. While a pose is missing the body stands still: viewers draw no NaN."""

        def header(frame: str) -> Any:
            return make("std_msgs/Header", stamp, frame)

        def transform(parent: str, child: str, position_m: tuple[float, ...], quaternion: tuple[float, ...]) -> Any:
            turned = make("geometry_msgs/Quaternion", *quaternion)
            placed = make("geometry_msgs/Transform", vector(*position_m), turned)
            return make("geometry_msgs/TransformStamped", header(parent), child, placed)

        body_x_m, angles_rad = float(tick["body_x_m"]), [float(angle) for angle in tick["angle_rad"]]
        heard = np.isfinite(angles_rad)  # nothing is known of the others before their drives are switched on
        signals = (np.array(tick[name], float)[heard] for name in ("angle_rad", "velocity_rad_s", "torque_command_nm"))
        names = [joint for joint, is_heard in zip(self._rig.joints, heard, strict=True) if is_heard]
        yield "/joint_states", make("sensor_msgs/JointState", header(BASE), names, *signals)
        if isfinite(body_x_m):
            self._body_x_m = body_x_m
            position = make("geometry_msgs/Point", body_x_m, 0.0, self._geometry.axis_height_m)
            pose = make("geometry_msgs/Pose", position, make("geometry_msgs/Quaternion", *UPRIGHT))
            measured = make("geometry_msgs/PoseWithCovariance", pose, variances(x_is_measured=True))
            still = make("geometry_msgs/Twist", vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
            twist = make("geometry_msgs/TwistWithCovariance", still, variances(x_is_measured=False))
            yield "/odom", make("nav_msgs/Odometry", header(ODOM), BASE, measured, twist)
        base_m = (self._body_x_m, 0.0, self._geometry.axis_height_m)
        frames = [transform(ODOM, BASE, base_m, UPRIGHT)]
        for number, flipper in enumerate(self._rig.flippers):
            if not all(heard[2 * number : 2 * number + 2]):
                continue
            edge = f"{flipper}_edge"
            position_m, quaternion = flipper_pose(self._geometry, flipper, *angles_rad[2 * number : 2 * number + 2])
            frames.append(transform(BASE, edge, position_m, UPRIGHT))
            frames.append(transform(edge, f"{flipper}_flipper", (0.0, 0.0, 0.0), quaternion))
            parts = make("geometry_msgs/Point", *position_m), make("geometry_msgs/Quaternion", *quaternion)
            yield (
                f"/{flipper}/pose",
                make("geometry_msgs/PoseStamped", header(BASE), make("geometry_msgs/Pose", *parts)),
            )
            force_n = vector(tick["force_x_n"][number], 0.0, tick["force_z_n"][number])
            wrench = make("geometry_msgs/Wrench", force_n, vector(0.0, 0.0, 0.0))
            yield f"/{flipper}/force", make("geometry_msgs/WrenchStamped", header(edge), wrench)
        yield "/tf", make("tf2_msgs/TFMessage", frames)

    def _statuses(self, tick: Row) -> Iterator[Any]:
        """Yield the state of the robot, of each joint, and of the mud at each flipper."""
        words = {name: WORDS[name].get(int(tick[name]), str(tick[name])) for name in ("mode", "phase")}
        level = ERROR if tick["mode"] in (Mode.FAULT, Mode.DAMPING) else OK
        numbers = {name: tick[name] for name in ("stride", "stride_depth_m", "missed_ticks", "limited")}
        yield status(level, "robot", self._event or words["mode"], words | numbers)
        for number, joint in enumerate(self._rig.joints):
            yield status(OK, joint, "", {name: tick[name][number] for name in JOINT_VALUES})
        for flipper, stride in self._strides.items():
            valid = all(stride[f"{name}_valid"] for name in COEFFICIENTS)
            text = "" if valid else "not all coefficients are valid"
            yield status(OK if valid else WARN, f"{flipper} mud", text, {name: stride[name] for name in STRIDE_VALUES})


def status(level: int, name: str, text: str, values: Mapping[str, Any]) -> Any:
    shown = {key: value if isinstance(value, str) else f"{value:.6g}" for key, value in values.items()}
    pairs = [make("diagnostic_msgs/KeyValue", *pair) for pair in shown.items()]
    return make("diagnostic_msgs/DiagnosticStatus", level, name, text, "mudskipper", pairs)


def standard_messages_of(source: LiveRows) -> StandardMessages:
    """Return those of a daemon's robot; its geometry is the default where the configuration is of another version."""
    try:
        geometry = parse_configuration(source.configuration_text).geometry
    except ConfigurationError:
        geometry = FlipperGeometry()
    return StandardMessages(geometry, rig_of(source.kinds[TICK_KIND].metadata))
