"""Least squares of y = k x, one sample at a time.

With S = Σx², b = Σxy, q = Σy² and n samples, k = b/S minimises the squared error; the residual variance is
s² = (q - b²/S) / (n - 1) and the standard error of k is √(s²/S). The three sums are the whole memory, and the result
is that of a batch fit to rounding.
"""

from math import inf, isfinite, sqrt

from control.records import UNKNOWN, Estimate

MIN_SAMPLES = 5
LARGEST_UNCERTAINTY = 0.5  # a coefficient whose standard error is more than this fraction of it is invalid


class LineFit:
    """Owns the running sums of one coefficient over one stroke."""

    __slots__ = ("b", "n", "q", "s")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.s = self.b = self.q = 0.0
        self.n = 0

    def update(self, x: float, y: float) -> None:
        self.s += x * x
        self.b += x * y
        self.q += y * y
        self.n += 1

    def estimate(self) -> Estimate:
        if self.n < MIN_SAMPLES:
            return Estimate(UNKNOWN, UNKNOWN, self.n, False, f"fewer than {MIN_SAMPLES} samples in the mud")
        if not self.s > 0.0:
            return Estimate(UNKNOWN, UNKNOWN, self.n, False, "no depth in any sample")
        k = self.b / self.s
        residual = self.q - self.b * k
        std_error = sqrt(max(0.0, residual) / (self.n - 1) / self.s) if isfinite(residual) else inf
        return Estimate(k, std_error, self.n, *_verdict(k, std_error), repeatability=std_error)


def _verdict(k: float, std_error: float) -> tuple[bool, str]:
    if not (isfinite(k) and isfinite(std_error)):
        return False, "not finite"
    if k <= 0.0:
        return False, "the force does not oppose the motion"
    if std_error > LARGEST_UNCERTAINTY * k:
        return False, "the samples do not follow the law"
    return True, ""
