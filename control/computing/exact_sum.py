"""The sum of floats, rounded once, which is the same number in every version of Python.

The built-in `sum` compensates its rounding from Python 3.12 on and does not before, so that the last digit of a
coefficient depended on the interpreter. tests/estimation/test_same_digits.py refuses it where one is computed.
"""

from collections.abc import Iterable
from math import fsum, nan


def exact_sum(values: Iterable[float]) -> float:
    """Return the sum; NaN where it overflows, or where infinities of both signs meet."""
    try:
        return fsum(values)
    except (OverflowError, ValueError):
        return nan
