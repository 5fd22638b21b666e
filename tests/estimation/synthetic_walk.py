"""A stride of one flipper at 380 Hz through mud that keeps the estimator's own laws: samples for tests.

The joints follow the gait exactly. The currents carry k_p Φ, k_s Ψ and k_e Φ, the cross-coupling of the plate's face,
gravity, inertia and noise, so surface, stance and extraction are found as on a robot.
"""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from typing import Any, NamedTuple

from control.computing.bounded_work import finish
from control.gait.gait import Gait, stride_duration_s
from control.geometry import FlipperGeometry
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.plate_integrals import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.rate import PERIOD_S
from control.records import DriveState, FlipperLoad, Phase, StrideEstimate
from estimation.joint_load import FlipperDrive
from estimation.stride_estimator import StrideEstimator

DEPTH_M, SURFACE_M = 0.03, 0.002
K_P, K_S, K_E = 1.0e6, 0.6e6, 0.7e6  # N/m³, about the paper's middle mud
NOISE_A = 0.1
GEOMETRY, GAIT = FlipperGeometry(), GaitParameters()
DRIVE = FlipperDrive(ArmMass(), 0.083, 0.083)


def update(flipper: StrideEstimator, *sample: Any) -> tuple[FlipperLoad, StrideEstimate | None]:
    """Add a sample to one flipper and finish all the work that it causes."""
    load, closing = flipper.add(*sample)
    if not flipper.work.is_empty:
        flipper.work.finish()
        load = flipper.load
    return load, None if closing is None else finish(closing)


class Sample(NamedTuple):
    """One tick of one flipper: the arguments of an estimator's `add`."""

    now_s: float
    phase: Phase
    sweep: DriveState
    adduction: DriveState
    body_x_m: float = 0.0


def motion() -> list[Sample]:
    """Return one stride, without any current."""
    gait, samples = Gait(GAIT, GEOMETRY), list[Sample]()
    gait.reset(DEPTH_M)
    for tick in range(1, int(stride_duration_s(GAIT, GEOMETRY, DEPTH_M) / PERIOD_S)):
        target = gait.step(PERIOD_S)
        sweep_rad, sweep_rad_s = target.sweep_rad, target.sweep_velocity_rad_s
        lift_rad = GEOMETRY.adduction_rad(sweep_rad, target.depth_m)
        lift_rad_s = GEOMETRY.adduction_velocity_rad_s(sweep_rad, lift_rad, sweep_rad_s, target.depth_velocity_m_s)
        samples.append(sample_of(tick * PERIOD_S, target.phase, (sweep_rad, sweep_rad_s), (lift_rad, lift_rad_s)))
    return samples


def sample_of(now_s: float, phase: Phase, sweep: tuple[float, float], adduction: tuple[float, float]) -> Sample:
    """Return a sample of these angles and velocities, with messages of this very tick."""
    return Sample(now_s, phase, DriveState(*sweep, now_s, 0.0, now_s), DriveState(*adduction, now_s, 0.0, now_s))


def mud_torques_nm(sample: Sample) -> tuple[float, float]:
    """Return the torques of the mud on (sweep, adduction)."""
    sweep_rad, adduction_rad = sample.sweep.angle_rad, sample.adduction.angle_rad
    plate = submerged_plate(GEOMETRY, sweep_rad, adduction_rad, SURFACE_M)
    if sample.phase is Phase.STANCE:
        sweep_nm = K_S * stance_moment_m4(GEOMETRY, plate)
        return sweep_nm, cross_coupling(GEOMETRY, plate, sweep_rad) * sweep_nm
    k = {Phase.INSERTION: K_P, Phase.EXTRACTION: -K_E}.get(sample.phase, 0.0)
    return 0.0, k * stroke_moment_m4(GEOMETRY, plate, sweep_rad)


def stride_samples(seed: int = 1) -> list[Sample]:
    """Return one stride with currents. Accelerations span from the sample before to the one after: in a quick
    extraction the inertia is as large as the mud's load, and a shift of half a tick would show.
    """
    random, samples, loaded = Random(seed), motion(), list[Sample]()
    for before, sample, after in zip(samples[:1] + samples, samples, samples[1:] + samples[-1:], strict=False):
        dt_s = after.now_s - before.now_s
        spent_nm = [
            inertia_kg_m2 * (then.velocity_rad_s - first.velocity_rad_s) / dt_s
            for inertia_kg_m2, first, then in (
                (DRIVE.mass.sweep_inertia_kg_m2, before.sweep, after.sweep),
                (DRIVE.mass.adduction_inertia_kg_m2, before.adduction, after.adduction),
            )
        ]
        gravity_nm = DRIVE.mass.gravity_torques_nm(sample.sweep.angle_rad, sample.adduction.angle_rad)
        sweep_a, adduction_a = (
            (spent - mud - gravity) / constant_nm_a + random.gauss(0.0, NOISE_A)
            for spent, mud, gravity, constant_nm_a in zip(
                spent_nm, mud_torques_nm(sample), gravity_nm, DRIVE[1:3], strict=True
            )
        )
        loaded.append(
            sample._replace(
                sweep=sample.sweep._replace(current_a=sweep_a),
                adduction=sample.adduction._replace(current_a=adduction_a),
            )
        )
    return loaded


def later(samples: Iterable[Sample], seconds: float) -> list[Sample]:
    return [
        Sample(now_s + seconds, phase, _later(sweep, seconds), _later(adduction, seconds), body_x_m)
        for now_s, phase, sweep, adduction, body_x_m in samples
    ]


def _later(joint: DriveState, seconds: float) -> DriveState:
    return joint._replace(angle_stamp_s=joint.angle_stamp_s + seconds, current_stamp_s=joint.current_stamp_s + seconds)
