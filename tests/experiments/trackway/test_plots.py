"""The pictures of the walks: that they can be drawn whatever came of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from experiments.trackway.plots import plot_sweep, plot_trackway

MUDS = ("48.5", "53.1")


def stride(mud: str, position_cm: float, failure: str = "") -> dict[str, Any]:
    return {
        "mud": mud,
        "place_cm": position_cm,
        "depth_cm": 3.0,
        "step_cm": 11.0,
        "duration_s": 1.6,
        "failure": failure,
    }


def trackway(*rules: str, mean: float | None = 6.0) -> dict[str, Any]:
    cell = {"mean": mean, "sd": None}
    strides = [stride("48.5", 10.0), stride("53.1", 70.0, "slippage"), stride("53.1", 80.0, "extraction")]
    return {
        "table": {rule: dict.fromkeys(MUDS, cell) for rule in rules},
        "walks": {rule: [strides] for rule in rules},
        "paper": {"3 cm": dict.fromkeys(MUDS, {"mean": 7.6, "sd": 0.5})},
        "best_constant_depth": dict.fromkeys(MUDS, {"depth_cm": 2.5, "mean": 8.0}),
        "settings": {"mud_length_cm": dict.fromkeys(MUDS, 61.0)},
    }


def sweep(*strengths_pa: float, settled: dict[str, Any] | None = None) -> dict[str, Any]:
    constant = [
        {"depth_cm": depth_cm, "mean": 2.0 * depth_cm, "failures": failures, "strides": 12}
        for depth_cm, failures in ((2.0, {"slippage": 12}), (3.0, {}), (5.0, {"extraction": 6}))
    ]
    settled = settled or {"depth_cm": 3.1, "depth_range_cm": [2.5, 5.0], "share_of_best": 0.95}
    row = {"constant": constant, "best": {"depth_cm": 5.0, "mean": 10.0}}
    row |= {"methods": {"default": {"failures": {"slippage": 1}, "strides": 20} | settled}}
    return {
        "strengths": [row | {"strength_pa": strength_pa} for strength_pa in strengths_pa],
        "settings": {"methods": ["default"]},
    }


def is_picture(path: Path) -> bool:
    return path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "report",
    [
        trackway("3 cm", "5 cm", "adaptive", "adaptive, paper", "adaptive, third"),
        trackway("3 cm", mean=None),  # a mud that was never reached
    ],
)
def test_any_walks_make_a_picture(report: dict[str, Any], tmp_path: Path) -> None:
    plot_trackway(report, tmp_path / "trackway.png")
    assert is_picture(tmp_path / "trackway.png")


@pytest.mark.parametrize(
    "report",
    [
        sweep(300.0, 1000.0, 6000.0),
        sweep(1000.0),
        sweep(1000.0, settled={"depth_cm": None, "depth_range_cm": None, "share_of_best": None}),
    ],
)
def test_any_sweep_makes_a_picture(report: dict[str, Any], tmp_path: Path) -> None:
    plot_sweep(report, tmp_path / "sweep.png")
    assert is_picture(tmp_path / "sweep.png")
