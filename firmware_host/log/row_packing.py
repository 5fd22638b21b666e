"""Packs the log's rows: defines the names that the fields' sources in rows.py read."""

from __future__ import annotations

from collections.abc import Callable

from control.records import FLIPPERS, JOINTS, StrideEstimate
from firmware_host.log.rows import COEFFICIENTS, STRIDE, TICK

tick_row: Callable[..., bytes] = TICK.compile(  # of a tick, its duration in s, and the loop after it
    "tick, tick_s, loop",
    "now_s, target, body, sent = tick.now_s, loop.target, loop.body, loop.sent",
    f"{', '.join(JOINTS)} = loop.states",
    f"{', '.join(f'{joint}_nm' for joint in JOINTS)} = sent.torques_nm",
    f"{', '.join(FLIPPERS)}, _ = loop.learning.reading",
)

stride_row: Callable[[float, StrideEstimate, float], bytes] = STRIDE.compile(
    "now_s, stride, chosen_depth_m",
    *(f"{name} = stride.{name}" for name in COEFFICIENTS),
)
