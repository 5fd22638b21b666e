"""The extremes of each drive's supply are those of all blocks of a log, also where a drive reports nothing."""

from math import nan

import numpy as np

from experiments.run_report.supply_range import SupplyRange
from logs.files.tick_array import tick_type


def test_a_dip_of_one_drive_is_found_with_its_time() -> None:
    ticks = np.zeros(6, tick_type())
    ticks["stamp_s"] = np.arange(6)
    ticks["bus_voltage_v"] = [24.0, 24.0, 24.0, nan]
    ticks["bus_voltage_v"][0, 0] = nan  # before its first answer
    ticks["bus_voltage_v"][[2, 4], 1] = 19.5, 18.0
    ticks["bus_current_a"] = [nan, 0.5, -0.2, nan]
    ticks["bus_current_a"][5, 1] = 7.0
    supply = SupplyRange(("a", "b", "c", "d"))
    for block in (ticks[:0], ticks[:3], ticks[3:]):
        supply.add(block)
    names = ("joint", "lowest_v", "lowest_stamp_s", "highest_v", "most_a")
    assert [tuple(row[name] for name in names) for row in supply.rows()] == [
        ("a", 24.0, 1.0, 24.0, None),
        ("b", 18.0, 4.0, 24.0, 7.0),
        ("c", 24.0, 0.0, 24.0, -0.2),
    ]
