"""Checks whether the fixed base moved in a trial: by its pose, by the loads of the joints in free air, by the surface.

Before its insertion and after its stride a flipper is at the same position above the mud. The loads of its joints there
should be equal, except for mud that clings to the flipper, which loads the adduction joint alone. A surface that is
found far from its configured height means that the base or the mud is at another height.
"""

from math import isfinite
from typing import Any

import numpy as np

from control.modes import Mode
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log

POSE_M = 0.002
INVALID_M = 0.01  # a tenth of a stance: 10 % of travel and speed, which changes the mud's resistance by 0.6 %
SWEEP_NM = 0.05  # three times the repeatability of the paper's motors at 0.5 N·m
ADDUCTION_NM = 0.25  # 2 N of clinging mud, twice that of the authors' logs
SURFACE_M = 0.01
WINDOW_S = 0.1


def pose_remarks(before_m: float | None, after_m: float | None, bound_m: float = POSE_M) -> list[str]:
    """Describe a motion of the base beyond the bound; return nothing where it is smaller or unknown."""
    if before_m is None or after_m is None or abs(after_m - before_m) <= bound_m:
        return []
    return [f"the base moved by {1000.0 * (after_m - before_m):.1f} mm: clamp it, and measure again"]


def load_remarks(log: Log, configuration: Configuration, flipper: str) -> list[str]:
    """Compare the loads before the first insertion and at the end of the log, when the robot holds its pose."""
    ticks, stamps_s = log.ticks, log.ticks["stamp_s"]
    inserting = (ticks["mode"] == Mode.WALKING) & (ticks["phase"] == Phase.INSERTION)
    inserted_s = stamps_s[inserting].min(initial=np.inf)
    before = ticks[(stamps_s >= inserted_s - WINDOW_S) & (stamps_s < inserted_s)]
    after = ticks[(ticks["mode"] == Mode.HOLD) & (stamps_s >= stamps_s[-1] - WINDOW_S)]
    if not (len(before) and len(after)):
        return []
    remarks = []
    sweep = log.rig.joints_of(flipper).start
    for joint, bound_nm in ((sweep, SWEEP_NM), (sweep + 1, ADDUCTION_NM)):
        change_a = float(after["current_a"][:, joint].mean() - before["current_a"][:, joint].mean())
        change_nm = abs(configuration.torque_constants_nm_a[joint] * change_a)
        if isfinite(change_nm) and change_nm > bound_nm:
            remarks.append(
                f"the load of {log.rig.joints[joint]} in free air changed by {change_nm:.2f} N·m during the"
                " stride: clean the flipper, check that the base is firm, and measure again"
            )
    return remarks


def surface_remarks(stride: dict[str, Any]) -> list[str]:
    surface_m = stride["surface_m"]
    if surface_m is None or abs(surface_m) <= SURFACE_M:
        return []
    where = "below" if surface_m > 0.0 else "above"
    return [
        f"the mud was met {1000.0 * abs(surface_m):.0f} mm {where} its nominal height: fill it up to "
        "geometry.axis_height_m below the axes, or measure that height again"
    ]
