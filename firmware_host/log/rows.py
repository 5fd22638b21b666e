"""The three kinds of row in a log. A new field is one line here: name with unit, type, source and meaning.

The source of a field is the Python expression that gives its value; it uses the names that `tick_packing` and
`stride_row` define.
Wide types come first, so that a row needs no padding between its fields.
"""

from collections.abc import Callable, Mapping
from enum import IntEnum
from functools import cache
from typing import Any

from control.modes import Mode
from control.records import FLIPPERS, TWO_FLIPPERS, Phase, Rig, StrideEstimate
from firmware_host.log.schema import TEXT, Field, RowKind

MESSAGES = "mudskipper_msgs/msg"


def _numbered(values: type[IntEnum]) -> str:
    return ", ".join(f"{value} {value.name.lower()}" for value in values)


@cache
def tick_kind(rig: Rig) -> RowKind:
    """The ticks of a rig: arrays have one value for each of its joints or flippers, whose names are in the meanings."""
    joint_order = ", ".join(joint.replace("_", " ") for joint in rig.joints)
    flipper_order = f"of the mud on the joint; {', '.join(rig.flippers)}"
    return RowKind(
        "/tick",
        f"{MESSAGES}/Tick",
        (
            Field("stamp_s", "float64", "now_s", "monotonic clock when the tick began"),
            Field("wake_late_s", "float64", "tick.late_s", "how long after its deadline the tick began"),
            Field("tick_s", "float64", "tick_s", "from the wake-up until the commands were sent"),
            Field("angle_rad", "float64", "{}.angle_rad", joint_order, rig.joints),
            Field("velocity_rad_s", "float64", "{}.velocity_rad_s", joint_order, rig.joints),
            Field("current_a", "float64", "{}.current_a", "measured q current", rig.joints),
            Field("angle_age_s", "float64", "now_s - {}.angle_stamp_s", "since the position arrived", rig.joints),
            Field("current_age_s", "float64", "now_s - {}.current_stamp_s", "since the current arrived", rig.joints),
            Field("torque_command_nm", "float64", "{}_nm", "after the limits, as sent", rig.joints),
            Field("sweep_load_nm", "float64", "{}.sweep_torque_nm", flipper_order, rig.flippers),
            Field("adduction_load_nm", "float64", "{}.adduction_torque_nm", "of the mud on the joint", rig.flippers),
            Field("force_x_n", "float64", "{}.force_x_n", "forward", rig.flippers),
            Field("force_z_n", "float64", "{}.force_z_n", "up", rig.flippers),
            Field("depth_m", "float64", "{}.depth_m", "measured, below the nominal surface", rig.flippers),
            Field("depth_command_m", "float64", "target.depth_m", "below the nominal surface"),
            Field("stride_depth_m", "float64", "loop.stride_depth_m", "insertion depth chosen for this stride"),
            Field("body_x_m", "float64", "body.x_m", "position along the track; NaN without a pose"),
            Field("temperature_c", "float64", "{}.temperature_c", "of the motor", rig.joints),
            Field("tick", "uint32", "tick.number", "ticks since the start, missed ones included"),
            Field("missed_ticks", "uint32", "loop.missed_ticks", "since the start"),
            Field("stride", "int32", "target.stride", "-1 outside of a walk"),
            Field("mode", "uint8", "loop.mode", _numbered(Mode)),
            Field("phase", "uint8", "target.phase", _numbered(Phase)),
            Field("limited", "bool", "sent.limited", "the limits cut a torque"),
        ),
    )


def rig_of(definition: str) -> Rig:
    """Return the rig whose joints a definition of ticks names; where none is named, a rig with two flippers."""
    named = tuple(flipper for flipper in FLIPPERS if f"{flipper} sweep" in definition)
    return Rig(named or FLIPPERS)


COEFFICIENTS = ("k_p", "k_s", "k_e")
COEFFICIENT_UNIT = "N/m^3"
COEFFICIENT_FIELDS = tuple(
    Field(f"{name}{part}", "float64", f"{name}.{source}", COEFFICIENT_UNIT)
    for name in COEFFICIENTS
    for part, source in (("", "value"), ("_std_error", "std_error"))
)

