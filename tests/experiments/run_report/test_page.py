"""Tables and pictures of a report show the fits with their residuals, and repeated events as one row each."""

from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from estimation.strokes.fit_samples import FitSamples
from experiments.pictures.mud_layout import layout_of_lengths
from experiments.run_report.figures import GAMMA_DEG, draw_directions, draw_fits, draw_paths
from experiments.run_report.page import group_events, quality_rows
from experiments.run_report.results import headline_of
from experiments.run_report.run import Run, read_runs
from logs.files.log_error import unwatched
from tests.experiments.run_report.synthetic_runs import run_of, stride

K = 1e6
BY_HAND = FitSamples(  # residuals 0, -0.1, 0.1 N·m
    moments_m4=[1e-7, 2e-7, 3e-7],
    torques_nm=[0.2, 0.3, 0.7],
    weights_m=[0.001] * 3,
    sweeps_rad=[0.5, 0.0, -0.5],
    depths_m=[0.01, 0.02, 0.03],
    slope=2.0 * K,
)


@pytest.fixture(scope="module")
def run(two_walks: Path) -> Run:
    return read_runs([two_walks], layout_of_lengths([("48.5", 0.61)]), unwatched)[0]


def samples_of(run: Run, flipper: str, name: str) -> list[FitSamples]:
    estimates = run.estimates
    return list(estimates[(estimates["flipper"] == flipper) & (estimates["coefficient"] == name)]["samples"])


def test_the_quality_of_a_fit_by_hand() -> None:
    row = quality_rows(run_of([stride("a", samples=BY_HAND)]))[0]
    assert row["left: R²"] == pytest.approx(1.0 - 0.02 / 0.62) and row["left: fits"] == 1
    assert row["left: R² about mean"] == pytest.approx(1.0 - 0.02 / 0.14)
    assert row["left: residual (N·cm)"] == pytest.approx(100.0 * (0.02 / 3.0) ** 0.5)


def test_the_table_has_medians_over_strides_and_nothing_without_a_fit(run: Run) -> None:
    rows = {row["coefficient"]: row for row in quality_rows(run)}
    assert rows["k_p"]["left: fits"] == 3
    assert rows["k_p"]["left: R²"] == median(samples.r_squared for samples in samples_of(run, "left", "k_p"))
    assert rows["k_s"]["right: fits"] == "-" and np.isnan(rows["k_s"]["right: R²"])  # a bound in every stride
    of_k_p, *_, of_k_s, _ = draw_fits(run).axes[2:8]
    assert of_k_s.texts and not of_k_p.texts  # an empty panel says so


def test_a_fit_is_drawn_next_to_its_residuals_in_units_of_its_coefficient(run: Run) -> None:
    """The slope of each line is k in N/cm³, the residuals are those of its samples, and both flippers share scales.

    The strides of a mud are one artist.
    """
    axes = draw_fits(run).axes
    for column, flipper in ((0, "left"), (2, "right")):
        samples = samples_of(run, flipper, "k_p")[0]
        marks, line, *_ = axes[column].lines
        of_first = slice(len(samples.moments_m4))
        (x0, x1), (y0, y1) = np.asarray(line.get_xdata())[:2], np.asarray(line.get_ydata())[:2]
        assert (y1 - y0) / (x1 - x0) == pytest.approx(samples.slope / 1e6)
        residuals = np.asarray(axes[column + 1].lines[0].get_ydata())[of_first]
        np.testing.assert_allclose(residuals, 100.0 * np.array(samples.residuals_nm))
        np.testing.assert_allclose(np.asarray(marks.get_xdata())[of_first], 1e8 * np.array(samples.moments_m4))
    for left, right in ((axes[0], axes[2]), (axes[1], axes[3])):
        assert left.get_xlim() == right.get_xlim() and left.get_ylim() == right.get_ylim()


def test_a_sample_far_off_is_counted_and_not_drawn() -> None:
    moments = np.linspace(1e-8, 3e-7, 60)
    torques = K * moments + 0.002 * np.cos(np.arange(60.0))
    torques[30] = -9.0
    same = [0.001] * 60
    samples = FitSamples(moments.tolist(), torques.tolist(), same, same, same, K)
    fit, residuals, *_ = draw_fits(run_of([stride("a", samples=samples)])).axes
    for panel in (fit, residuals):
        assert panel.get_ylim()[0] > -900.0
        assert [text.get_text() for text in panel.texts] == ["1 beyond"]


