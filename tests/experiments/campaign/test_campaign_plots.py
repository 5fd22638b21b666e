"""The picture of a campaign: numbers on an axis, words side by side, points that did not start."""

from math import nan
from typing import Any

import numpy as np
import pytest

from experiments.campaign.plots import draw_speeds

pytestmark = pytest.mark.filterwarnings("error", "ignore::ResourceWarning")  # another test may have left a file open


def point(speed_m_s: float, **values: Any) -> dict[str, Any]:
    return {"values": values, "speed_m_s": speed_m_s, "speed_sd_m_s": nan}


def test_each_key_has_a_panel_with_the_mean_speed_of_each_value() -> None:
    points = [
        point(0.02, strength=500.0, method="default", plate=""),
        point(0.04, strength=500.0, method="paper", plate=""),
        point(0.06, strength=6000.0, method="default", plate="../a/paddle.csv"),
        point(nan, strength=6000.0, method="paper", plate="../a/paddle.csv"),
    ]
    strength, method, plate = draw_speeds(points).axes[:3]
    means = [np.asarray(panel.lines[-1].get_ydata()).tolist() for panel in (strength, method, plate)]
    assert means == [pytest.approx([3.0, 6.0]), pytest.approx([4.0, 4.0]), pytest.approx([3.0, 6.0])]
    assert strength.get_xscale() == "log" and np.asarray(strength.lines[-1].get_xdata()).tolist() == [500.0, 6000.0]
    assert [tick.get_text() for tick in plate.get_xticklabels()] == ["-", "paddle.csv"]


@pytest.mark.parametrize("least_cm_s", [0.0, -2.0, nan])
def test_a_random_sample_has_no_means_and_may_go_backward_or_not_have_started(least_cm_s: float) -> None:
    points = [point(0.01 * (least_cm_s + number), strength=500.0 + number) for number in range(30)]
    (panel,) = draw_speeds(points).axes
    assert all(line.get_linestyle() == "None" for line in panel.lines)
    assert not panel.get_ylim()[0] > least_cm_s
