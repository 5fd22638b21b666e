"""What a log holds: three kinds of row, each a table of fields from which everything else follows.

A row is one ROS 2 message in CDR: four bytes of encapsulation (little-endian), then the fields in the table's order.
Doubles stand first, so every field is aligned as CDR wants it without padding, and one `struct` call packs a whole
row. The same table yields the ros2msg text that viewers read, the packing, and the unpacking; every row begins with
its monotonic stamp.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

CDR_HEADER = b"\x00\x01\x00\x00"  # CDR, little-endian, no options
FORMAT_OF = {"float64": "d", "float32": "f", "uint32": "I", "int32": "i", "uint8": "B", "bool": "?"}


@dataclass(frozen=True)
class Field:
    name: str
    kind: str  # a ROS 2 primitive, or "string" in the last place of a row
    count: int = 1  # more than one makes a fixed-size array
    meaning: str = ""


class RowKind:
    """One channel of the log: its topic, its ROS 2 message name and its fields."""

    def __init__(self, topic: str, message: str, fields: Sequence[Field]) -> None:
        self.topic = topic
        self.schema_name = f"mudskipper_msgs/msg/{message}"
        self.fields = tuple(fields)
        self.has_text = fields[-1].kind == "string"
        packed = self.fields[:-1] if self.has_text else self.fields
        self.layout = struct.Struct("<4s" + "".join(f"{f.count}{FORMAT_OF[f.kind]}" for f in packed))

    @property
    def ros_text(self) -> str:
        """The ros2msg definition, each field with its meaning as a comment."""
        lines = []
        for field in self.fields:
            array = f"[{field.count}]" if field.count > 1 else ""
            lines.append(f"{field.kind}{array} {field.name}  # {field.meaning}".rstrip(" #"))
        return "\n".join(lines) + "\n"

    def encode(self, *values: Any) -> bytes:
        """Values flat, arrays spread out; a text row's text last."""
        if not self.has_text:
            return self.layout.pack(CDR_HEADER, *values)
        text: bytes = values[-1].encode() + b"\x00"
        fixed = self.layout.pack(CDR_HEADER, *values[:-1])
        padding = b"\x00" * (-(len(fixed) - len(CDR_HEADER)) % 4)
        return fixed + padding + struct.pack("<I", len(text)) + text

    def decode(self, data: bytes) -> dict[str, Any]:
        """By field name; arrays as tuples."""
        flat = self.layout.unpack_from(data)[1:]
        row: dict[str, Any] = {}
        place = 0
        for field in self.fields[:-1] if self.has_text else self.fields:
            row[field.name] = flat[place] if field.count == 1 else flat[place : place + field.count]
            place += field.count
        if self.has_text:
            start = self.layout.size + -(self.layout.size - len(CDR_HEADER)) % 4
            (length,) = struct.unpack_from("<I", data, start)
            row[self.fields[-1].name] = data[start + 4 : start + 3 + length].decode(errors="replace")
        return row


JOINT_ORDER = "left sweep, left adduction, right sweep, right adduction"

TICK = RowKind(
    "/tick",
    "Tick",
    (
        Field("stamp_s", "float64", meaning="monotonic clock when the tick began"),
        Field("wake_late_s", "float64", meaning="how long after its deadline the tick began"),
        Field("tick_s", "float64", meaning="from the wake-up until the commands were sent"),
        Field("angle_rad", "float64", 4, JOINT_ORDER),
        Field("velocity_rad_s", "float64", 4),
        Field("current_a", "float64", 4, "measured q current"),
        Field("angle_age_s", "float64", 4, "since the position arrived"),
        Field("current_age_s", "float64", 4),
        Field("torque_command_nm", "float64", 4, "after the limits, as sent"),
        Field("sweep_load_nm", "float64", 2, "left, right: what the mud does to the joint"),
        Field("adduction_load_nm", "float64", 2),
        Field("force_x_n", "float64", 2, "forward"),
        Field("force_z_n", "float64", 2, "up"),
        Field("depth_m", "float64", 2, "measured, below the nominal surface"),
        Field("depth_command_m", "float64", meaning="below the nominal surface"),
        Field("stride_depth_m", "float64", meaning="insertion depth chosen for this stride"),
        Field("body_x_m", "float64", meaning="along the track; NaN without a pose"),
        Field("temperature_c", "float64", 4),
        Field("tick", "uint32", meaning="ticks since the start, missed ones included"),
        Field("missed_ticks", "uint32", meaning="since the start"),
        Field("stride", "int32", meaning="-1 outside of a walk"),
        Field("mode", "uint8", meaning="0 boot, 1 idle, 2 arming, 3 hold, 4 walking, 5 stopping, 6 fault, 7 damping"),
        Field("phase", "uint8", meaning="0 rest, 1 insertion, 2 stance, 3 extraction, 4 swing, 5 pause, 6 recovery"),
        Field("limited", "bool", meaning="the limits cut a torque"),
    ),
)

COEFFICIENT_FIELDS = tuple(
    Field(f"{name}{part}", "float64", meaning=meaning)
    for name in ("k_p", "k_s", "k_e")
    for part, meaning in (("", "N/m^3"), ("_std_error", "N/m^3"))
)

STRIDE = RowKind(
    "/stride",
    "Stride",
    (
        Field("stamp_s", "float64", meaning="monotonic clock when the stride closed"),
        Field("t_start_s", "float64"),
        Field("insertion_s", "float64", meaning="duration"),
        Field("stance_s", "float64"),
        Field("extraction_s", "float64"),
        *COEFFICIENT_FIELDS,
        Field("surface_m", "float64", meaning="depth of the mud's surface below its nominal height"),
        Field("surface_std_error_m", "float64"),
        Field("depth_m", "float64", meaning="deepest point below that surface"),
        Field("insertion_force_n", "float64"),
        Field("stance_force_n", "float64"),
        Field("extraction_force_n", "float64"),
        Field("step_m", "float64", meaning="NaN without a pose"),
        Field("place_m", "float64", meaning="of the body when the insertion ended; NaN without a pose"),
        Field("tare_n", "float64", meaning="weight of what clings to the flipper"),
        Field("tare_drift_n", "float64", meaning="since the stride before"),
        Field("extraction_torque_nm", "float64", meaning="of the mud on the adduction joint, at its hardest"),
        Field("chosen_depth_m", "float64", meaning="insertion depth of the next stride"),
        Field("index", "uint32"),
        Field("k_p_samples", "uint32"),
        Field("k_s_samples", "uint32"),
        Field("k_e_samples", "uint32"),
        Field("flipper", "uint8", meaning="0 left, 1 right"),
        Field("k_p_valid", "bool"),
        Field("k_s_valid", "bool"),
        Field("k_e_valid", "bool"),
        Field("k_p_at_least", "bool", meaning="the value is a lower bound"),
        Field("k_s_at_least", "bool"),
        Field("k_e_at_least", "bool"),
        Field("released", "bool", meaning="out of the mud without a recovery, before swing began"),
    ),
)

EVENT = RowKind(
    "/event",
    "Event",
    (Field("stamp_s", "float64"), Field("text", "string", meaning="a change of mode, a fault, a request")),
)

ROW_KINDS = (TICK, STRIDE, EVENT)
TICK_KIND, STRIDE_KIND, EVENT_KIND = range(len(ROW_KINDS))  # a row's kind on its way into a file