def test_a_path_has_the_force_and_the_error_of_the_prediction_where_the_plate_was(run: Run) -> None:
    """Of 3 N/cm³ where 2 were felt, 0.1, 0.3 and 0.2 N·m are too much, of a largest torque of 0.7 N·m."""
    estimates = run_of([stride("a", samples=BY_HAND, expected_n_m3=3.0 * K)]).estimates
    force, error, *_ = draw_paths(replace(run, estimates=estimates)).axes
    (felt,), (predicted,) = force.collections, error.collections
    sides = [side for walk in run.walks for side in walk.sides]
    in_mud = [(side.depth_m > 0.0) & np.isfinite(side.force_x_n) for side in sides]
    assert len(np.asarray(felt.get_offsets())) == np.concatenate(in_mud).sum() > 100
    length_m = run.walks[0].geometry.flipper_length_m
    places = np.stack([length_m * np.sin(BY_HAND.sweeps_rad), np.negative(BY_HAND.depths_m)], axis=1)
    np.testing.assert_allclose(np.asarray(predicted.get_offsets()), [*places, *places])  # of both flippers
    np.testing.assert_allclose(np.asarray(predicted.get_array()), [100.0 / 7.0, 300.0 / 7.0, 200.0 / 7.0] * 2)


def test_a_run_whose_strides_nothing_predicts_says_so(run: Run) -> None:
    _, error, *_ = draw_paths(replace(run, estimates=run.estimates.assign(expected_n_m3=np.nan))).axes
    assert not error.collections and "no prediction" in error.texts[0].get_text()


def curves_of(panel: Axes) -> list[NDArray[np.float64]]:
    """Return the heights of the lines over all directions."""
    return [height for line in panel.lines if len(height := np.asarray(line.get_ydata())) == len(GAMMA_DEG)]


def test_the_mud_by_direction_is_that_of_the_coefficients_and_hatched_where_no_plate_moved(run: Run) -> None:
    """Flippers go down, across and up: a path of 15° to 75° below the horizontal is only what the law says."""
    headline = headline_of(run)
    (mud,) = headline["muds"]
    across, along = draw_directions(run, headline).axes
    (height,) = curves_of(along)
    assert height[-1] == pytest.approx(mud["both"]["k_p"].value / 1e6)
    assert height[0] == pytest.approx(-mud["both"]["k_e"].value / 1e6)
    sand, clay = curves_of(across)
    assert clay[0] == clay[45] == sand[45] == pytest.approx(mud["both"]["k_s"].value / 1e6)
    assert sand[15] == pytest.approx(clay[15] / 2.0)  # at -60°
    for panel in (across, along):
        hatched = {patch.get_x() for patch in panel.patches if isinstance(patch, Rectangle)}
        assert {15.0, 30.0, 45.0, 60.0} <= hatched and not hatched & {-90.0, 0.0, 75.0}


# events


def events(*texts: str) -> list[dict[str, object]]:
    return [{"stamp_s": float(second), "text": text} for second, text in enumerate(texts)]


def test_events_that_differ_in_numbers_are_one_group_with_their_ranges() -> None:
    texts = ("depth 0.0275 m: fastest", "mode hold to walking", "depth 0.0500 m: fastest", "depth 0.0310 m: fastest")
    assert [tuple(group.values()) for group in group_events(events(*texts), 0.0)] == [
        (0.0, 3.0, 3, "depth 0.0275 to 0.0500 m: fastest"),
        (1.0, "", 1, "mode hold to walking"),
    ]
    (group,) = group_events(events("at -3.2 mm", "at 0.5 mm", "at -1.0 mm"), 0.0)
    assert group["event"] == "at -3.2 to 0.5 mm"
    assert len(group_events(events("robot R1 held", "robot R2 held"), 0.0)) == 2  # names with digits are no numbers


@given(st.lists(st.sampled_from(["a 1", "a 2", "b", "c 1.5 x 2", "c 3 x 4"]), max_size=30))
def test_every_event_is_in_exactly_one_group(texts: list[str]) -> None:
    groups = group_events(events(*texts), 0.0)
    assert sum(group["times"] for group in groups) == len(texts)
    assert [group["first at"] for group in groups] == sorted(group["first at"] for group in groups)
