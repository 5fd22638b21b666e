"""The picture of the errors can be drawn for any errors."""

from dataclasses import replace
from pathlib import Path

import pytest

from experiments.estimation.evaluation import Outcome, Plan, report_of
from experiments.estimation.plots import plot_errors
from experiments.reports.error_table import ErrorRow


def row(setup: str, coefficient: str, method: str = "default", median: float | None = 0.05) -> ErrorRow:
    p95, strides = (None, 0) if median is None else (30.0 * median, 4)
    return ErrorRow(
        setup, "49.5", coefficient, method, median, p95, 0.0, 1.0, strides, 4 - strides, 1.0, 0.8, 0, 1000000
    )


@pytest.mark.parametrize(
    "errors",
    [
        [row("walking", "k_p"), row("walking", "k_p", "paper"), row("single flipper", "k_s")],
        [row("walking", "k_s", median=None)],
        [row("walking", "k_e", median=30.0)],
    ],
)
def test_any_errors_make_a_picture(errors: list[ErrorRow], tmp_path: Path) -> None:
    path = tmp_path / "errors.png"
    plot_errors(replace(report_of(Plan(), Outcome([], [])), errors=errors), path)
    assert path.read_bytes().startswith(b"\x89PNG")
