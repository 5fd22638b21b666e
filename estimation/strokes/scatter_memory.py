"""The scatter of a flipper's extractions: the residual variance pooled over a trial.

A stroke of five batches leaves three degrees of freedom after the line that counts as deviation from the law, so its
own variance is uncertain by a factor of two and Student's factor is 1.6. The strokes of one kind share motor, sampling
and mud, so their variances v_i with ν_i degrees of freedom estimate the same variance,

    v = Σ ν_i v_i / Σ ν_i        std_error = t(Σ ν_i) √(v / Σ w x²)

which needs hardly any factor after three strokes. A stroke that scatters more than the others (a stone) keeps its own
variance. Old strokes fade, since the mud changes along the track.
"""

from math import sqrt

from estimation.strokes.origin_fit import OriginFit, student_factor

REMEMBERED = 8  # strokes


class ScatterMemory:
    """Owns the pooled residual variance of one kind of stroke of one flipper."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._sum = self._freedom = 0.0

    def pooled(self, fit: OriginFit) -> OriginFit:
        """Remember the scatter of a fit, and return the fit with the standard error of the pooled variance."""
        fading = 1.0 - 1.0 / REMEMBERED
        self._sum = fading * self._sum + fit.freedom * fit.variance
        self._freedom = fading * self._freedom + fit.freedom
        factor = student_factor(int(self._freedom))
        variance = max(factor * factor * self._sum / self._freedom, fit.variance)
        return fit._replace(std_error=sqrt(variance / fit.square))
