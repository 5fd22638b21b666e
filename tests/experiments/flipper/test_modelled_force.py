"""The forces by the laws equal the measured forces in mud that follows the laws."""

import numpy as np
import pytest
from pandas import DataFrame, Series

from control.plate_integrals import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.records import Phase
from estimation.force_map import smallest_force_n
from experiments.flipper.modelled_force import misfit_n, with_modelled_forces
from tests.experiments.synthetic_strides import GEOMETRY, make_estimate, make_profile, make_stride

K = {"k_p": 1.1e6, "k_s": 0.4e6, "k_e": 1.9e6}


def lawful(phase: Phase, sweeps_deg: list[float], depths_m: list[float], across_nm: float = 0.0) -> DataFrame:
    """Return a stroke in a mud that follows the laws with the coefficients K: its joint loads and the mapped forces."""
    profile = make_profile(phase, sweeps_deg, depths_m)
    for i, row in enumerate(profile.itertuples()):
        plate = submerged_plate(GEOMETRY, row.sweep_rad, row.adduction_rad)
        sweep_nm, adduction_nm = across_nm, cross_coupling(GEOMETRY, plate, row.sweep_rad) * across_nm
        if phase is Phase.STANCE:
            sweep_nm = K["k_s"] * stance_moment_m4(GEOMETRY, plate)
        else:
            k_n_m3 = K["k_p"] if phase is Phase.INSERTION else -K["k_e"]
            adduction_nm += k_n_m3 * stroke_moment_m4(GEOMETRY, plate, row.sweep_rad)
        forces_n = smallest_force_n(GEOMETRY, row.sweep_rad, row.adduction_rad, sweep_nm, adduction_nm)
        profile.loc[i, ["sweep_load_nm", "adduction_load_nm", "force_x_n", "force_z_n"]] = (
            sweep_nm, adduction_nm, *forces_n
        )  # fmt: skip
    return profile


def modelled(profile: DataFrame, method: str = "default", surface_m: float = 0.0) -> DataFrame:
    coefficients = {name: make_estimate(value) for name, value in K.items()}
    return with_modelled_forces(profile, GEOMETRY, make_stride(surface_m=surface_m, **coefficients), method)


@pytest.mark.parametrize(
    ("phase", "sweeps_deg", "depths_m", "fitted"),
    [
        (Phase.INSERTION, [30.0] * 5, [-0.01, 0.0, 0.01, 0.02, 0.03], [2, 3, 4]),  # below the surface
        # the last three quarters of the way up
        (Phase.EXTRACTION, [-30.0] * 5, [0.03, 0.025, 0.02, 0.01, -0.01], [2, 3]),
        # once 2.5 cm of sweep have mobilised the mud: with an arm of 12 cm from 30° to under 17°
        (Phase.STANCE, [30.0, 20.0, 15.0, 0.0, -30.0], [0.03] * 5, [2, 3, 4]),
    ],
)
def test_the_law_equals_the_measured_force_where_its_coefficient_is_fitted(
    phase: Phase, sweeps_deg: list[float], depths_m: list[float], fitted: list[int]
) -> None:
    profile = lawful(phase, sweeps_deg, depths_m, across_nm=-0.1)
    axis = "x" if phase is Phase.STANCE else "z"
    modelled_n = modelled(profile)[f"law_{axis}_n"]
    assert modelled_n.dropna().index.tolist() == fitted
    assert modelled_n[fitted].tolist() == pytest.approx(profile[f"force_{axis}_n"][fitted].tolist())
    assert (modelled_n[fitted] < 0.0).all() == (phase is Phase.EXTRACTION)


def test_the_papers_laws_give_forces_from_the_depth_below_the_found_surface() -> None:
    """At 3 cm the plate is 2 cm below the surface at 1 cm: V = 1 cm² of edge times 2 cm, and b z²/2 with b = 2.5 cm."""
    inserted = make_profile(Phase.INSERTION, [30.0], [0.03])
    swept = make_profile(Phase.STANCE, [30.0, 0.0], [0.03, 0.03])
    raised = make_profile(Phase.EXTRACTION, [-30.0, -30.0], [0.03, 0.02])
    for profile, column, force_n in (
        (inserted, "law_z_n", 1.1e6 * 1e-4 * 0.02),
        (swept, "law_x_n", 0.4e6 * 0.025 * 2e-4),
        (raised, "law_z_n", -1.9e6 * 1e-4 * 0.01),
    ):
        assert modelled(profile, "paper", 0.01)[column].iloc[-1] == pytest.approx(force_n)


def test_an_unknown_coefficient_gives_no_force() -> None:
    unknown = make_stride(k_p=make_estimate(None))
    profile = make_profile(Phase.INSERTION, [30.0], [0.03])
    assert with_modelled_forces(profile, GEOMETRY, unknown, "default")["law_z_n"].isna().all()


def test_the_misfit_is_the_root_mean_square_where_the_law_is_evaluated() -> None:
    assert misfit_n(Series([1.0, 5.0, 0.0]), Series([4.0, 1.0, np.nan])) == pytest.approx(np.sqrt(12.5))
    assert misfit_n(Series([1.0]), Series([np.nan])) is None
