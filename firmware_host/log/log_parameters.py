"""What the log's writer may use: how long a file grows, how much of the disk logs may take, how much rest is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds


@dataclass(frozen=True)
class LogParameters:
    directory: str = "logs"
    enabled: bool = True
    segment_s: Annotated[float, Bounds(1.0, 86400.0)] = 600.0  # a file that viewers load at once
    segment_bytes: Annotated[int, Bounds(100_000, 2_000_000_000)] = 64_000_000
    quota_bytes: Annotated[int, Bounds(0, 10**15)] = 8_000_000_000  # two days of torque; 0: no quota
    min_free_fraction: Annotated[float, Bounds(0.0, 0.9)] = 0.1  # of the disk, which others need too
    rest_hz: Annotated[float, Bounds(0.0, 380.0)] = 10.0  # rows per second without torque; 0: every one
    rest_full_s: Annotated[float, Bounds(0.0, 60.0)] = 5.0  # before and after torque, or a change of mode, in full


ONE_FILE = LogParameters(segment_s=1e9, segment_bytes=10**15, quota_bytes=0, min_free_fraction=0.0, rest_hz=0.0)
