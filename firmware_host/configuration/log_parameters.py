"""What the log's writer may use: how long a file grows, how much of the disk logs may take, how much rest is worth."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning
from control.rate import RATE_HZ


@dataclass(frozen=True)
class LogParameters:
    directory: Annotated[str, Meaning("of the log folder")] = "/var/lib/mudskipper/logs"
    enabled: Annotated[bool, Meaning("record every tick, stride and event")] = True
    segment_s: Annotated[float, Bounds(1.0, 86400.0), Meaning("longest time in one file")] = (
        600.0  # a file that viewers load at once
    )
    segment_bytes: Annotated[
        int, Bounds(100_000, 2_000_000_000), Meaning("size of a file at which the next one begins")
    ] = 64_000_000
    quota_bytes: Annotated[
        int, Bounds(0, 10**15), Meaning("above which old logs are deleted, copied ones first; 0: no quota")
    ] = 8_000_000_000  # a day of torque
    min_free_fraction: Annotated[
        float, Bounds(0.0, 0.9), Meaning("of the disk, below which old logs are deleted too")
    ] = 0.1
    rest_hz: Annotated[float, Bounds(0.0, RATE_HZ), Meaning("rows per second without torque; 0: every tick")] = 10.0
    rest_full_s: Annotated[
        float, Bounds(0.0, 60.0), Meaning("before and after torque, or a change of mode, recorded in full")
    ] = 5.0


ONE_FILE = LogParameters(segment_s=1e9, segment_bytes=10**15, quota_bytes=0, min_free_fraction=0.0, rest_hz=0.0)
