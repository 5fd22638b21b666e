"""The picture of the errors: that it can be drawn whatever was told."""

from pathlib import Path
from typing import Any

import pytest

from experiments.estimation.plots import plot_errors


def row(setup: str, coefficient: str, method: str = "default", **changes: Any) -> dict[str, Any]:
    reported = {"setup": setup, "mud": "49.5", "coefficient": coefficient, "method": method}
    return reported | {"median": 0.05, "p95": 0.2, "strides": 4, "bounds": 0} | changes


@pytest.mark.parametrize(
    "errors",
    [
        [row("walking", "k_p"), row("walking", "k_p", "paper"), row("single flipper", "k_s")],
        [row("walking", "k_s", median=None, p95=None, strides=0, bounds=4)],
        [row("walking", "k_e", median=30.0, p95=900.0)],
    ],
)
def test_any_errors_make_a_picture(errors: list[dict[str, Any]], tmp_path: Path) -> None:
    path = tmp_path / "errors.png"
    plot_errors({"errors": errors}, path)
    assert path.read_bytes().startswith(b"\x89PNG")
