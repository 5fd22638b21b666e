"""The bounds of faults that depend on the machine; control/monitors detects these faults."""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning


@dataclass(frozen=True)
class FaultBounds:
    """The bounds of faults that depend on the machine. T is the loop's period of 2.63 ms."""

    late_s: Annotated[float, Bounds(0.003, 2.0), Meaning("without position or current: reported")] = 0.0053  # 2 T
    quiet_s: Annotated[float, Bounds(0.005, 2.0), Meaning("without position: damping; without current alone: hold")] = (
        0.0079  # 3 T
    )
    silence_s: Annotated[
        float,
        Bounds(0.005, 2.0),
        Meaning("without position: drives idle; without current alone: soft stop; of the loop itself: damping"),
    ] = 0.0263  # 10 T
    jump_rad: Annotated[
        float, Bounds(0.01, 10.0), Meaning("of a position beyond what a joint can do: noise, late stamps")
    ] = 0.05
    fast_s: Annotated[float, Bounds(0.003, 2.0), Meaning("faster than the velocity limit allows")] = 0.0079  # 3 T
    lag_s: Annotated[float, Bounds(0.005, 2.0), Meaning("missed by the loop in a row: soft stop")] = 0.0131  # 5 T
    crawl_s: Annotated[float, Bounds(0.005, 2.0), Meaning("mean of five ticks: too seldom to brake a joint")] = (
        0.0105  # 4 T
    )
    lag_fraction: Annotated[float, Bounds(0.01, 10.0), Meaning("by which 100 ticks take longer than they should")] = 0.1
    longest_watchdog_s: Annotated[
        float, Bounds(0.01, 10.0), Meaning("that a drive may be set to, or the robot is not armed")
    ] = 0.3
    voltage_low_v: Annotated[float, Bounds(0.0, 100.0), Meaning("supply below this is reported; 0: never")] = 20.0
    voltage_min_v: Annotated[float, Bounds(0.0, 100.0), Meaning("supply below this: soft stop; 0: never")] = 18.0
    disk_free_fraction: Annotated[
        float, Bounds(0.0, 0.9), Meaning("of the log's disk, below which nothing is armed without --force disk_low")
    ] = 0.05
    disk_slow_s: Annotated[float, Bounds(0.05, 60.0), Meaning("for one write of the log: reported")] = 2.0
