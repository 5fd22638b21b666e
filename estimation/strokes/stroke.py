"""One stroke as batches of equal travel: the bounded memory from which its coefficient is fitted.

Samples are averaged until the flipper has travelled `step_m` further. A flipper at rest adds to one batch however long
it rests, and a moving flipper leaves the same batches at any message rate. Residuals are computed from batch means, so
a standard error depends on travelled distance and not on the number of messages.
"""

from typing import NamedTuple

from control.records import UNKNOWN

LONGEST = 60  # batches, which bounds the time of a fit: 41 of an insertion to 5 cm; later ones are dropped
MOVING = 0.6  # of the median speed; below it the flipper starts or stops
MOSTLY = 0.3  # fraction of saturated samples from which a batch counts as saturated


class Batch(NamedTuple):
    """Means over one piece of the travel."""

    travel_m: float
    sweep_rad: float
    adduction_rad: float
    sweep_nm: float
    adduction_nm: float
    body_m: float  # NaN without a pose
    saturated: bool
    samples: int
    speed_m_s: float  # along the stroke


class Stroke:
    """Owns the batches of the stroke under way."""

    __slots__ = (
        "_body", "_clipped", "_lift", "_n", "_start_m", "_start_s", "_sweep", "_swept", "_travel",
        "_turned",
        "batches", "first_m", "mirrored", "step_m",
    )  # fmt: skip

    def __init__(self, step_m: float) -> None:
        self.step_m = step_m
        self.reset()

    def reset(self) -> None:
        self.batches: list[Batch] = []
        self.mirrored = False
        self.first_m = UNKNOWN  # travel of the first sample
        self._start_m = self._start_s = 0.0
        self._empty()

    def _empty(self) -> None:
        self._n = self._clipped = 0
        self._travel = self._sweep = self._lift = self._swept = self._turned = self._body = 0.0

    def update(
        self,
        now_s: float,
        travel_m: float,
        sweep_rad: float,
        adduction_rad: float,
        sweep_nm: float,
        adduction_nm: float,
        body_m: float,
        saturated: bool,
    ) -> None:
        """Add a sample at the position `travel_m` along the stroke, which may move in either direction."""
        if self._n == 0:
            self._start_m, self._start_s = travel_m, now_s
            if not self.batches:
                self.first_m = travel_m
        elif not -self.step_m < travel_m - self._start_m < self.step_m:
            self.close(now_s, travel_m)
            self._start_m, self._start_s = travel_m, now_s
        self._n += 1
        self._clipped += saturated
        self._travel += travel_m
        self._sweep += sweep_rad
        self._lift += adduction_rad
        self._swept += sweep_nm
        self._turned += adduction_nm
        self._body += body_m

    def close(self, now_s: float, travel_m: float) -> None:
        """End the batch under way; also called when the stroke ends."""
        n = self._n
        if n and len(self.batches) < LONGEST:
            elapsed_s = now_s - self._start_s
            self.batches.append(
                Batch(
                    self._travel / n,
                    self._sweep / n,
                    self._lift / n,
                    self._swept / n,
                    self._turned / n,
                    self._body / n,
                    self._clipped > MOSTLY * n,
                    n,
                    abs(travel_m - self._start_m) / elapsed_s if elapsed_s > 0.0 else 0.0,
                )
            )
        self._empty()

    def mirror(self) -> None:
        """Turn a stroke that pushes the body backward into the one that pushes it forward: front and rear change."""
        self.mirrored = True
        self.batches = [
            batch._replace(
                travel_m=-batch.travel_m, sweep_rad=-batch.sweep_rad, sweep_nm=-batch.sweep_nm, body_m=-batch.body_m
            )
            for batch in self.batches
        ]

    def moving(self) -> list[Batch]:
        """Return the batches without the slow ones at both ends: mud resists slow motion less."""
        speeds_m_s = sorted([batch.speed_m_s for batch in self.batches])
        least_m_s = MOVING * speeds_m_s[len(speeds_m_s) // 2] if speeds_m_s else 0.0
        quick = [i for i, batch in enumerate(self.batches) if batch.speed_m_s >= least_m_s]
        return self.batches[quick[0] : quick[-1] + 1] if quick else []
