"""R² and residuals on the page are those of the fits; the picture shows each fit next to its residuals."""

from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import pytest
from matplotlib.figure import Figure

from estimation.strokes.fit_samples import FitSamples, StrideFits
from experiments.run_report.fit_plot import MOST_DRAWN, MOST_MUDS, drawn_muds, drawn_samples, plot_fits
from experiments.run_report.fit_quality import fits_report, quality_of, quality_rows
from experiments.run_report.run import ReportedStride, Run, read_run, read_sources
from experiments.run_report.tables import estimate_rows
from logs.files.log_error import unwatched
from tests.experiments.run_report.synthetic_runs import estimates, run_of, stride

K = 1e6
BY_HAND = FitSamples([1e-7, 2e-7, 3e-7], [0.2, 0.3, 0.7], [0.001] * 3, 2.0 * K)  # residuals 0, -0.1, 0.1 N·m


def fitted(mud: str, samples: FitSamples = BY_HAND) -> ReportedStride:
    row = estimates(samples.slope)
    fits = dict.fromkeys(("left", "right"), StrideFits(k_p=lambda: samples))
    return replace(stride(mud, row, row), fits=fits)


@pytest.fixture(scope="module")
def run(two_walks: Path) -> Run:
    return read_run(read_sources([two_walks], unwatched)[0], None, unwatched)


def test_the_quality_of_a_fit_by_hand() -> None:
    fits = StrideFits(k_p=lambda: BY_HAND)
    quality = fits_report(fits)["k_p"]
    assert quality["r_squared"] == pytest.approx(1.0 - 0.02 / 0.62) and quality["samples"] == 3
    assert quality["r_squared_about_mean"] == pytest.approx(1.0 - 0.02 / 0.14)
    assert quality["rms_residual_nm"] == pytest.approx((0.02 / 3.0) ** 0.5)
    assert fits_report(fits)["k_s"] is None


def test_the_table_has_medians_over_strides_and_dashes_without_a_fit(run: Run) -> None:
    rows = quality_rows(run)
    (mud,) = {each.mud for each in run.strides}
    by_name = {row[1]: row for row in rows[1:]}
    values = [samples.r_squared for each in run.strides if (samples := each.samples("left", "k_p"))]
    assert len(values) == 3 and rows[1][0] == mud
    assert by_name["k_p"][2:4] == ["3", f"{median(values):.3f}"]
    assert by_name["k_s"][2:] == ["-"] * 8  # a bound in every stride
    assert quality_of(run.strides, "right", "k_e").fits == 3


def test_each_stride_has_r_squared_and_residual_next_to_its_estimate(run: Run) -> None:
    for row, each in zip(estimate_rows(run, "k_e")[1:], run.strides, strict=True):
        samples = each.samples("right", "k_e")
        assert samples is not None
        assert row[6:] == [f"{samples.r_squared:.3f}", f"{100.0 * samples.rms_residual_nm:.2f}"]


def figure_of(run: Run, monkeypatch: pytest.MonkeyPatch) -> Figure:
    monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)
    return plot_fits(run, Path("fits.png"))


def test_a_fit_is_drawn_next_to_its_residuals_in_units_of_its_coefficient(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The slope of each line is k in N/cm³, the residuals are those of its samples, and both flippers share scales.

    The strides of a mud are one artist.
    """
    axes = figure_of(run, monkeypatch).axes
    for column, flipper in ((0, "left"), (2, "right")):
        samples = run.strides[0].samples(flipper, "k_p")
        assert samples is not None
        marks, line, *_ = axes[column].lines
        of_first = slice(len(samples.moments_m4))
        (x0, x1), (y0, y1) = np.asarray(line.get_xdata())[:2], np.asarray(line.get_ydata())[:2]
        assert (y1 - y0) / (x1 - x0) == pytest.approx(run.strides[0].rows[flipper]["k_p"] / 1e6)
        residuals = np.asarray(axes[column + 1].lines[0].get_ydata())[of_first]
        np.testing.assert_allclose(residuals, 100.0 * np.array(samples.residuals_nm))
        np.testing.assert_allclose(np.asarray(marks.get_xdata())[of_first], 1e8 * np.array(samples.moments_m4))
    for left, right in ((axes[0], axes[2]), (axes[1], axes[3])):
        assert left.get_xlim() == right.get_xlim() and left.get_ylim() == right.get_ylim()


def test_a_long_walk_draws_few_strides_of_each_mud() -> None:
    run = run_of([fitted("a") for _ in range(300)] + [fitted("b") for _ in range(3)])
    drawn = {mud: len(samples) for mud, samples in drawn_samples(run, "left", "k_p")}
    assert drawn == {"a": MOST_DRAWN, "b": 3}


def test_a_sample_far_off_is_counted_and_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    moments = np.linspace(1e-8, 3e-7, 60)
    torques = K * moments + 0.002 * np.cos(np.arange(60.0))
    torques[30] = -9.0
    run = run_of([fitted("a", FitSamples(moments.tolist(), torques.tolist(), [0.001] * 60, K))])
    fit, residuals, *_ = figure_of(run, monkeypatch).axes
    for panel in (fit, residuals):
        assert panel.get_ylim()[0] > -900.0
        assert [text.get_text() for text in panel.texts] == ["1 beyond"]


def test_a_run_with_hundreds_of_muds_draws_those_with_the_most_strides(monkeypatch: pytest.MonkeyPatch) -> None:
    muds = [f"mud {number}" for number in range(300)]
    run = run_of([fitted(mud) for mud in muds] + [fitted(mud) for mud in muds[100 : 100 + MOST_MUDS]])
    assert drawn_muds(run) == muds[100 : 100 + MOST_MUDS]
    legend, *_ = figure_of(run, monkeypatch).legends
    assert [text.get_text() for text in legend.get_texts()] == drawn_muds(run)
    assert {mud for mud, _ in drawn_samples(run, "left", "k_p")} == set(drawn_muds(run))


def test_the_legend_of_one_flipper_fits_into_its_narrower_picture(tmp_path: Path) -> None:
    muds = [f"k_p 1.7 N/cm³, from {number} s" for number in range(2000, 2000 + MOST_MUDS)]
    run = run_of([fitted(mud) for mud in muds])
    for flippers in (("left", "right"), ("right",)):
        figure = plot_fits(replace(run, flippers=flippers), tmp_path / "fits.png")
        legend, *_ = figure.legends
        outline = legend.get_window_extent()
        assert outline.x0 >= 0.0 and outline.x1 <= figure.bbox.width
