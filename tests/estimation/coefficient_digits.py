"""Print the coefficients of four synthetic strides, digit by digit, for other versions of Python to compare.

`python -m tests.estimation.coefficient_digits` needs no package, so it runs in any interpreter.
"""

import json

from control.records import BodyPose, Joints
from estimation.mud import MudEstimator
from tests.estimation.synthetic_strides import DRIVE, GEOMETRY, stride_samples

STRIDES = 4
STRIDE_S = 20.0  # longer than a stride


def coefficient_digits() -> list[str]:
    """Return the estimates after each stride as texts that state every digit."""
    mud = MudEstimator(GEOMETRY, [DRIVE, DRIVE])
    digits = []
    for stride in range(STRIDES):
        left, right = (stride_samples(seed) for seed in (2 * stride, 2 * stride + 1))
        for rows in zip(left, right, strict=True):
            one, other = (row.later(stride * STRIDE_S) for row in rows)
            states = Joints(one.sweep, one.adduction, other.sweep, other.adduction)
            reading = mud.update(one.now_s, one.phase, states, BodyPose())
            digits += [repr(reading.strides)] if reading.strides else []
        digits.append(repr(mud.mud_estimate))
    return digits


if __name__ == "__main__":
    print(json.dumps(coefficient_digits()))
