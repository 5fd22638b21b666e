"""The summary of an actuator calibration, for programs: the constants of each joint, and the readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from experiments.actuator.fit import (
    PAPER_CONSTANT_NM_A,
    PAPER_REPEATABILITY,
    PAPER_RMSE_NM,
    Entry,
    JointFit,
    paper_rmse_nm,
)
from experiments.actuator.plan import Plan, steps_of


@dataclass(frozen=True)
class JointReport:
    """The constants of one joint; NaN where they are unknown."""

    joint: str
    readings: int
    direction: int
    torque_constant_nm_a: float
    torque_constant_error_nm_a: float
    torque_constant_scatter_nm_a: float
    torque_constant_tolerance_nm_a: float
    configured_nm_a: float
    rmse_configured_nm: float
    rmse_fitted_nm: float
    paper_rmse_nm: float
    repeatability: float
    offset_nm: float
    offset_error_nm: float
    friction_nm: float
    friction_error_nm: float
    viscous_nm_s: float
    viscous_error_nm_s: float
    rest_friction_nm: float
    tare_nm: float
    tare_spread_nm: float


@dataclass(frozen=True)
class LeftOut:
    """A reading that was skipped, or kept as doubtful and not fitted."""

    joint: str
    trial: int
    weight_g: float
    why: str


@dataclass(frozen=True)
class PaperNumbers:
    rmse_nm: Mapping[str, float]
    repeatability: float
    torque_constant_nm_a: float


@dataclass(frozen=True)
class ActuatorReport:
    plan: Plan
    joints: Sequence[JointReport]
    not_fitted: Sequence[str]
    left_out: Sequence[LeftOut]
    readings: Mapping[str, Mapping[str, Entry]]
    applied: str | None  # a message on the configuration file
    paper: PaperNumbers = PaperNumbers(PAPER_RMSE_NM, PAPER_REPEATABILITY, PAPER_CONSTANT_NM_A)
    experiment: str = "actuator"


def make_report(
    plan: Plan, readings: Mapping[str, Mapping[str, Entry]], fits: Sequence[JointFit], applied: str | None = None
) -> ActuatorReport:
    fitted = {fit.joint for fit in fits}
    return ActuatorReport(
        plan=plan,
        joints=[_joint_report(fit) for fit in fits],
        not_fitted=[joint for joint in plan.joints if joint not in fitted],
        left_out=list_left_out(plan, readings),
        readings=readings,
        applied=applied,
    )


def _joint_report(fit: JointFit) -> JointReport:
    return JointReport(
        joint=fit.joint,
        readings=fit.line.readings,
        direction=fit.direction,
        torque_constant_nm_a=fit.constant_nm_a,
        torque_constant_error_nm_a=fit.constant_error_nm_a,
        torque_constant_scatter_nm_a=fit.line.constant_error_nm_a,
        torque_constant_tolerance_nm_a=fit.torque_error * fit.constant_nm_a,
        configured_nm_a=fit.configured_nm_a,
        rmse_configured_nm=fit.rmse_configured_nm,
        rmse_fitted_nm=fit.rmse_fitted_nm,
        paper_rmse_nm=paper_rmse_nm(fit.joint),
        repeatability=fit.repeatability,
        offset_nm=fit.offset_nm,
        offset_error_nm=fit.offset_error_nm,
        friction_nm=fit.friction_nm[0],
        friction_error_nm=fit.friction_nm[1],
        viscous_nm_s=fit.viscous_nm_s[0],
        viscous_error_nm_s=fit.viscous_nm_s[1],
        rest_friction_nm=fit.rest_friction_a * fit.constant_nm_a,
        tare_nm=fit.tare_nm,
        tare_spread_nm=fit.tare_spread_nm,
    )


def list_left_out(plan: Plan, readings: Mapping[str, Mapping[str, Entry]]) -> list[LeftOut]:
    return [
        LeftOut(joint, step.trial, step.weight_g, why)
        for joint, entries in readings.items()
        for step in steps_of(plan)
        if (why := entries.get(step.key, {}).get("skipped") or entries.get(step.key, {}).get("doubt"))
    ]
