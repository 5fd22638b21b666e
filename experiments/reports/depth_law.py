"""How a coefficient changes with depth over the strides of one mud: k ∝ z^m, and whether mud does that.

The line ln k = a + m ln z is fitted with the weights of the estimator's own memory (estimation/strokes/depth_line.py);
where the strides scatter more than they claim, the error of m grows with them (Birge's ratio). Mud has the exponents
from which that memory starts. For k_s, which divides a force by the depth squared, an exponent of -2 is a force that
does not depend on the depth at all: that of the motors, or of the body that they move.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from pandas import DataFrame, Series
from pandas.api.typing import DataFrameGroupBy

from estimation.strokes.depth_line import REPEATABILITY, SHEAR_LAW, STROKE_LAW

FEWEST = 4  # strides: two of them determine any line
NARROWEST = 1.15  # deepest over shallowest stride: over less a line of ln k has no slope
FAILS = 2.0  # standard errors of the difference
CONSTANT_FORCE = -2.0


class DepthLaw(NamedTuple):
    exponent: float
    std_error: float
    shallowest_m: float
    deepest_m: float


def fit_depth_law(strides: DataFrame) -> DepthLaw | None:
    """Fit the exponent to the rows with `value`, `repeatability` and `depth_m`; None where they do not determine it."""
    known = strides[(strides["value"] > 0.0) & (strides["depth_m"] > 0.0) & (strides["repeatability"] > 0.0)]
    depths_m = known["depth_m"].to_numpy(float)
    if len(known) < FEWEST or depths_m.max() < NARROWEST * depths_m.min():
        return None
    values = known["value"].to_numpy(float)
    weights = 1.0 / ((known["repeatability"].to_numpy(float) / values) ** 2 + REPEATABILITY**2)
    logs_k, logs_z = np.log(values), np.log(depths_m)
    apart = logs_z - np.average(logs_z, weights=weights)
    square = float(np.sum(weights * apart**2))
    exponent = float(np.sum(weights * apart * logs_k)) / square
    residuals = logs_k - np.average(logs_k, weights=weights) - exponent * apart
    birge = max(1.0, float(np.sum(weights * residuals**2)) / (len(known) - 2))
    return DepthLaw(exponent, sqrt(birge / square), float(depths_m.min()), float(depths_m.max()))


def re_entered(walks: DataFrameGroupBy, plate_width_m: float) -> Series:
    """Return which strides began in the hole of the one before: the body had advanced by less than a plate's width.

    Mud is weaker there, at any depth. Without a pose it is not known, and False.
    """
    return walks["step_m"].shift().abs() < plate_width_m


def law_finding(coefficient: str, law: DepthLaw | None) -> str:
    """Return a sentence where the strides of one mud contradict the depth law of mud, else nothing."""
    if law is None:
        return ""
    expected, spread = SHEAR_LAW if coefficient == "k_s" else STROKE_LAW
    if abs(law.exponent - expected) <= FAILS * sqrt(law.std_error**2 + spread**2):
        return ""
    text = (
        f"{coefficient} changes with depth to the power {law.exponent:.1f} ± {law.std_error:.1f} from "
        f"{100.0 * law.shallowest_m:.1f} to {100.0 * law.deepest_m:.1f} cm, where mud has {expected:g} ± {spread:g}: "
        "compare no values of different depths."
    )
    if coefficient == "k_s" and abs(law.exponent - CONSTANT_FORCE) <= FAILS * law.std_error:
        text += " The power -2 is a force that does not depend on depth: that of the motors or of the body."
    return text
