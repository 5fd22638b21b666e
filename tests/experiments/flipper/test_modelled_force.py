"""The forces by the laws equal the measured forces in mud that follows the laws."""

from __future__ import annotations

import numpy as np
import pytest

from control.plate_integrals import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.records import Phase
from estimation.force_map import smallest_force_n
from experiments.flipper.modelled_force import misfit_n, modelled_forces
from experiments.trials.stride_profile import StrideProfile
from tests.experiments.synthetic_strides import GEOMETRY, make_profile

K = {"k_p": 1.1e6, "k_s": 0.4e6, "k_e": 1.9e6}
DEPTHS_M = [-0.01, 0.0, 0.01, 0.02, 0.03]


def lawful(phase: Phase, sweeps_deg: list[float], depths_m: list[float], across_nm: float = 0.0) -> StrideProfile:
    """Return a stroke in a mud that follows the laws with the coefficients K: its joint loads and the mapped forces."""
    profile = make_profile(phase, sweeps_deg, depths_m)
    for i, (sweep_rad, adduction_rad) in enumerate(zip(profile.sweep_rad, profile.adduction_rad, strict=True)):
        plate = submerged_plate(GEOMETRY, sweep_rad, adduction_rad)
        sweep_nm, adduction_nm = across_nm, cross_coupling(GEOMETRY, plate, sweep_rad) * across_nm
        if phase is Phase.STANCE:
            sweep_nm = K["k_s"] * stance_moment_m4(GEOMETRY, plate)
        else:
            k_n_m3 = K["k_p"] if phase is Phase.INSERTION else -K["k_e"]
            adduction_nm += k_n_m3 * stroke_moment_m4(GEOMETRY, plate, sweep_rad)
        profile.sweep_nm[i], profile.adduction_nm[i] = sweep_nm, adduction_nm
        forces_n = smallest_force_n(GEOMETRY, sweep_rad, adduction_rad, sweep_nm, adduction_nm)
        profile.force_x_n[i], profile.force_z_n[i] = forces_n
    return profile


def test_in_insertion_the_law_equals_the_measured_force_below_the_surface() -> None:
    profile = lawful(Phase.INSERTION, [30.0] * 5, DEPTHS_M, across_nm=0.05)
    modelled_n = modelled_forces(profile, GEOMETRY, 0.0, K, "default").force_z_n
    assert modelled_n[2:] == pytest.approx(profile.force_z_n[2:])
    assert np.isnan(modelled_n[0])


def test_in_extraction_the_law_equals_the_measured_force_on_the_last_three_quarters() -> None:
    profile = lawful(Phase.EXTRACTION, [-30.0] * 5, [0.03, 0.025, 0.02, 0.01, -0.01], across_nm=-0.1)
    modelled_n = modelled_forces(profile, GEOMETRY, 0.0, K, "default").force_z_n
    assert np.isnan(modelled_n[[0, 1, 4]]).all()
    assert modelled_n[2:4] == pytest.approx(profile.force_z_n[2:4])
    assert (modelled_n[2:4] < 0.0).all()


def test_in_stance_the_law_equals_the_measured_force_once_the_mud_is_mobilised() -> None:
    """The mud is mobilised after 2.5 cm of sweep: with an arm of 12 cm from 30° to under 17°."""
    profile = lawful(Phase.STANCE, [30.0, 20.0, 15.0, 0.0, -30.0], [0.03] * 5)
    modelled_n = modelled_forces(profile, GEOMETRY, 0.0, K, "default").force_x_n
    assert np.isnan(modelled_n[:2]).all()
    assert modelled_n[2:] == pytest.approx(profile.force_x_n[2:])


def test_the_papers_laws_give_forces_from_the_depth_below_the_found_surface() -> None:
    """At 3 cm the plate is 2 cm below the surface at 1 cm: V = 1 cm² of edge times 2 cm, and b z²/2 with b = 2.5 cm."""
    surface_m = 0.01
    inserted = make_profile(Phase.INSERTION, [30.0], [0.03])
    swept = make_profile(Phase.STANCE, [30.0, 0.0], [0.03, 0.03])
    raised = make_profile(Phase.EXTRACTION, [-30.0, -30.0], [0.03, 0.02])
    assert modelled_forces(inserted, GEOMETRY, surface_m, K, "paper").force_z_n == pytest.approx([1.1e6 * 1e-4 * 0.02])
    assert modelled_forces(swept, GEOMETRY, surface_m, K, "paper").force_x_n[1] == pytest.approx(0.4e6 * 0.025 * 2e-4)
    assert modelled_forces(raised, GEOMETRY, surface_m, K, "paper").force_z_n[1] == pytest.approx(-1.9e6 * 1e-4 * 0.01)


def test_an_unknown_coefficient_gives_no_force() -> None:
    profile = lawful(Phase.INSERTION, [30.0] * 5, DEPTHS_M)
    assert np.isnan(modelled_forces(profile, GEOMETRY, 0.0, K | {"k_p": None}, "default").force_z_n).all()


def test_the_misfit_is_the_root_mean_square_where_the_law_is_evaluated() -> None:
    assert misfit_n(np.array([1.0, 5.0, 0.0]), np.array([4.0, 1.0, np.nan])) == pytest.approx(np.sqrt(12.5))
    assert misfit_n(np.array([1.0]), np.array([np.nan])) is None
