"""The forces that the fitted coefficients predict, for comparison with the measured forces.

The default method's laws (plate_integrals.py) are about the torques of the joints: τ₂ = k_p Φ in insertion, τ₁ = k_s Ψ
in stance, τ₂ = -k_e Φ in extraction, with the cross-coupled load on the plate's face added to τ₂. The law's torque
replaces the measured one, the other joint's stays as measured, and both go through the same map from torques to forces
as the measurement. The paper's laws are about the forces themselves: f_z = k_p A z, f_x = k_s b z²/2, f_z = -k_e A z.
Each law is evaluated where its coefficient is fitted: in insertion below the surface, in stance after 2.5 cm of sweep,
in extraction over the last three quarters of the way up.
"""

from collections.abc import Mapping
from math import nan
from typing import Any

import numpy as np
from pandas import DataFrame, Series

from control.geometry import FlipperGeometry
from control.plate_integrals import (
    cross_coupling,
    mean_width_m,
    moment_width_m,
    stance_moment_m4,
    stroke_moment_m4,
    submerged_plate,
)
from control.records import Phase
from estimation.force_map import smallest_force_n
from estimation.strokes.shear import MOBILISED_M
from estimation.strokes.stroke_fit import REVERSAL_FRACTION
from experiments.trials.stride_profile import profile_from, stroke_of

COEFFICIENT_OF = {Phase.INSERTION: "k_p", Phase.STANCE: "k_s", Phase.EXTRACTION: "k_e"}
SIGNS = {Phase.INSERTION: 1.0, Phase.EXTRACTION: -1.0}


def modelled_stride(trial: dict[str, Any], geometry: FlipperGeometry, method: str) -> DataFrame:
    """Return the profile of a trial's first stride with the forces by its values and its lower bounds."""
    return with_modelled_forces(profile_from(trial), geometry, trial["strides"][method][0], method)


def with_modelled_forces(
    profile: DataFrame, geometry: FlipperGeometry, stride: Mapping[str, Any], method: str
) -> DataFrame:
    """Return the profile with the columns `law_x_n` and `law_z_n`; NaN where no law is evaluated."""
    law = _paper_force_n if method == "paper" else _default_force_n
    surface_m = stride["surface_m"] or 0.0
    profile = profile.assign(submerged_m=profile["depth_m"] - surface_m, law_x_n=nan, law_z_n=nan)
    for phase, name in COEFFICIENT_OF.items():
        if (estimate := stride[name])["valid"]:
            rows = _fitted_rows(profile, geometry, phase)
            forces_n = [law(phase, row, geometry, surface_m, estimate["value"]) for row in rows.itertuples()]
            profile.loc[rows.index, "law_x_n" if phase is Phase.STANCE else "law_z_n"] = forces_n
    return profile


def _fitted_rows(profile: DataFrame, geometry: FlipperGeometry, phase: Phase) -> DataFrame:
    """Return the rows in which a coefficient is fitted, the flipper is in the mud, and the loads are known."""
    rows = stroke_of(profile, phase)
    if phase is Phase.STANCE:
        positions_m = geometry.flipper_length_m * np.sin(rows["sweep_rad"])
        rows = rows[positions_m.head(1).sum() - positions_m >= MOBILISED_M]
    elif phase is Phase.EXTRACTION:
        rows = rows[rows["submerged_m"] <= (1.0 - REVERSAL_FRACTION) * rows["submerged_m"].head(1).sum()]
    return rows[rows["submerged_m"] > 0.0].dropna(subset=["sweep_load_nm", "adduction_load_nm"])


def _default_force_n(phase: Phase, row: Any, geometry: FlipperGeometry, surface_m: float, k_n_m3: float) -> float:
    sweep_nm, adduction_nm = row.sweep_load_nm, row.adduction_load_nm
    plate = submerged_plate(geometry, row.sweep_rad, row.adduction_rad, surface_m)
    if phase is Phase.STANCE:
        sweep_nm = k_n_m3 * stance_moment_m4(geometry, plate)
    else:
        across_nm = cross_coupling(geometry, plate, row.sweep_rad) * sweep_nm
        adduction_nm = SIGNS[phase] * k_n_m3 * stroke_moment_m4(geometry, plate, row.sweep_rad) + across_nm
    force_x_n, force_z_n = smallest_force_n(geometry, row.sweep_rad, row.adduction_rad, sweep_nm, adduction_nm)
    return force_x_n if phase is Phase.STANCE else force_z_n


def _paper_force_n(phase: Phase, row: Any, geometry: FlipperGeometry, surface_m: float, k_n_m3: float) -> float:
    if phase is Phase.STANCE:
        return float(k_n_m3 * moment_width_m(geometry, row.submerged_m) * row.submerged_m**2 / 2.0)
    edge_m2 = mean_width_m(geometry, row.submerged_m) * geometry.plate_thickness_m
    return float(SIGNS[phase] * k_n_m3 * edge_m2 * row.submerged_m)


def misfit_n(measured_n: Series, modelled_n: Series) -> float | None:
    """Return the root mean square of the difference where the law is evaluated; None where it never is."""
    differences_n = (measured_n - modelled_n).dropna().to_numpy()
    return float(np.sqrt(np.mean(differences_n**2))) if len(differences_n) else None
