"""The mud fit recovers a synthetic truth, and walks the plant that it reports."""

from math import log
from typing import Any

import pytest

from experiments.studies import mud_fit
from experiments.studies.mud_fit import study
from experiments.trackway.simulated_walk import speed_cm_s, walk_in_mud
from experiments.trackway.table_one import Speed
from experiments.trackway.walk import Walk, WalkedStride, walk_of
from simulation.body.plant_parameters import PlantParameters
from simulation.mud.clay import MUDS
from tests.experiments.studies.synthetic_trials import SyntheticTrials

TRUTH = {"48.5": 2000.0, "53.1": 600.0, "45.3": 3500.0}
TRUE_DAMPING = 5.6
SLOPES = {0.03: 3.0, 0.05: -2.0}  # cm/s for each e-fold of strength


def true_speed_cm_s(damping_n_s_m: float, strength_pa: float, depth_m: float) -> float:
    """Return a noise-free speed: strength changes the difference of the depths, and damping shifts both alike."""
    return 12.0 + SLOPES[depth_m] * log(strength_pa / 1500.0) - 0.4 * (damping_n_s_m - TRUE_DAMPING)


def walked(rail_damping_n_s_m: float, strength_pa: float, depth_m: float, seed: int) -> dict[str, Any]:
    step_m = 0.01 * true_speed_cm_s(rail_damping_n_s_m, strength_pa, depth_m)
    return Walk([WalkedStride("mud", 0.0, depth_m, step_m, 1.0, 0.0)] * 2, "").entry


@pytest.fixture(scope="module")
def summary() -> dict[str, Any]:
    """Fit once to a table with the synthetic truth."""
    table = {
        rule: {mud: Speed(true_speed_cm_s(TRUE_DAMPING, TRUTH[mud], depth_m), 0.3) for mud in MUDS}
        for rule, depth_m in (("3 cm", 0.03), ("5 cm", 0.05))
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mud_fit, "PAPER_TABLE", table)
        return study(SyntheticTrials(walked), seeds=1).json()


def test_the_fit_recovers_a_synthetic_truth(summary: dict[str, Any]) -> None:
    """The tolerances are half a step of the finer grid in damping, 0.25 N·s/m, and one and a half in strength, 4.5 %.

    A misfit of 0.1 N·s/m in damping may shift a strength by a step of 3 %.
    """
    fitted = summary["fitted"]
    assert fitted["rail_damping_n_s_m"] == pytest.approx(TRUE_DAMPING, abs=0.25)
    for mud, strength_pa in TRUTH.items():
        assert fitted["strength_pa"][mud] == pytest.approx(strength_pa, rel=0.045)
        low, high = fitted["strength_range_pa"][mud]
        assert low <= fitted["strength_pa"][mud] <= high
    assert fitted["chi2"] < 1.0


def test_the_report_has_fit_present_values_and_the_six_cells(summary: dict[str, Any]) -> None:
    fitted, present = summary["fitted"], summary["present"]
    assert present["strength_pa"] == {name: clay.strength_pa for name, clay in MUDS.items()}
    assert present["rail_damping_n_s_m"] == PlantParameters().rail_damping_n_s_m
    assert min(summary["chi2_of_damping"].values()) == fitted["chi2"] <= present["chi2"]
    assert {rule: list(row) for rule, row in fitted["cells"].items()} == dict.fromkeys(("3 cm", "5 cm"), list(MUDS))


def test_more_damping_is_slower() -> None:
    """At 0.5 m/s another 8 N·s/m are 4 N, more than the rail's dry drag of 2.5 N."""
    walks = [walk_of(walk_in_mud(2800.0, 1, 0.03, count=2, rail_damping_n_s_m=damping)) for damping in (2.0, 10.0)]
    loose, tight = map(speed_cm_s, walks)
    assert 0.0 < tight < 0.95 * loose
