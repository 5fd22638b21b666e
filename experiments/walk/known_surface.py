"""The paper's law of shear with a known surface, to test its statements on body drag without the error of its trigger.

The published method finds the surface where the upward force first passes 0.5 N. In soft mud, and with mud that clings
to the flipper, that is far too deep. k_s depends on the square of the depth below the surface and becomes several times
too large, so that the paper's statements on body drag cannot be tested. Here the surface is the default method's, and
the rest is as published: f_x = cos α τ₁ / l over the steady part of the stance, fitted to k_s b z²/2, with or without
half of the body's drag added while the body advances.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from control.plate_integrals import moment_width_m
from control.records import Phase
from estimation.paper import ADVANCED_M, STEADY_FRACTION
from estimation.strokes.line_fit import LineFit
from experiments.trials.stride_profile import StrideProfile, profile_of
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.reports import estimate_report
from logs.files.log_reader import Log

KNOWN, KNOWN_COMPENSATED = "paper's law", "paper's law with drag"


def strides_with_known_surface(
    strides: Sequence[Mapping[str, Any]], log: Log, configuration: Configuration, flipper: str
) -> dict[str, list[dict[str, Any]]]:
    """Return k_s by method for the strides of the default method."""
    drags_n = {KNOWN: 0.0, KNOWN_COMPENSATED: configuration.adaptation.body_drag_n}
    profiles = [profile_of(log, flipper, stride["t_start_s"]) for stride in strides]
    return {
        method: [
            dict(stride) | {"k_p": None, "k_e": None, "k_s": k_s_of(profile, stride, configuration, drag_n)}
            for profile, stride in zip(profiles, strides, strict=True)
        ]
        for method, drag_n in drags_n.items()
    }


def k_s_of(
    profile: StrideProfile, stride: Mapping[str, Any], configuration: Configuration, drag_n: float
) -> dict[str, Any]:
    """Fit k_s in N/m³ to one stride and report the estimate."""
    geometry, stance, fit = configuration.geometry, profile.during(Phase.STANCE), LineFit()
    submerged_m = profile.depth_m - (stride["surface_m"] or 0.0)
    steady = stance & (submerged_m > 0.0) & np.isfinite(profile.sweep_nm)
    if stance.any():
        steady &= np.abs(profile.sweep_rad) <= STEADY_FRACTION * abs(profile.sweep_rad[stance][0])
    widths_m = np.array([moment_width_m(geometry, depth_m) for depth_m in submerged_m.tolist()])
    moments_m3 = widths_m * submerged_m**2 / 2.0
    forces_n = np.cos(profile.sweep_rad) * profile.sweep_nm / geometry.flipper_length_m
    if drag_n and stance.any():
        advanced = profile.body_m - profile.body_m[stance][0] > ADVANCED_M
        forces_n = forces_n + np.where(advanced, drag_n / 2.0, 0.0)
    for moment_m3, force_n in zip(moments_m3[steady].tolist(), forces_n[steady].tolist(), strict=True):
        fit.update(moment_m3, force_n)
    return estimate_report(fit.estimate())
