"""The three kinds of row in a log. A new field is a line of a table here, and its value in the packer below the table.

Wide types come first, so that a row needs no padding between its fields. The words of an enumeration and the names of
the joints and flippers, in whose order an array has its values, are data: the log has them in its channels' metadata.
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from functools import cache
from itertools import chain
from typing import Any

from control.limits import LimitedTorques
from control.modes import Mode
from control.records import (
    COEFFICIENTS,
    FLIPPERS,
    STANCES,
    TWO_FLIPPERS,
    UNKNOWN,
    BodyPose,
    DriveStates,
    FlipperLoad,
    GaitTarget,
    Phase,
    Rig,
    StrideEstimate,
)
from firmware_host.log.schema import CDR_HEADER, TEXT, Field, RowKind
from firmware_host.ticker import Tick

MESSAGES = "mudskipper_msgs/msg"


def _enumeration(name: str, words: Sequence[str]) -> Field:
    meaning = ", ".join(f"{number} {word}" for number, word in enumerate(words))
    return Field(name, "uint8", meaning, words=tuple(words))


def _names(values: type[IntEnum]) -> tuple[str, ...]:
    return tuple(value.name.lower() for value in values)


@cache
def tick_kind(rig: Rig) -> RowKind:
    """Return the row of a tick, whose arrays have one value for each joint or flipper of the rig."""
    joint_order = ", ".join(joint.replace("_", " ") for joint in rig.joints)
    flipper_order = f"of the mud on the joint; {', '.join(rig.flippers)}"
    return RowKind(
        "/tick",
        f"{MESSAGES}/Tick",
        (
            Field("stamp_s", "float64", "monotonic clock when the tick began"),
            Field("wake_late_s", "float64", "how long after its deadline the tick began"),
            Field("tick_s", "float64", "from the wake-up until the commands were sent"),
            Field("angle_rad", "float64", joint_order, rig.joints),
            Field("velocity_rad_s", "float64", joint_order, rig.joints),
            Field("current_a", "float64", "measured q current", rig.joints),
            Field("angle_age_s", "float64", "since the position arrived", rig.joints),
            Field("current_age_s", "float64", "since the current arrived", rig.joints),
            Field("torque_command_nm", "float64", "after the limits, as sent", rig.joints),
            Field("sweep_load_nm", "float64", flipper_order, rig.flippers),
            Field("adduction_load_nm", "float64", "of the mud on the joint", rig.flippers),
            Field("force_x_n", "float64", "forward", rig.flippers),
            Field("force_z_n", "float64", "up", rig.flippers),
            Field("depth_m", "float64", "measured, below the nominal surface", rig.flippers),
            Field("depth_command_m", "float64", "below the nominal surface"),
            Field("stride_depth_m", "float64", "insertion depth chosen for this stride"),
            Field("body_x_m", "float64", "position along the track; NaN without a pose"),
            Field("temperature_c", "float64", "of the motor", rig.joints),
            Field("bus_voltage_v", "float64", "of the drive's supply", rig.joints),
            Field("bus_current_a", "float64", "that the drive takes from its supply", rig.joints),
            Field("tick", "uint32", "ticks since the start, missed ones included"),
            Field("missed_ticks", "uint32", "since the start"),
            Field("stride", "int32", "-1 outside of a walk"),
            _enumeration("mode", _names(Mode)),
            _enumeration("phase", _names(Phase)),
            Field("limited", "bool", "the limits cut a torque"),
            Field("power_cut", "bool", "the motors' power is cut, as by the emergency stop"),
        ),
        metadata={"flippers": " ".join(rig.flippers), "joints": " ".join(rig.joints)},
    )


def tick_row(
    kind: RowKind,
    tick: Tick,
    tick_s: float,
    states: DriveStates,
    sent: LimitedTorques,
    loads: Sequence[FlipperLoad],
    target: GaitTarget,
    stride_depth_m: float,
    body: BodyPose,
    missed_ticks: int,
    mode: Mode,
    power_cut: bool,
) -> bytes:
    """Pack the values of one tick, in the order of the table above."""
    now_s = tick.now_s
    columns = zip(*states, strict=True)
    angles_rad, velocities_rad_s, angle_stamps_s, currents_a, current_stamps_s, _, _, _, *slow = columns
    temperatures_c, _, voltages_v, _, supply_currents_a = slow
    return kind.layout.pack(
        CDR_HEADER,
        now_s,
        tick.late_s,
        tick_s,
        *angles_rad,
        *velocities_rad_s,
        *currents_a,
        *[now_s - stamp_s for stamp_s in angle_stamps_s],
        *[now_s - stamp_s for stamp_s in current_stamps_s],
        *sent.torques_nm,
        *chain.from_iterable(zip(*loads, strict=True)),  # field by field: torques, forces, depths
        target.depth_m,
        stride_depth_m,
        body.x_m,
        *temperatures_c,
        *voltages_v,
        *supply_currents_a,
        tick.number & 0xFFFFFFFF,  # from 0 again after 130 days: a larger one would end the loop
        missed_ticks,
        target.stride,
        mode,
        target.phase,
        sent.limited,
        power_cut,
    )


def rig_of(metadata: Mapping[str, str]) -> Rig:
    """Return the rig that the metadata of ticks names; a rig with two flippers where it names none."""
    named = metadata.get("flippers", "").split()
    return Rig(tuple(flipper for flipper in FLIPPERS if flipper in named) or FLIPPERS)


COEFFICIENT_UNIT = "N/m^3"
COEFFICIENT_PARTS = {
    "": COEFFICIENT_UNIT,
    "_std_error": f"{COEFFICIENT_UNIT}, with what all strides have in common",
    "_repeatability": f"{COEFFICIENT_UNIT}, standard error between strides of one session",
    "_depth_m": "deepest point of the stroke below the surface",
    "_speed_m_s": "of the flipper in the stroke",
}
COEFFICIENT_FIELDS = tuple(
    Field(f"{name}{part}", "float64", meaning) for name in COEFFICIENTS for part, meaning in COEFFICIENT_PARTS.items()
)

STRIDE = RowKind(
    "/stride",
    f"{MESSAGES}/Stride",
    (
        Field("stamp_s", "float64", "monotonic clock when the stride closed"),
        Field("t_start_s", "float64", "monotonic clock when the insertion began"),
        Field("insertion_s", "float64", "duration"),
        Field("stance_s", "float64", "duration"),
        Field("extraction_s", "float64", "duration"),
        *COEFFICIENT_FIELDS,
        Field("surface_m", "float64", "depth of the mud's surface below its nominal height"),
        Field("surface_std_error_m", "float64"),
        Field("other_surface_m", "float64", "where a trial's strokes find two; else NaN"),
        Field("depth_m", "float64", "deepest point below that surface"),
        Field("insertion_force_n", "float64", "largest upward force"),
        Field("stance_force_n", "float64", "largest forward force"),
        Field("extraction_force_n", "float64", "most negative upward force"),
        Field("yield_force_n", "float64", "across the plate while the mud yielded; NaN where it did not"),
        Field("yield_force_std_error_n", "float64", "between strides of one session"),
        Field("step_m", "float64", "advance of the body; NaN without a pose"),
        Field(
            "position_m", "float64",
            "of the body along the track when the insertion ended; NaN without a pose", formerly=("place_m",),
        ),
        Field("tare_n", "float64", "weight of the mud that clings to the flipper"),
        Field("tare_drift_n", "float64", "since the stride before"),
        Field("extraction_torque_nm", "float64", "largest one of the mud on adduction"),
        Field("chosen_depth_m", "float64", "insertion depth of the next stride"),
        Field("supply_min_v", "float64", "lowest of the flipper's drives since its stride before closed"),
        Field("index", "uint32", "number of the stride in its walk"),
        *(Field(f"{name}_samples", "uint32", "distinct ones in the fit") for name in COEFFICIENTS),
        _enumeration("flipper", FLIPPERS),
        _enumeration("stance", STANCES),
        *(Field(f"{name}_valid", "bool", "the coefficient can be used") for name in COEFFICIENTS),
        *(Field(f"{name}_at_least", "bool", "it is a lower bound") for name in COEFFICIENTS),
        Field("released", "bool", "out of the mud without a recovery, before swing began"),
    ),
)  # fmt: skip


def stride_row(now_s: float, stride: StrideEstimate, chosen_depth_m: float, supply_min_v: float = UNKNOWN) -> bytes:
    """Pack a stride that closed at this time: its estimates have the names of the fields."""
    values = {field.name: getattr(stride, field.name, None) for field in STRIDE.fields}
    for name in COEFFICIENTS:
        estimate = getattr(stride, name)
        parts = {f"{name}_{part}": value for part, value in estimate._asdict().items()}
        values |= {name: estimate.value} | {key: value for key, value in parts.items() if key in values}
    values |= {"stamp_s": now_s, "chosen_depth_m": chosen_depth_m, "supply_min_v": supply_min_v}
    values |= {"flipper": FLIPPERS.index(stride.flipper), "stance": STANCES.index(stride.stance)}
    return STRIDE.encode(*values.values())


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
