"""The forces that fitted coefficients say there should have been, to be drawn beside those that were measured.

The default method's laws (control/plate.py) are about the joints' torques: in insertion τ₂ = k_p Φ, in stance
τ₁ = k_s Ψ, in extraction τ₂ = -k_e Φ, with what the plate's face bears across its motion added to τ₂. The law's torque
takes the place of the measured one, the other joint's stays, and both go through the map from torques to forces that
the measured ones went through: so like is compared with like. The paper's laws are about forces as they are:
f_z = k_p A z, f_x = k_s b z²/2, f_z = -k_e A z. Each law is drawn where its coefficient is fitted: from the surface
down, from 2.5 cm of sweep on, over the last three quarters of the way up.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, nan
from typing import NamedTuple

import numpy as np

from control.geometry import FlipperGeometry
from control.plate import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.records import Phase
from estimation.force_map import smallest_force_n
from estimation.strokes.shear import MOBILISED_M
from estimation.strokes.stroke_fit import REVERSAL_FRACTION
from experiments.trials.stride_profile import Floats, StrideProfile

COEFFICIENT_OF = {Phase.INSERTION: "k_p", Phase.STANCE: "k_s", Phase.EXTRACTION: "k_e"}


class ModelledForces(NamedTuple):
    """A value for each row of the course; NaN where no law is drawn."""

    force_x_n: Floats
    force_z_n: Floats


class _Row(NamedTuple):
    phase: Phase
    sweep_rad: float
    adduction_rad: float
    submerged_m: float
    sweep_nm: float
    adduction_nm: float


def modelled_forces(
    profile: StrideProfile,
    geometry: FlipperGeometry,
    surface_m: float,
    coefficients: Mapping[str, float | None],
    method: str,
) -> ModelledForces:
    """`coefficients` in N/m³ by name; one that is None is not drawn."""
    law = _paper_force if method == "paper" else _default_force
    forces = ModelledForces(np.full(len(profile.time_s), nan), np.full(len(profile.time_s), nan))
    shown = _fitted_rows(profile, geometry, surface_m)
    for i in np.flatnonzero(shown).tolist():
        phase = Phase(int(profile.phase[i]))
        k_n_m3 = coefficients.get(COEFFICIENT_OF[phase])
        if k_n_m3 is None:
            continue
        row = _Row(
            phase,
            float(profile.sweep_rad[i]),
            float(profile.adduction_rad[i]),
            float(profile.depth_m[i]) - surface_m,
            float(profile.sweep_nm[i]),
            float(profile.adduction_nm[i]),
        )
        force_n = law(row, geometry, surface_m, k_n_m3)
        (forces.force_x_n if phase is Phase.STANCE else forces.force_z_n)[i] = force_n
    return forces


def _fitted_rows(profile: StrideProfile, geometry: FlipperGeometry, surface_m: float) -> Floats:
    """Where the coefficients are fitted, the flipper is in the mud and the loads are known."""
    submerged_m = profile.depth_m - surface_m
    shown = np.isin(profile.phase, list(COEFFICIENT_OF)) & (submerged_m > 0.0)
    shown &= np.isfinite(profile.sweep_nm) & np.isfinite(profile.adduction_nm)
    stance, extraction = profile.during(Phase.STANCE), profile.during(Phase.EXTRACTION)
    if stance.any():
        positions_m = geometry.flipper_length_m * np.sin(profile.sweep_rad)
        shown &= ~stance | (positions_m[stance][0] - positions_m >= MOBILISED_M)
    if extraction.any():
        shown &= ~extraction | (submerged_m <= (1.0 - REVERSAL_FRACTION) * submerged_m[extraction][0])
    return np.asarray(shown)


def _default_force(row: _Row, geometry: FlipperGeometry, surface_m: float, k_n_m3: float) -> float:
    plate = submerged_plate(geometry, row.sweep_rad, row.adduction_rad, surface_m)
    sweep_nm, adduction_nm = row.sweep_nm, row.adduction_nm
    if row.phase is Phase.STANCE:
        sweep_nm = k_n_m3 * stance_moment_m4(geometry, plate)
    else:
        sign = 1.0 if row.phase is Phase.INSERTION else -1.0
        across_nm = cross_coupling(geometry, plate, row.sweep_rad) * sweep_nm
        adduction_nm = sign * k_n_m3 * stroke_moment_m4(geometry, plate, row.sweep_rad) + across_nm
    force_x_n, force_z_n = smallest_force_n(geometry, row.sweep_rad, row.adduction_rad, sweep_nm, adduction_nm)
    return force_x_n if row.phase is Phase.STANCE else force_z_n


def _paper_force(row: _Row, geometry: FlipperGeometry, surface_m: float, k_n_m3: float) -> float:
    if row.phase is Phase.STANCE:
        return k_n_m3 * geometry.plate_width_m * row.submerged_m**2 / 2.0
    edge_m2 = geometry.plate_width_m * geometry.plate_thickness_m
    return (1.0 if row.phase is Phase.INSERTION else -1.0) * k_n_m3 * edge_m2 * row.submerged_m


def misfit_n(measured_n: Floats, modelled_n: Floats) -> float | None:
    """Root of the mean square of what a law leaves over, where it is drawn; None where it is not."""
    left_n = measured_n - modelled_n
    left_n = left_n[np.isfinite(left_n)]
    value = float(np.sqrt(np.mean(left_n**2))) if len(left_n) else nan
    return value if isfinite(value) else None