STRIDE = RowKind(
    "/stride",
    f"{MESSAGES}/Stride",
    (
        Field("stamp_s", "float64", "now_s", "monotonic clock when the stride closed"),
        Field("t_start_s", "float64", "stride.t_start_s", "monotonic clock when the insertion began"),
        Field("insertion_s", "float64", "stride.insertion_s", "duration"),
        Field("stance_s", "float64", "stride.stance_s", "duration"),
        Field("extraction_s", "float64", "stride.extraction_s", "duration"),
        *COEFFICIENT_FIELDS,
        Field("surface_m", "float64", "stride.surface_m", "depth of the mud's surface below its nominal height"),
        Field("surface_std_error_m", "float64", "stride.surface_std_error_m"),
        Field("other_surface_m", "float64", "stride.other_surface_m", "where a trial's strokes find two; else NaN"),
        Field("depth_m", "float64", "stride.depth_m", "deepest point below that surface"),
        Field("insertion_force_n", "float64", "stride.insertion_force_n", "largest upward force"),
        Field("stance_force_n", "float64", "stride.stance_force_n", "largest forward force"),
        Field("extraction_force_n", "float64", "stride.extraction_force_n", "most negative upward force"),
        Field("step_m", "float64", "stride.step_m", "advance of the body; NaN without a pose"),
        Field(
            "position_m", "float64", "stride.position_m",
            "of the body along the track when the insertion ended; NaN without a pose", formerly=("place_m",),
        ),
        Field("tare_n", "float64", "stride.tare_n", "weight of the mud that clings to the flipper"),
        Field("tare_drift_n", "float64", "stride.tare_drift_n", "since the stride before"),
        Field("extraction_torque_nm", "float64", "stride.extraction_torque_nm", "largest one of the mud on adduction"),
        Field("chosen_depth_m", "float64", "chosen_depth_m", "insertion depth of the next stride"),
        Field("index", "uint32", "stride.index", "number of the stride in its walk"),
        *(Field(f"{name}_samples", "uint32", f"{name}.samples", "distinct ones in the fit") for name in COEFFICIENTS),
        Field("flipper", "uint8", "stride.flipper != 'left'", "0 left, 1 right"),
        *(Field(f"{name}_valid", "bool", f"{name}.valid", "the coefficient can be used") for name in COEFFICIENTS),
        *(Field(f"{name}_at_least", "bool", f"{name}.at_least", "it is a lower bound") for name in COEFFICIENTS),
        Field("released", "bool", "stride.released", "out of the mud without a recovery, before swing began"),
    ),
)  # fmt: skip

EVENT = RowKind(
    "/event",
    f"{MESSAGES}/Event",
    (
        Field("stamp_s", "float64", meaning="monotonic clock of the event"),
        Field("text", TEXT, meaning="a change of mode, a fault, a request"),
    ),
)


def row_kinds(rig: Rig) -> tuple[RowKind, RowKind, RowKind]:
    return tick_kind(rig), STRIDE, EVENT


def opening_kinds(opening: Mapping[str, Any]) -> tuple[RowKind, RowKind, RowKind]:
    """Return the kinds of a log's rows by the opening that its loop sends: it names the flippers, or there are two."""
    return row_kinds(Rig(tuple(opening.get("flippers", FLIPPERS))))


TICK = tick_kind(TWO_FLIPPERS)
ROW_KINDS = row_kinds(TWO_FLIPPERS)
TICK_KIND, STRIDE_KIND, EVENT_KIND = range(len(ROW_KINDS))  # a row's kind on its way into a file


@cache
def tick_packing(rig: Rig) -> Callable[..., bytes]:
    """Make the function that packs the row of a tick from the tick, its duration in s, and the loop after it."""
    return tick_kind(rig).compile(
        "tick, tick_s, loop",
        "now_s, target, body, sent = tick.now_s, loop.target, loop.body, loop.sent",
        f"{', '.join(rig.joints)} = loop.states",
        f"{', '.join(f'{joint}_nm' for joint in rig.joints)} = sent.torques_nm",
        f"{', '.join(rig.flippers)}, = loop.learning.loads",
    )


stride_row: Callable[[float, StrideEstimate, float], bytes] = STRIDE.compile(
    "now_s, stride, chosen_depth_m",
    *(f"{name} = stride.{name}" for name in COEFFICIENTS),
)
