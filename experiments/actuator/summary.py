"""The summary of an actuator calibration, for programs: the constants of each joint, and the readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

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
class LeftOut:
    """A reading that was skipped, or kept as doubtful and not fitted."""

    joint: str
    trial: int
    weight_g: float
    why: str


PAPER = {
    "rmse_nm": PAPER_RMSE_NM,
    "repeatability": PAPER_REPEATABILITY,
    "torque_constant_nm_a": PAPER_CONSTANT_NM_A,
}


@dataclass(frozen=True)
class ActuatorReport:
    plan: Plan
    joints: Sequence[Mapping[str, Any]]  # of the fits
    not_fitted: Sequence[str]
    left_out: Sequence[LeftOut]
    readings: Mapping[str, Mapping[str, Entry]]
    applied: str | None  # a message on the configuration file
    paper: Mapping[str, Any] = field(default_factory=lambda: PAPER)
    experiment: str = "actuator"


def make_report(
    plan: Plan, readings: Mapping[str, Mapping[str, Entry]], fits: Sequence[JointFit], applied: str | None = None
) -> ActuatorReport:
    fitted = {fit.joint for fit in fits}
    return ActuatorReport(
        plan=plan,
        joints=[_joint_entries(fit) for fit in fits],
        not_fitted=[joint for joint in plan.joints if joint not in fitted],
        left_out=list_left_out(plan, readings),
        readings=readings,
        applied=applied,
    )


def _joint_entries(fit: JointFit) -> dict[str, Any]:
    """Name the constants of one joint for programs; NaN where they are unknown."""
    return {
        "joint": fit.joint,
        "readings": fit.line.readings,
        "direction": fit.direction,
        "torque_constant_nm_a": fit.constant_nm_a,
        "torque_constant_error_nm_a": fit.constant_error_nm_a,
        "torque_constant_scatter_nm_a": fit.line.constant_error_nm_a,
        "torque_constant_tolerance_nm_a": fit.torque_error * fit.constant_nm_a,
        "configured_nm_a": fit.configured_nm_a,
        "rmse_configured_nm": fit.rmse_configured_nm,
        "rmse_fitted_nm": fit.rmse_fitted_nm,
        "paper_rmse_nm": paper_rmse_nm(fit.joint),
        "repeatability": fit.repeatability,
        "offset_nm": fit.offset_nm,
        "offset_error_nm": fit.offset_error_nm,
        "friction_nm": fit.friction_nm[0],
        "friction_error_nm": fit.friction_nm[1],
        "viscous_nm_s": fit.viscous_nm_s[0],
        "viscous_error_nm_s": fit.viscous_nm_s[1],
        "rest_friction_nm": fit.rest_friction_a * fit.constant_nm_a,
        "tare_nm": fit.tare_nm,
        "tare_spread_nm": fit.tare_spread_nm,
    }


def list_left_out(plan: Plan, readings: Mapping[str, Mapping[str, Entry]]) -> list[LeftOut]:
    return [
        LeftOut(joint, step.trial, step.weight_g, why)
        for joint, entries in readings.items()
        for step in steps_of(plan)
        if (why := entries.get(step.key, {}).get("skipped") or entries.get(step.key, {}).get("doubt"))
    ]
