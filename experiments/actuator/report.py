"""The report of the actuator calibration, for programs and for people: the paper's numbers next to ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import isfinite, nan
from statistics import fmean, stdev
from typing import Any

from experiments.actuator.fit import (
    PAPER_CONSTANT_NM_A,
    PAPER_REPEATABILITY,
    PAPER_RMSE_NM,
    Entry,
    JointFit,
    paper_rmse_nm,
    repeatability,
)
from experiments.actuator.plan import Plan, steps_of
from experiments.actuator.plots import plot_friction, plot_torques
from experiments.reports.report_page import Figure, Section
from experiments.reports.text_tables import Rows, TitledRows
from experiments.reports.value_text import fraction_text, value_text

Readings = Mapping[str, Mapping[str, Entry]]  # by joint and step
TITLE = "Actuator calibration"
CONSTANTS = "Torque constants ± one standard error; RMSE and repeatability by the paper's definitions"
FRICTION = "Friction and offset ± one standard error"

METHOD = (
    "A motor holds the flipper level while calibration weights hang on it (the paper's section II-B). A trial is one "
    "pass through all weights, with the empty arm before and after it as the tare. The mean of two approaches, from "
    "below and from above, is the load; k_t is one over the slope of current over torque. Friction is the work of the "
    "current over loops of the empty arm; half the difference between the approaches at rest is less. "
    "docs/how-to/bench.md explains the measurement.\n\n"
    "± is one standard error. That of k_t is from the scatter of the readings and from errors that are alike in all of "
    "them: the lever, by at most {lever_mm:g} mm, and the weights, by at most {weight_percent:g} % (--lever-tolerance, "
    "--weight-tolerance). A millimetre of {lever_cm:g} cm is {millimetre_percent:.1f} % of k_t."
)
DEFINITIONS = (
    "RMSE is by the paper's definition: the root mean square of k_t I - m g l over all readings, with the constant as "
    "it is configured and nothing fitted; the weight of the arm is subtracted. Compare it with the paper's 0.0134 and "
    '0.0127, printed there as N/m (section III-A). "RMSE fitted" takes each trial by the constant that the other '
    "trials gave.\n\n"
    "Repeatability is the standard deviation over the trials of a weight, relative to their mean, averaged over the "
    "weights. The lightest weights make nearly all of it, as the tables by weight show."
)
SETTING = (
    "The constant is set in two files, and both must agree. torque_constant_nm_a of [drive.JOINT] in the configuration "
    "turns the reported current into torque. odrv0.axis0.config.motor.torque_constant in the drive (over USB with "
    "odrivetool, then save_configuration) turns the commanded torque into current.\n\n"
    "60/(2π KV) = 0.083 N·m/A for 115 rpm/V is the constant of a motor whose current is counted as direct current. "
    "ODrive counts the peak of the phase current, for which the same motor gives 8.27/KV = 0.0719. This experiment "
    "shows which of them is true for these drives."
)


@dataclass(frozen=True)
class LeftOut:
    """A reading that was skipped, or kept as doubtful and not fitted."""

    joint: str
    trial: int
    weight_g: float
    why: str


@dataclass(frozen=True)
class ActuatorReport:
    plan: Plan
    joints: Sequence[Mapping[str, Any]]  # of the fits
    not_fitted: Sequence[str]
    left_out: Sequence[LeftOut]
    readings: Readings
    applied: str | None  # a message on the configuration file
    paper: Mapping[str, Any] = field(
        default_factory=lambda: {
            "rmse_nm": PAPER_RMSE_NM,
            "repeatability": PAPER_REPEATABILITY,
            "torque_constant_nm_a": PAPER_CONSTANT_NM_A,
        }
    )
    experiment: str = "actuator"


def make_report(plan: Plan, readings: Readings, fits: Sequence[JointFit], applied: str | None = None) -> ActuatorReport:
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


def list_left_out(plan: Plan, readings: Readings) -> list[LeftOut]:
    return [
        LeftOut(joint, step.trial, step.weight_g, why)
        for joint, entries in readings.items()
        for step in steps_of(plan)
        if (why := entries.get(step.key, {}).get("skipped") or entries.get(step.key, {}).get("doubt"))
    ]


def make_sections(plan: Plan, readings: Readings, fits: Sequence[JointFit]) -> list[Section]:
    sections = []
    if fits:
        sections.append(
            Section("Torque constants", DEFINITIONS, rows=constant_rows(fits), figures=[_torque_figure(fits)])
        )
        figures = _friction_figures(fits)
        sections.append(Section("Friction and offset", rows=friction_rows(fits), figures=figures))
    sections += [Section(f"Weights on {fit.joint}", rows=_weight_rows(fit)) for fit in fits]
    omitted = list_left_out(plan, readings)
    if omitted:
        rows = [[row.joint, str(row.trial), f"{row.weight_g:g} g", row.why] for row in omitted]
        sections.append(Section("Left out", rows=[["joint", "trial", "weight", "why"], *rows]))
    method = METHOD.format(
        lever_mm=1000.0 * plan.lever_tolerance_m,
        weight_percent=100.0 * plan.weight_tolerance,
        lever_cm=100.0 * plan.lever_m,
        millimetre_percent=0.1 / plan.lever_m,
    )
    return [*sections, Section("What to set where", SETTING), Section("How it was measured", method)]


def constant_rows(fits: Sequence[JointFit]) -> Rows:
    """List one line per joint, and the paper's numbers last."""
    errors = ("RMSE (N·m)", "RMSE fitted (N·m)")
    rows = [["joint", "k_t (N·m/A)", "configured (N·m/A)", *errors, "repeatability", "readings"]]
    for fit in fits:
        constant = value_text(fit.constant_nm_a, fit.constant_error_nm_a)
        rmse = (f"{fit.rmse_configured_nm:.4f}", f"{fit.rmse_fitted_nm:.4f}")
        count = str(fit.line.readings)
        rows.append([fit.joint, constant, f"{fit.configured_nm_a:g}", *rmse, fraction_text(fit.repeatability), count])
    for kind, rmse_nm in PAPER_RMSE_NM.items():
        known = [f"{PAPER_CONSTANT_NM_A:g}", f"{rmse_nm:.4f}", "-", fraction_text(PAPER_REPEATABILITY)]
        rows.append([f"paper, {kind}", "-", *known, "-"])
    return rows


