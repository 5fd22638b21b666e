"""How well the strides before it predict a stride's load: the laws' torques against the ground's true ones.

The law of a coefficient is a torque per unit of it in each pose of the plate (plate_integrals.py), below the surface
that the robot finds. It is evaluated where the estimator would fit the coefficient, by the estimator's own choice of
samples from the true loads: k_p in the insertion, k_e over the last three quarters of the way up, k_s where the plate
slips. The torque on the adduction joint is compared without the load across the plate's face, as it is fitted.

No coefficient predicts a ground that does not follow its law: the error of the best one for the same samples is what
the law itself leaves.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from control.computing.bounded_work import finish
from control.geometry import FlipperGeometry
from control.records import Phase
from estimation.flipper import STEPS_M
from estimation.path_motion import PathMotion
from estimation.strokes.fit_samples import FitSamples
from estimation.strokes.shear import Base, find_shear, shear_samples
from estimation.strokes.stroke import Stroke
from estimation.strokes.stroke_fit import extraction_samples, insertion_samples
from estimation.strokes.surface_memory import unknown_surface
from experiments.trials.trial import TrueLoad


class LoadError(NamedTuple):
    """RMS errors of the torque in one stroke, as fractions of the stride's largest torque."""

    prediction: float
    misfit: float  # of the law with the best coefficient


def load_errors(
    loads: Sequence[TrueLoad], geometry: FlipperGeometry, surface_m: float, predicted_n_m3: Mapping[str, float]
) -> dict[str, LoadError]:
    """Return the errors of each predicted coefficient; those without samples, as of mud that held, are left out.

    `loads` are those of one flipper over one stride.
    """
    largest_nm = max(max(abs(load.sweep_nm), abs(load.adduction_nm)) for load in loads)
    true = _samples(loads, geometry, surface_m)
    return {
        name: LoadError(
            samples._replace(slope=k_n_m3).rms_residual_nm / largest_nm, samples.rms_residual_nm / largest_nm
        )
        for name, k_n_m3 in predicted_n_m3.items()
        if (samples := true[name]) is not None
    }


def _samples(loads: Sequence[TrueLoad], geometry: FlipperGeometry, surface_m: float) -> dict[str, FitSamples | None]:
    insertion, stance, extraction = _strokes(loads, geometry, surface_m)
    surface = unknown_surface(0.0)._replace(depth_m=surface_m)
    shear = finish(find_shear(geometry, stance.batches, surface_m, Base.FREE, 0.0))
    return {
        "k_p": insertion_samples(geometry, insertion.moving(), surface),
        "k_s": shear_samples(geometry, stance.batches, surface_m, shear),
        "k_e": extraction_samples(geometry, extraction.moving(), surface, extraction.first_m),
    }


def _strokes(loads: Sequence[TrueLoad], geometry: FlipperGeometry, surface_m: float) -> list[Stroke]:
    """Return insertion, stance and extraction; a path does them at once."""
    strokes, motion = {phase: Stroke(step_m) for phase, step_m in STEPS_M.items()}, PathMotion()
    for load in loads:
        depth_m, swept_m = geometry.depth_m(*load.angles_rad), geometry.flipper_length_m * load.angles_rad[0]
        travels_m = {load.phase: swept_m if load.phase is Phase.STANCE else depth_m}
        if load.phase is Phase.STROKE:
            travels_m = {motion.update(depth_m, depth_m > surface_m): depth_m}
            if depth_m > surface_m:
                travels_m[Phase.STANCE] = swept_m
        for phase in STEPS_M.keys() & travels_m:
            felt = *load.angles_rad, load.sweep_nm, load.adduction_nm, load.body_m, False
            strokes[phase].update(load.now_s, travels_m[phase], *felt)
    if (across := strokes[Phase.STANCE].batches) and across[0].travel_m < across[-1].travel_m:
        strokes[Phase.STANCE].mirror()  # of a walk backward
    return [*strokes.values()]
