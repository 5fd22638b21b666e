"""Strides of one flipper at 380 Hz whose truth is known: the motion of the gait, and the currents of a mud's torques.

The joints follow the gait exactly. The currents carry the torques of a mud, gravity, inertia and friction; noise is
added on request. `stride_samples` is one stride through mud that keeps the estimator's own laws. This module needs no
package, so it runs in any interpreter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from math import nan
from random import Random
from typing import Any, NamedTuple

from control.computing.bounded_work import finish
from control.gait.gait import Gait
from control.gait.stride_table import stride_duration_s
from control.geometry import FlipperGeometry
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.plate_integrals import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.records import DriveState, FlipperLoad, GaitTarget, Phase, StrideEstimate
from estimation.joint_load import FlipperDrive
from estimation.stride_estimator import StrideEstimator

RATE_HZ = 380.0
INSTANT_S = 1e-5  # over which accelerations are taken: none of the gait's changes within it
GEOMETRY, GAIT = FlipperGeometry(), GaitParameters()
WEIGHTLESS = ArmMass(0.0, 0.0, 0.0, 0.0)
Torques = tuple[float, float]  # of the mud on sweep and adduction, N·m


class Moment(NamedTuple):
    """The exact motion of one flipper at one tick."""

    now_s: float
    phase: Phase
    sweep_rad: float
    adduction_rad: float
    sweep_rad_s: float = 0.0
    adduction_rad_s: float = 0.0
    sweep_rad_s2: float = 0.0
    adduction_rad_s2: float = 0.0

    @property
    def depth_m(self) -> float:
        return GEOMETRY.depth_m(self.sweep_rad, self.adduction_rad)

    def measured(self, sweep_a: float, adduction_a: float) -> Row:
        """Return what the drives report in this very tick."""
        now_s = self.now_s
        sweep = DriveState(self.sweep_rad, self.sweep_rad_s, now_s, sweep_a, now_s)
        return Row(
            now_s, self.phase, sweep, DriveState(self.adduction_rad, self.adduction_rad_s, now_s, adduction_a, now_s)
        )


class Row(NamedTuple):
    """The arguments of an estimator's `add`."""

    now_s: float
    phase: Phase
    sweep: DriveState
    adduction: DriveState
    body_m: float = 0.0

    @property
    def depth_m(self) -> float:
        return GEOMETRY.depth_m(self.sweep.angle_rad, self.adduction.angle_rad)

    def lost(self) -> Row:
        return self._replace(adduction=self.adduction._replace(angle_rad=nan))

    def pushed(self, sweep_a: float, adduction_a: float) -> Row:
        """Return the row with more current."""
        return self._replace(
            sweep=self.sweep._replace(current_a=self.sweep.current_a + sweep_a),
            adduction=self.adduction._replace(current_a=self.adduction.current_a + adduction_a),
        )

    def later(self, seconds: float) -> Row:
        sweep, adduction = (
            each._replace(angle_stamp_s=each.angle_stamp_s + seconds, current_stamp_s=each.current_stamp_s + seconds)
            for each in (self.sweep, self.adduction)
        )
        return Row(self.now_s + seconds, self.phase, sweep, adduction, self.body_m)


def joints(target: GaitTarget) -> tuple[float, float, float, float]:
    """Return the angles and velocities of joints that follow the gait exactly."""
    lift_rad = GEOMETRY.adduction_rad(target.sweep_rad, target.depth_m)
    lift_rad_s = GEOMETRY.adduction_velocity_rad_s(
        target.sweep_rad, lift_rad, target.sweep_velocity_rad_s, target.depth_velocity_m_s
    )
    return target.sweep_rad, lift_rad, target.sweep_velocity_rad_s, lift_rad_s


