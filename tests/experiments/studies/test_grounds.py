"""Grounds are what their names say, and the study compares walks and estimates on each."""

from typing import Any

import pytest

from control.controller import WalkOrder
from control.geometry import FlipperGeometry
from control.modes import Mode
from estimation.ground_law import law_of_strides
from experiments.robot.lockstep_robot import start_walk
from experiments.studies.grounds import GROUNDS, disturbances_on, draw, study
from experiments.trackway.walk import Walk, WalkedStride
from experiments.trials.trial import WALKING, configuration_of
from simulation.mud.disturbances import TRACKWAY
from simulation.mud.track import Track
from simulation.test_rig.load_cell import LoadCell
from tests.experiments.studies.synthetic_trials import SyntheticTrials

STEP_M = {0.015: 0.1, 0.03: 0.4, 0.05: 0.2, 0.0: 0.38}


def force_n(ground: str, depth_m: float) -> float:
    """Return the force at the end of an insertion."""
    return LoadCell(GROUNDS[ground], FlipperGeometry(), 0.0, 0.0).lower(depth_m, 0.1)[-1][2]


def test_a_crust_gives_way_a_floor_does_not_and_strength_that_grows_is_the_clay_s_at_3_cm() -> None:
    assert force_n("crust", 0.006) > 1.3 * force_n("crust", 0.012)
    assert force_n("floor", 0.035) > 5.0 * force_n("floor", 0.029)
    assert force_n("floor", 0.029) == pytest.approx(force_n("clay-0.8", 0.029))
    growing, clay = GROUNDS["growing"], GROUNDS["clay-1.4"]
    assert growing.bearing_pa(0.033) == pytest.approx(clay.bearing_pa(0.033), rel=0.06)
    assert growing.bearing_pa(0.009) == pytest.approx(clay.bearing_pa(0.009) * 0.3**0.5, rel=1e-6)


def test_a_ground_has_no_disturbance_twice_and_dry_sand_does_not_cling() -> None:
    mud, sand = (disturbances_on(GROUNDS[name], TRACKWAY) for name in ("thixotropic", "sand-generic"))
    assert (mud.remoulding, mud.clinging_n, sand.clinging_n) == (0.0, TRACKWAY.clinging_n, 0.0)
    assert disturbances_on(GROUNDS["clay-1.4"], TRACKWAY) == TRACKWAY


def test_the_study_compares_the_choice_with_the_best_constant_depth_and_counts_intervals() -> None:
    def measure(ground: str, seed: int, setup: str = "", depth_m: float = 0.0, **row: Any) -> dict[str, Any]:
        if not setup:
            step_m = STEP_M[depth_m]
            return Walk([WalkedStride("", 0.0, depth_m or 0.028, step_m, 1.0, 0.0)] * 5, "").entry
        named = {"mud": ground, "setup": setup, "method": "default", "trial": str(seed), "coefficient": "k_s"}
        values = {"kind": "value", "value": 1.0 + 0.1 * seed, "truth": 1.0, "std_error": 0.1, "repeatability": 0.1}
        return {"rows": [named | values]}

    result = study(SyntheticTrials(measure), ground=("crust",), depth=(1.5, 3.0, 5.0), seeds=1, estimates=2)
    _, errors, pooled = (table.rows for table in result.tables)
    swept = result.json()["speeds"]["crust"]
    assert swept["best"]["depth_cm"] == 3.0 and swept["methods"]["default"]["fraction_of_best"] == 0.95
    assert errors[["coverage", "strides"]].drop_duplicates().to_numpy().tolist() == [[0.5, 2]]
    assert pooled["strides"].tolist() == [4]
    result.figures[0].draw()


@pytest.mark.parametrize(
    ("ground", "law"), [("clay-1.4", "mud"), ("thixotropic", "mud"), ("sand-generic", "sand"), ("sand-spatial", "sand")]
)
def test_five_strides_name_the_law_of_a_ground(ground: str, law: str) -> None:
    configuration, on = configuration_of(WALKING), disturbances_on(GROUNDS[ground], TRACKWAY)
    track = Track([(100.0, GROUNDS[ground])])
    robot = start_walk(configuration, track, 1, WalkOrder(0.03, adaptive=True, strides=5), disturbances=on)
    while robot.loop.mode is Mode.WALKING:
        robot.step()
    strides = [closed.estimate for closed in robot.loop.learning.strides]
    evidence = law_of_strides(configuration.geometry, strides)
    assert evidence is not None and evidence.name == law


def test_the_grounds_of_the_picture_differ_without_their_colours() -> None:
    point = {"depth_cm": 3.0, "mean": 4.0}
    (panel,) = draw({name: {"constant": [point], "methods": {"default": point}} for name in GROUNDS}).axes
    lines = panel.get_lines()[::2]
    assert len({(line.get_linestyle(), line.get_marker()) for line in lines}) == len(lines) == len(GROUNDS)
