"""The reference sensor of a path that does all strokes at once: the mud that each flipper met, and its surface.

It has no phases. A stride is a stay of one flipper in the mud that a stroke reaches; its strokes are not separated.
"""

from control.records import TWO_FLIPPERS, Phase, Rig
from simulation.body.plant import Plant
from simulation.body.reference_sensor import FlipperReference, StrideTruth, snapshot_of
from simulation.mud.disturbances import STROKE_M


class PathReference:
    """Owns the count of strides of each flipper, and the stays so far."""

    def __init__(self, rig: Rig = TWO_FLIPPERS) -> None:
        self._flippers = [FlipperReference(flipper) for flipper in rig.flippers]
        self._counts = [0] * len(self._flippers)

    def step(self, dt_s: float, plant: Plant, _: Phase) -> list[StrideTruth]:
        """Return the strides that end, whose `insertion` is the whole stay."""
        closed = []
        for number, (flipper, arm) in enumerate(zip(self._flippers, plant.arms, strict=True)):
            if snapshot_of(arm, plant.body_m_s).depth_m > 0.0:
                flipper.update(dt_s, arm, plant.body_m_s, Phase.INSERTION)
                continue
            stay = flipper.truth(self._counts[number], arm)
            if stay.insertion.deepest_m >= STROKE_M:
                self._counts[number] += 1
                closed.append(stay)
            flipper.reset()
        return closed
