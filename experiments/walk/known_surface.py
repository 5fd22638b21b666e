"""The paper's law of shear with a known surface, to test its statements on body drag without the error of its trigger.

The published method finds the surface where the upward force first passes 0.5 N. In soft mud, and with mud that clings
to the flipper, that is far too deep. k_s depends on the square of the depth below the surface and becomes several times
too large, so that the paper's statements on body drag cannot be tested. Here the surface is the default method's, and
the rest is as published: f_x = cos α τ₁ / l over the steady part of the stance, fitted to k_s b z²/2, with or without
a flipper's part of the body's drag, half of it with two, added while the body advances.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pandas import DataFrame

from control.plate_integrals import moment_width_m
from control.records import Phase
from estimation.paper import ADVANCED_M, STEADY_FRACTION
from estimation.strokes.line_fit import LineFit
from experiments.trials.stride_profile import stroke_of
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.reports import estimate_report

KNOWN, KNOWN_COMPENSATED = "paper's law", "paper's law with drag"
Report = dict[str, Any]


def k_s_of(profile: DataFrame, stride: Mapping[str, Any], configuration: Configuration, drag_n: float) -> Report:
    """Fit k_s in N/m³ to one stride and report the estimate."""
    geometry, fit, stance = configuration.geometry, LineFit(), stroke_of(profile, Phase.STANCE)
    sweeps_rad, first = stance["sweep_rad"], stance.head(1)
    forces_n = np.cos(sweeps_rad) * stance["sweep_load_nm"] / geometry.flipper_length_m
    if drag_n:
        own_n = drag_n / len(configuration.rig.flippers)
        forces_n += np.where(stance["body_x_m"] - first["body_x_m"].sum(min_count=1) > ADVANCED_M, own_n, 0.0)
    steady = forces_n.notna() & (sweeps_rad.abs() <= STEADY_FRACTION * first["sweep_rad"].abs().sum())
    submerged_m = stance["depth_m"] - (stride["surface_m"] or 0.0)
    for depth_m, force_n in zip(submerged_m[steady].tolist(), forces_n[steady].tolist(), strict=True):
        if depth_m > 0.0:
            fit.update(moment_width_m(geometry, depth_m) * depth_m**2 / 2.0, force_n)
    return estimate_report(fit.estimate())
