"""Colours that are drawn together differ for colour-blind readers, and muds also differ in lightness, for print."""

from collections.abc import Iterable
from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from experiments.reports.mud_styles import looks_of
from experiments.reports.style import FLIPPER_COLOURS, FORWARD, MUD_SHADES, OUTCOME_COLOURS, UP

VISIONS = {  # Machado, Oliveira and Fernandes (2009), severity 1.0, on linear RGB
    "normal": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.119192, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])
PLAIN = 20.0  # distance in CIELAB that is easily seen; 2.3 is just noticeable


def lab(colour: str, vision: str) -> np.ndarray:
    encoded = np.array(to_rgb(colour))
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(np.array(VISIONS[vision]) @ linear, 0.0, 1.0) / WHITE
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def nearest(colours: Iterable[str], vision: str) -> float:
    return min(float(np.linalg.norm(lab(a, vision) - lab(b, vision))) for a, b in combinations(colours, 2))


@pytest.mark.parametrize("vision", VISIONS)
def test_colours_that_are_drawn_together_differ_for_every_reader(vision: str) -> None:
    assert nearest([FORWARD, UP], vision) > PLAIN
    assert nearest(OUTCOME_COLOURS.values(), vision) > PLAIN
    assert nearest([*FLIPPER_COLOURS.values(), MUD_SHADES[-1]], vision) > PLAIN
    assert nearest([look["color"] for look in looks_of(["a", "b", "c", "d"]).values()], vision) > PLAIN


def test_neighbouring_muds_differ_in_lightness() -> None:
    lightness = [lab(shade, "normal")[0] for shade in MUD_SHADES]
    assert np.all(np.diff(lightness) < -5.0)