def friction_rows(fits: Sequence[JointFit]) -> Rows:
    kinds = ("dry friction (N·m)", "viscous (N·m·s)", "at rest at least (N·m)")
    rows = [["joint", *kinds, "offset (N·m)", "empty arm (N·m)"]]
    for fit in fits:
        at_rest = f"{fit.rest_friction_a * fit.constant_nm_a:.4f}"
        others = (value_text(fit.offset_nm, fit.offset_error_nm), value_text(fit.tare_nm, fit.tare_spread_nm))
        rows.append([fit.joint, value_text(*fit.friction_nm), value_text(*fit.viscous_nm_s), at_rest, *others])
    return rows


def _weight_rows(fit: JointFit) -> Rows:
    sensed = ("τ_sense configured (N·m)", "τ_sense fitted (N·m)", "error fitted (mN·m)", "spread fitted (mN·m)")
    rows = [["weight", "trials", "τ_ext (N·m)", *sensed, "repeatability"]]
    for weight_g in sorted({load.weight_g for load in fit.loads}):
        loads = [load for load in fit.loads if load.weight_g == weight_g]
        external_nm = fmean(load.torque_nm for load in loads)
        configured_nm = fit.configured_nm_a * fmean(load.current_a for load in loads)
        fitted_nm = fmean(fit.fitted_nm(load) for load in loads)
        spread_nm = fit.constant_nm_a * stdev(load.current_a for load in loads) if len(loads) > 1 else nan
        torques = (f"{each:.4f}" for each in (external_nm, configured_nm, fitted_nm))
        error_mnm = round(1e3 * (fitted_nm - external_nm), 1) + 0.0  # without a minus before zero
        spread = [f"{1e3 * spread_nm:.1f}" if isfinite(spread_nm) else "-", fraction_text(repeatability(loads))]
        rows.append([f"{weight_g:g} g", str(len(loads)), *torques, f"{error_mnm:+.1f}", *spread])
    return rows


def _torque_figure(fits: Sequence[JointFit]) -> Figure:
    caption = (
        "Torque by the motor's current against the weights' own, as in the paper's figure 3: with the configured and "
        "with the fitted constant. Grey: where both are equal, give or take the paper's RMSE."
    )
    return Figure("torques", caption, partial(plot_torques, fits))


def _friction_figures(fits: Sequence[JointFit]) -> list[Figure]:
    """Return no figure for readings without loops."""
    caption = (
        "Torque of friction on loops of the empty arm at two speeds: each loop, and the line whose height at zero is "
        "dry friction and whose slope is viscous. Dotted: what acts at rest. The paper neglects friction."
    )
    return [Figure("friction", caption, partial(plot_friction, fits))] * all(fit.loops for fit in fits)


def make_tables(fits: Sequence[JointFit]) -> list[TitledRows]:
    return [(CONSTANTS, constant_rows(fits)), (FRICTION, friction_rows(fits))]
