"""Checks values that are each within their bounds and contradict each other.

The gait must be within reach of the geometry and of the joint limits, drives and buses must be distinct, and milder
faults must begin before harder ones. Each contradiction is one message.
"""

import ipaddress
import re
from collections.abc import Iterator
from math import ceil, degrees, floor, radians
from operator import attrgetter
from pathlib import Path

from control.depth.gait_choice import gaits_and_depths
from control.geometry import FlipperGeometry
from control.joint_pd import (
    LEAST_MARGIN_RAD,
    LOOP_DELAY_S,
    largest_damping_nm_s_rad,
    largest_stiffness_nm_rad,
    phase_margin_rad,
)
from control.parameters.gait_parameters import GaitParameters
from control.plate_outline import outline_problems
from drivers.pose.natnet_sockets import is_address, parse_axis, parse_version
from drivers.power_switch import EmergencyStopParameters
from firmware_host.configuration.configuration import Configuration, PoseParameters
from firmware_host.configuration.drive_consistency import bus_problems, drive_problems, rig_problems
from firmware_host.configuration.socket_paths import operators_path, rows_path
from firmware_host.configuration.toml_records import shown

LONGEST_INTERFACE = 15  # IFNAMSIZ with its final zero
LONGEST_SOCKET_PATH = 107  # sun_path of unix(7) has 108 bytes with its final zero
LONGEST_STATUS_PATH = 97  # the operators' own socket next to it has a name with 10 bytes more
LEAST_PAUSE_S = 0.2  # after which a slow extraction measures k_e in simulation (docs/explanation/accuracy.md)
ROUNDING = 1e-6  # relative error of a number that a file gives with few digits
ORDERED = (  # pairs of keys, the first of which must be at most the second
    ("faults.late_s", "faults.quiet_s"),  # milder reactions come first
    ("faults.quiet_s", "faults.silence_s"),
    ("faults.lag_s", "faults.silence_s"),
    ("faults.voltage_min_v", "faults.voltage_low_v"),
    ("limits.temperature_warm_c", "limits.temperature_hot_c"),
    ("adaptation.min_depth_m", "adaptation.max_depth_m"),
)


def contradictions(configuration: Configuration) -> Iterator[str]:
    """Yield a message with key, value and bound for each contradiction."""
    yield from _text_problems(configuration)
    yield from rig_problems(configuration)
    yield from _pose_problems(configuration.pose)
    yield from _emergency_stop_problems(configuration.emergency_stop)
    yield from drive_problems(configuration)
    yield from bus_problems(configuration)
    yield from _plate_problems(configuration.geometry)
    if configuration.estimation.fixed_base and configuration.estimation.free_body:
        yield "estimation.free_body = true: no body on a fixed base is free; remove it or estimation.fixed_base"
    yield from _motor_force_problems(configuration)
    yield from _depth_problems(configuration)
    yield from _range_problems(configuration)
    if configuration.adaptation.method == "gait":
        yield from _sweep_problems(configuration)
    yield from _lead_problems(configuration)
    yield from _gain_problems(configuration)
    yield from _order_problems(configuration)
    yield from _winding_problems(configuration)


def gait_warnings(gait: GaitParameters) -> list[str]:
    """Return a warning for a gait that is slow enough to measure k_e, but extracts right after its stance."""
    quick_m_s = GaitParameters().extraction_speed_m_s
    if gait.pause_s >= LEAST_PAUSE_S or gait.extraction_speed_m_s >= quick_m_s:
        return []
    values = f"gait.pause_s = {gait.pause_s:g} with gait.extraction_speed_m_s = {gait.extraction_speed_m_s:g}"
    reason = "right after a stance a slow extraction gives a k_e that is too small by more than its standard error"
    return [f'{values}: {reason}; pause for {LEAST_PAUSE_S:g} s or more, as gait.protocol = "measuring" does']


def _emergency_stop_problems(stop: EmergencyStopParameters) -> Iterator[str]:
    needed = {"gpio": ("device",), "key": ("device", "key")}.get(stop.source, ())
    for key in needed:
        if not getattr(stop, key):
            yield f"emergency_stop.{key} = '': must be given for emergency_stop.source = {stop.source!r}"


