"""The forces that the fitted coefficients predict, for comparison with the measured forces.

The default method's laws (control/plate) are about the torques of the joints: τ₂ = k_p Φ in insertion, τ₁ = k_s Ψ in
stance, τ₂ = -k_e Φ in extraction, with the cross-coupled load on the plate's face added to τ₂. The law's torque
replaces the measured one, the other joint's stays as measured, and both go through the same map from torques to forces
as the measurement. The paper's laws are about the forces themselves: f_z = k_p A z, f_x = k_s b z²/2, f_z = -k_e A z.
Each law is evaluated where its coefficient is fitted: in insertion below the surface, in stance after 2.5 cm of sweep,
in extraction over the last three quarters of the way up.
"""

from collections.abc import Mapping
from math import nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
from experiments.trials.stride_profile import Floats, StrideProfile, profile_from_row

COEFFICIENT_OF = {Phase.INSERTION: "k_p", Phase.STANCE: "k_s", Phase.EXTRACTION: "k_e"}


class ModelledForces(NamedTuple):
    """One value for each row of the profile; NaN where no law is evaluated."""

    force_x_n: Floats
    force_z_n: Floats


class _Row(NamedTuple):
    sweep_rad: float
    adduction_rad: float
    submerged_m: float
    sweep_nm: float
    adduction_nm: float


def laws_of(
    trial: Mapping[str, Any], geometry: FlipperGeometry, method: str
) -> tuple[StrideProfile, float, ModelledForces]:
    """Return a trial's first stride, its surface, and the forces by its values and its lower bounds."""
    profile, stride = profile_from_row(trial["course"]), trial["strides"][method][0]
    surface_m = stride["surface_m"] or 0.0
    known = {name: stride[name]["value"] if stride[name]["valid"] else None for name in COEFFICIENT_OF.values()}
    return profile, surface_m, modelled_forces(profile, geometry, surface_m, known, method)


def modelled_forces(
    profile: StrideProfile,
    geometry: FlipperGeometry,
    surface_m: float,
    coefficients: Mapping[str, float | None],
    method: str,
) -> ModelledForces:
    """`coefficients` are in N/m³ by name; the law of a coefficient that is None is not evaluated."""
    law = _paper_force if method == "paper" else _default_force
    submerged_m = profile.depth_m - surface_m
    columns = profile.sweep_rad, profile.adduction_rad, submerged_m, profile.sweep_nm, profile.adduction_nm
    rows = np.column_stack(columns).tolist()
    fitted = _fitted_rows(profile, geometry, submerged_m)
    forces = ModelledForces(*np.full((2, len(rows)), nan))
    for phase, name in COEFFICIENT_OF.items():
        force_n = forces.force_x_n if phase is Phase.STANCE else forces.force_z_n
        if (k_n_m3 := coefficients[name]) is not None:
            for i in np.flatnonzero(fitted & profile.during(phase)):
                force_n[i] = law(phase, _Row(*rows[i]), geometry, surface_m, k_n_m3)
    return forces


def _fitted_rows(profile: StrideProfile, geometry: FlipperGeometry, submerged_m: Floats) -> NDArray[np.bool_]:
    """Return the rows in which a coefficient is fitted, the flipper is in the mud, and the loads are known."""
    fitted = (submerged_m > 0.0) & np.isfinite(profile.sweep_nm) & np.isfinite(profile.adduction_nm)
    stance, extraction = profile.during(Phase.STANCE), profile.during(Phase.EXTRACTION)
    if stance.any():
        positions_m = geometry.flipper_length_m * np.sin(profile.sweep_rad)
        fitted &= ~stance | (positions_m[stance][0] - positions_m >= MOBILISED_M)
    if extraction.any():
        fitted &= ~extraction | (submerged_m <= (1.0 - REVERSAL_FRACTION) * submerged_m[extraction][0])
    return np.asarray(fitted)


def _default_force(phase: Phase, row: _Row, geometry: FlipperGeometry, surface_m: float, k_n_m3: float) -> float:
    sweep_rad, adduction_rad, _, sweep_nm, adduction_nm = row
    plate = submerged_plate(geometry, sweep_rad, adduction_rad, surface_m)
    if phase is Phase.STANCE:
        sweep_nm = k_n_m3 * stance_moment_m4(geometry, plate)
    else:
        sign = 1.0 if phase is Phase.INSERTION else -1.0
        across_nm = cross_coupling(geometry, plate, sweep_rad) * sweep_nm
        adduction_nm = sign * k_n_m3 * stroke_moment_m4(geometry, plate, sweep_rad) + across_nm
    force_x_n, force_z_n = smallest_force_n(geometry, sweep_rad, adduction_rad, sweep_nm, adduction_nm)
    return force_x_n if phase is Phase.STANCE else force_z_n


def _paper_force(phase: Phase, row: _Row, geometry: FlipperGeometry, surface_m: float, k_n_m3: float) -> float:
    if phase is Phase.STANCE:
        return k_n_m3 * moment_width_m(geometry, row.submerged_m) * row.submerged_m**2 / 2.0
    edge_m2 = mean_width_m(geometry, row.submerged_m) * geometry.plate_thickness_m
    return (1.0 if phase is Phase.INSERTION else -1.0) * k_n_m3 * edge_m2 * row.submerged_m


def misfit_n(measured_n: Floats, modelled_n: Floats) -> float | None:
    """Return the root mean square of the difference where the law is evaluated; None where it never is."""
    differences_n = measured_n - modelled_n
    differences_n = differences_n[np.isfinite(differences_n)]
    return float(np.sqrt(np.mean(differences_n**2))) if len(differences_n) else None