@cache
def walked(
    depth_m: float = 0.03,
    gait: GaitParameters = GAIT,
    strides: int = 1,
) -> tuple[Moment, ...]:
    """Return whole strides, from insertion to swing."""
    walk, moments = Gait(gait, GEOMETRY), list[Moment]()
    walk.reset(depth_m)
    for tick in range(1, int(strides * stride_duration_s(gait, GEOMETRY, depth_m) * RATE_HZ) + 1):
        before, target = joints(walk.step(1.0 / RATE_HZ - 2.0 * INSTANT_S)), walk.step(INSTANT_S)
        after = joints(walk.step(INSTANT_S))
        accelerations = [(after[i] - before[i]) / (2.0 * INSTANT_S) for i in (2, 3)]
        moments.append(Moment(tick / RATE_HZ, target.phase, *joints(target), *accelerations))
    return tuple(moments)


def loaded(moments: Iterable[Moment], mud_nm: Callable[[Moment], Torques], drive: FlipperDrive) -> list[Row]:
    """Return what the drives measure during these motions: k_t I = J ω' - gravity - load + friction."""
    rows, mass = [], drive.mass
    for moment in moments:
        _, _, sweep_rad, lift_rad, sweep_rad_s, lift_rad_s, sweep_rad_s2, lift_rad_s2 = moment
        load_nm, gravity_nm = mud_nm(moment), mass.gravity_torques_nm(sweep_rad, lift_rad)
        sweep_nm = mass.sweep_inertia_kg_m2 * sweep_rad_s2 - gravity_nm[0] - load_nm[0]
        lift_nm = mass.adduction_inertia_kg_m2 * lift_rad_s2 - gravity_nm[1] - load_nm[1]
        sweep_a = (sweep_nm + drive.sweep_friction.torque_nm(sweep_rad, sweep_rad_s)) / drive.sweep_constant_nm_a
        lift_a = (lift_nm + drive.adduction_friction.torque_nm(lift_rad, lift_rad_s)) / drive.adduction_constant_nm_a
        rows.append(moment.measured(sweep_a, lift_a))
    return rows


def noisy(rows: Sequence[Row], seed: int, noise_a: float) -> list[Row]:
    random = Random(seed)
    return [row.pushed(random.gauss(0.0, noise_a), random.gauss(0.0, noise_a)) for row in rows]


def update(flipper: StrideEstimator, *sample: Any) -> tuple[FlipperLoad, StrideEstimate | None]:
    """Add a sample to one flipper and finish all the work that it causes."""
    load, closing = flipper.add(*sample)
    if not flipper.work.is_empty:
        flipper.work.finish()
        load = flipper.load
    return load, None if closing is None else finish(closing)


def strides_of(rows: Iterable[Row], flipper: StrideEstimator) -> list[StrideEstimate]:
    strides = [update(flipper, *row)[1] for row in rows]
    return [stride for stride in strides if stride is not None]


# a stride for the tests of what uses an estimator

SURFACE_M = 0.002
K_P, K_S, K_E = 1.0e6, 0.6e6, 0.7e6  # N/m³, about the paper's middle mud
DRIVE = FlipperDrive(ArmMass(), 0.083, 0.083)


def mud_torques_nm(moment: Moment) -> Torques:
    """Return k_p Φ, k_s Ψ with the cross-coupling of the plate's face, and k_e Φ."""
    plate = submerged_plate(GEOMETRY, moment.sweep_rad, moment.adduction_rad, SURFACE_M)
    if moment.phase is Phase.STANCE:
        sweep_nm = K_S * stance_moment_m4(GEOMETRY, plate)
        return sweep_nm, cross_coupling(GEOMETRY, plate, moment.sweep_rad) * sweep_nm
    k = {Phase.INSERTION: K_P, Phase.EXTRACTION: -K_E}.get(moment.phase, 0.0)
    return 0.0, k * stroke_moment_m4(GEOMETRY, plate, moment.sweep_rad)


def stride_samples(seed: int = 1) -> list[Row]:
    return noisy(loaded(walked(), mud_torques_nm, DRIVE), seed, 0.1)