def _text_problems(configuration: Configuration) -> Iterator[str]:
    name, status, pose = configuration.robot.name, configuration.status.socket, configuration.pose.socket
    if not re.fullmatch(r"[\w.-]{1,64}", name, re.ASCII) or name.startswith("."):
        yield f"robot.name = {name!r}: must be 1 to 64 letters, digits, dots, dashes or underscores"
    for key, path, longest in (
        ("status.socket", status, LONGEST_STATUS_PATH),
        ("pose.socket", pose, LONGEST_SOCKET_PATH),
    ):
        if "\0" in path or len(path.encode()) > longest:
            yield f"{key} = {path!r}: must be at most {longest} bytes long, without a zero byte"
    if not Path(status).name:
        yield f"status.socket = {status!r}: must name a socket"
    elif pose and Path(pose) in (Path(status), operators_path(Path(status)), rows_path(Path(status))):
        yield f"pose.socket = {pose!r}: must be another socket than status.socket and those next to it"
    for key in ("read_group", "drive_group"):
        if "\0" in getattr(configuration.status, key):
            yield f"status.{key}: must be without a zero byte"
    if "\0" in configuration.log.directory:
        yield f"log.directory = {configuration.log.directory!r}: must be without a zero byte"


def _lead_problems(configuration: Configuration) -> Iterator[str]:
    """Check that the lead of a recovery's targets gives the full torque in its last attempt."""
    gains, lead_deg, torque_nm = configuration.gains, configuration.recovery.lead_deg, configuration.limits.torque_nm
    needed_nm_rad = torque_nm / radians(lead_deg)
    for key in ("sweep_stiffness_nm_rad", "adduction_stiffness_nm_rad"):
        if configuration.recovery.attempts and getattr(gains, key) < needed_nm_rad:
            yield (
                f"gains.{key} = {getattr(gains, key)}: must be at least {ceil(100.0 * needed_nm_rad) / 100.0:.2f},"
                f" or a recovery.lead_deg = {lead_deg:g} does not reach limits.torque_nm = {torque_nm}"
            )


def _gain_problems(configuration: Configuration) -> Iterator[str]:
    """Check that the PD of each joint is stable with its inertia and the delay of the loop."""
    gains, arm = configuration.gains, configuration.arm
    for kind in ("sweep", "adduction"):
        stiffness_nm_rad, damping_nm_s_rad, inertia_kg_m2 = (
            getattr(gains, f"{kind}_stiffness_nm_rad"),
            getattr(gains, f"{kind}_damping_nm_s_rad"),
            getattr(arm, f"{kind}_inertia_kg_m2"),
        )
        if phase_margin_rad(stiffness_nm_rad, damping_nm_s_rad, inertia_kg_m2) >= LEAST_MARGIN_RAD:
            continue
        damping, stiffness = f"gains.{kind}_damping_nm_s_rad = {damping_nm_s_rad}", f"gains.{kind}_stiffness_nm_rad"
        reason = f"arm.{kind}_inertia_kg_m2 = {inertia_kg_m2:g} and the delay of {LOOP_DELAY_S * 1e3:.1f} ms"
        most_nm_s_rad = largest_damping_nm_s_rad(inertia_kg_m2)
        if damping_nm_s_rad > most_nm_s_rad:
            yield f"{damping}: must be at most {floor(1e4 * most_nm_s_rad) / 1e4:g} for {reason}"
        else:
            most_nm_rad = floor(100.0 * largest_stiffness_nm_rad(damping_nm_s_rad, inertia_kg_m2)) / 100.0
            yield f"{stiffness} = {stiffness_nm_rad}: must be at most {most_nm_rad:g} for {damping}, {reason}"


def _order_problems(configuration: Configuration) -> Iterator[str]:
    for lower, upper in ORDERED:
        low, high = attrgetter(lower)(configuration), attrgetter(upper)(configuration)
        if low > high:
            yield f"{lower} = {low}: must be at most {upper} = {high}"


def _winding_problems(configuration: Configuration) -> Iterator[str]:
    room_c, limits = configuration.winding.room_c, configuration.limits
    nearly_hot_c = (limits.temperature_warm_c + limits.temperature_hot_c) / 2.0
    if room_c >= nearly_hot_c:
        yield (
            f"winding.room_c = {room_c}: must be less than {nearly_hot_c:g}, the middle of limits.temperature_warm_c"
            " and temperature_hot_c, or a resting motor counts as too hot"
        )


