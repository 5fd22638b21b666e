"""The log's rows from the loop's records: the names that the fields' sources in rows.py read."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from control.limits import LimitedTorques
from control.modes import Mode
from control.records import FLIPPERS, JOINTS, BodyPose, DriveStates, GaitTarget, StrideEstimate
from estimation.mud import MudReading
from firmware_host.log.rows import COEFFICIENTS, STRIDE, TICK
from firmware_host.ticker import Tick


class TickRecord(NamedTuple):
    """Everything that one tick knew and did."""

    tick: Tick
    tick_s: float
    missed_ticks: int
    mode: Mode
    target: GaitTarget  # that was commanded while the states came about
    stride_depth_m: float
    states: DriveStates
    reading: MudReading
    body: BodyPose
    sent: LimitedTorques


tick_row: Callable[[TickRecord], bytes] = TICK.compile(
    "record",
    f"{', '.join(TickRecord._fields)} = record",
    "now_s = tick.now_s",
    f"{', '.join(JOINTS)} = states",
    f"{', '.join(f'{joint}_nm' for joint in JOINTS)} = sent.torques_nm",
    f"{', '.join(FLIPPERS)}, _ = reading",
)

stride_row: Callable[[float, StrideEstimate, float], bytes] = STRIDE.compile(
    "now_s, stride, chosen_depth_m",
    *(f"{name} = stride.{name}" for name in COEFFICIENTS),
)