def _plate_problems(geometry: FlipperGeometry) -> Iterator[str]:
    """Check that the plate is a polygon, and that it lies beyond the sweep axis."""
    problems = list(outline_problems(geometry.plate_corners_m)) if geometry.plate_corners_m else []
    yield from (f"geometry.plate_corners_m: {problem}" for problem in problems)
    if problems:
        return
    inward_m = -min(outward_m for outward_m, _ in geometry.plate.corners)
    if inward_m >= geometry.flipper_length_m:
        yield (
            f"geometry.flipper_length_m = {geometry.flipper_length_m}: must be more than {inward_m:.4g}, the plate's"
            " extent inward from there, or the plate reaches the sweep axis"
        )


def _motor_force_problems(configuration: Configuration) -> Iterator[str]:
    """Check that the torque limit permits the force that the depth choice allows for an extraction."""
    length_m, force_n = configuration.geometry.flipper_length_m, configuration.adaptation.motor_force_n
    largest_n = configuration.limits.torque_nm / length_m
    if force_n > largest_n * (1.0 + ROUNDING):
        yield (
            f"adaptation.motor_force_n = {force_n}: must be at most {floor(100.0 * largest_n) / 100.0:.2f}"
            f" for limits.torque_nm = {configuration.limits.torque_nm}"
            f" and geometry.flipper_length_m = {length_m}"
        )


def _depth_problems(configuration: Configuration) -> Iterator[str]:
    geometry, gait, adaptation = configuration.geometry, configuration.gait, configuration.adaptation
    if geometry.clearance_m <= 0.0:
        yield (
            f"geometry.axis_height_m = {geometry.axis_height_m}: must be more than geometry.drop_m = {geometry.drop_m},"
            " or the raised flipper stays in the mud"
        )
    deepest_m = geometry.deepest_m(gait.sweep_angle_deg)
    if adaptation.max_depth_m > deepest_m:
        yield (
            f"adaptation.max_depth_m = {adaptation.max_depth_m}: out of reach, must be at most"
            f" {floor(1e4 * deepest_m) / 1e4:g} for this geometry and a sweep of ±{gait.sweep_angle_deg:g} degrees"
        )
    if not adaptation.min_depth_m <= adaptation.initial_depth_m <= adaptation.max_depth_m:
        yield (
            f"adaptation.initial_depth_m = {adaptation.initial_depth_m}: must be from {adaptation.min_depth_m}"
            f" to {adaptation.max_depth_m}, adaptation.min_depth_m and max_depth_m"
        )


def _range_problems(configuration: Configuration) -> Iterator[str]:
    limits, sweep_deg = configuration.limits, configuration.gait.sweep_angle_deg
    if limits.sweep_min_deg > -sweep_deg:
        yield f"limits.sweep_min_deg = {limits.sweep_min_deg}: must be at most {-sweep_deg:g} for gait.sweep_angle_deg"
    if limits.sweep_max_deg < sweep_deg:
        yield f"limits.sweep_max_deg = {limits.sweep_max_deg}: must be at least {sweep_deg:g} for gait.sweep_angle_deg"
    if limits.adduction_max_deg < 0.0:
        yield f"limits.adduction_max_deg = {limits.adduction_max_deg}: must be at least 0, the raised arm"
    depth_m = configuration.adaptation.max_depth_m
    if depth_m > configuration.geometry.deepest_m(sweep_deg):
        return  # _depth_problems reports it
    lowest_deg = degrees(configuration.geometry.adduction_rad(radians(sweep_deg), depth_m))
    if limits.adduction_min_deg > lowest_deg:
        yield (
            f"limits.adduction_min_deg = {limits.adduction_min_deg}: must be at most"
            f" {floor(10.0 * lowest_deg) / 10.0:g} to reach adaptation.max_depth_m = {depth_m}"
        )


def _sweep_problems(configuration: Configuration) -> Iterator[str]:
    """Check the sweeps among which the method "gait" chooses; a wide one reaches less deep."""
    geometry, limits, adaptation = configuration.geometry, configuration.limits, configuration.adaptation
    widest_deg = adaptation.gait.max_sweep_deg
    widest = f"adaptation.gait.max_sweep_deg = {widest_deg}"
    within_deg = limits.widest_sweep_deg
    reached_m = geometry.deepest_m(widest_deg)
    if adaptation.gait.min_sweep_deg > widest_deg:
        yield f"adaptation.gait.min_sweep_deg = {adaptation.gait.min_sweep_deg}: must be at most {widest}"
    if widest_deg > within_deg:
        yield f"{widest}: must be at most {within_deg:g} for limits.sweep_min_deg and sweep_max_deg"
    if adaptation.min_depth_m > reached_m:
        yield f"{widest}: reaches {reached_m:.4f} m, less than adaptation.min_depth_m = {adaptation.min_depth_m}"
        return
    poses = [
        geometry.adduction_rad(radians(gait.sweep_angle_deg), depth_m)
        for gait, depth_m in gaits_and_depths(adaptation, geometry, configuration.gait)
    ]
    lowest_deg = degrees(min(poses))
    if limits.adduction_min_deg > lowest_deg:
        yield (
            f"limits.adduction_min_deg = {limits.adduction_min_deg}: must be at most"
            f" {floor(10.0 * lowest_deg) / 10.0:g} for adaptation.gait.min_sweep_deg to max_sweep_deg"
        )


def _pose_problems(pose: PoseParameters) -> Iterator[str]:
    """Yield a message with key, value and bound for each problem."""
    if pose.chosen == "socket" and not pose.socket:
        yield "pose.socket = '': must name a socket where pose.source = 'socket'"
    if pose.chosen in ("natnet", "rail_encoder") and pose.socket:
        yield f"pose.socket = {pose.socket!r}: must be left out where pose.source = {pose.chosen!r}"
    if parse_axis(pose.axis) is None:
        yield f"pose.axis = {shown(pose.axis)}: must be x, y or z, with or without a minus, or three numbers, not all 0"
    if pose.chosen == "natnet":
        yield from _natnet_problems(pose)
    if pose.chosen == "rail_encoder":
        yield from _encoder_problems(pose)


def _natnet_problems(pose: PoseParameters) -> Iterator[str]:
    natnet = pose.natnet
    if natnet.server and not is_address(natnet.server):
        yield f"pose.natnet.server = {natnet.server!r}: must be an address of four numbers, such as 192.168.1.10"
    if natnet.group and not (is_address(natnet.group) and ipaddress.IPv4Address(natnet.group).is_multicast):
        yield f"pose.natnet.group = {natnet.group!r}: must be from 224.0.0.0 to 239.255.255.255, or empty"
    name = natnet.interface
    is_name = len(name.encode()) <= LONGEST_INTERFACE and name.isprintable() and not set(name) & set("/ ")
    if not (is_name or is_address(name)):
        longest = f"a name of at most {LONGEST_INTERFACE} letters, such as eth0, or an address of this computer"
        yield f"pose.natnet.interface = {name!r}: must be {longest}"
    if natnet.version and parse_version(natnet.version) is None:
        yield f"pose.natnet.version = {natnet.version!r}: must be from 2.6 to 4.255, such as 4.1"
    if natnet.body and natnet.body_id:
        yield f"pose.natnet.body_id = {natnet.body_id}: must be left out where pose.natnet.body names the body"
    if natnet.server:
        return
    if not natnet.group:
        yield "pose.natnet.server = '': must be given where pose.natnet.group is empty"
    if not natnet.version:
        yield "pose.natnet.version = '': must be given where no pose.natnet.server can be asked for it"
    if natnet.body:
        yield f"pose.natnet.body = {natnet.body!r}: needs a pose.natnet.server to ask; or give pose.natnet.body_id"


def _encoder_problems(pose: PoseParameters) -> Iterator[str]:
    encoder = pose.rail_encoder
    if not encoder.device or "\0" in encoder.device:
        yield f"pose.rail_encoder.device = {encoder.device!r}: must name a serial port, such as /dev/ttyACM0"
    if encoder.metres_per_count == 0.0:
        yield "pose.rail_encoder.metres_per_count = 0.0: must be given, and not 0"
