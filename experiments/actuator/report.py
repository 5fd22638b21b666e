"""The report of the actuator calibration: the paper's figure 3 and its numbers next to ours, and what to set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import degrees, isfinite, nan
from statistics import fmean, stdev

from experiments.actuator.fit import (
    PAPER_CONSTANT_NM_A,
    PAPER_REPEATABILITY,
    PAPER_RMSE_NM,
    Entry,
    JointFit,
    repeatability,
)
from experiments.actuator.friction import SWING_RAD
from experiments.actuator.plan import Plan
from experiments.actuator.plots import plot_errors, plot_friction, plot_torques
from experiments.actuator.summary import list_left_out
from experiments.reports.report_page import Figure, Section
from experiments.reports.text_tables import Rows, TitledRows
from experiments.reports.value_text import fraction_text, value_text

TITLE = "Actuator calibration"
CONSTANTS = "Torque constants ± one standard error; RMSE and repeatability by the paper's definitions"
FRICTION = "Friction and offset ± one standard error"

METHOD = """\
A motor holds the flipper level while calibration weights hang on it (the paper's section II-B). A trial is one pass
through all weights, each of which is hung again; the empty arm is read before and after each pass, as the tare.
The held angle is raised until the loaded arm itself is level, so that every weight has the same lever and meets the
same cogging of the magnets. The level is approached from below and from above: the mean of the two currents is the
load.

The line is current on torque, since the weights are known better than the currents: k_t is one over its slope.
Friction is the work of the empty arm's current over loops of {swing_deg:.0f} degrees to either side, in which weight,
magnets and inertia do no net work. Slow and quick loops separate dry from viscous friction. Half the difference between
the two approaches at rest is less ("at rest at least"): a held joint comes to rest before friction reaches its maximum.

± is one standard error; the true value is within two of them in about 19 of 20 calibrations. That of k_t is from the
scatter of the readings and from errors that are alike in all of them: the lever, by at most {lever_mm:g} mm, and the
weights, by at most {weight_percent:g} % (--lever-tolerance, --weight-tolerance). A millimetre of {lever_cm:g} cm is
{millimetre_percent:.1f} % of k_t. That of the offset includes the tare's scatter and the friction at rest."""

DEFINITIONS = """\
RMSE is by the paper's definition: the root mean square of k_t I - m g l over all readings, with the constant as it is
configured (the paper's is its manufacturer's) and nothing fitted. Compare it with the paper's 0.0134 and
0.0127, printed there as N/m (section III-A). The paper does not say whether it subtracted the weight of the arm;
here it is subtracted. "RMSE fitted" is stricter and not in the paper: each trial by the constant that the other trials
gave (a single trial by its own). Set that constant, repeat the experiment, and the first will be what the second is.

Repeatability is the paper's as we read it: the standard deviation over the trials of a weight, relative to their mean,
averaged over the weights. The paper gives one number for both joints. The lightest weights make nearly all of it, as
the tables by weight show."""

SETTING = """\
The constant is set in two files, and both must agree. torque_constant_nm_a of [drive.JOINT] in the
configuration turns the current that the drive reports into torque: every force and coefficient is proportional to it.
odrv0.axis0.config.motor.torque_constant in the drive (over USB with odrivetool, then save_configuration) turns the
torque that is commanded into current. The reported current itself does not depend on either. While only one of them
is set, the robot measures forces correctly and applies wrong ones, or the other way round.

60/(2π KV) = 0.083 N·m/A for 115 rpm/V is the constant of a motor whose current is counted as direct current. ODrive
counts the peak of the phase current, for which the same motor gives 8.27/KV = 0.0719. This
experiment shows which of them is true for these drives."""


def make_sections(plan: Plan, readings: Mapping[str, Mapping[str, Entry]], fits: Sequence[JointFit]) -> list[Section]:
    sections = []
    if fits:
        sections.append(Section("Torque constants", DEFINITIONS, rows=constant_rows(fits), figures=_figures(fits)))
        figures = _friction_figures(fits)
        sections.append(Section("Friction and offset", rows=friction_rows(fits), figures=figures))
    sections += [Section(f"Weights on {fit.joint}", rows=_weight_rows(fit)) for fit in fits]
    omitted = list_left_out(plan, readings)
    if omitted:
        rows = [[row.joint, str(row.trial), f"{row.weight_g:g} g", row.why] for row in omitted]
        sections.append(Section("Left out", rows=[["joint", "trial", "weight", "why"], *rows]))
    return [*sections, Section("What to set where", SETTING), Section("How it was measured", _method(plan))]


def _method(plan: Plan) -> str:
    return METHOD.format(
        swing_deg=degrees(SWING_RAD),
        lever_mm=1000.0 * plan.lever_tolerance_m,
        weight_percent=100.0 * plan.weight_tolerance,
        lever_cm=100.0 * plan.lever_m,
        millimetre_percent=0.1 / plan.lever_m,
    )


def constant_rows(fits: Sequence[JointFit]) -> Rows:
    """List one line per joint, and the paper's numbers last."""
    head = [
        "joint",
        "k_t (N·m/A)",
        "configured (N·m/A)",
        "RMSE (N·m)",
        "RMSE fitted (N·m)",
        "repeatability",
        "readings",
    ]
    rows = [
        [
            fit.joint,
            value_text(fit.constant_nm_a, fit.constant_error_nm_a),
            f"{fit.configured_nm_a:g}",
            f"{fit.rmse_configured_nm:.4f}",
            f"{fit.rmse_fitted_nm:.4f}",
            fraction_text(fit.repeatability),
            str(fit.line.readings),
        ]
        for fit in fits
    ]
    paper = [
        [f"paper, {kind}", "-", f"{PAPER_CONSTANT_NM_A:g}", f"{rmse_nm:.4f}", "-", fraction_text(PAPER_REPEATABILITY)]
        for kind, rmse_nm in PAPER_RMSE_NM.items()
    ]
    return [head, *rows, *([*row, "-"] for row in paper)]


def friction_rows(fits: Sequence[JointFit]) -> Rows:
    head = [
        "joint",
        "dry friction (N·m)",
        "viscous (N·m·s)",
        "at rest at least (N·m)",
        "offset (N·m)",
        "empty arm (N·m)",
    ]
    rows = [
        [
            fit.joint,
            value_text(*fit.friction_nm),
            value_text(*fit.viscous_nm_s),
            f"{fit.rest_friction_a * fit.constant_nm_a:.4f}",
            value_text(fit.offset_nm, fit.offset_error_nm),
            value_text(fit.tare_nm, fit.tare_spread_nm),
        ]
        for fit in fits
    ]
    return [head, *rows]


def _weight_rows(fit: JointFit) -> Rows:
    head = [
        "weight",
        "trials",
        "τ_ext (N·m)",
        "τ_sense configured (N·m)",
        "τ_sense fitted (N·m)",
        "error fitted (mN·m)",
        "spread fitted (mN·m)",
        "repeatability",
    ]
    rows = []
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
    return [head, *rows]


def _figures(fits: Sequence[JointFit]) -> list[Figure]:
    return [
        Figure(
            "torques",
            "Torque by the motor's current against the weights' own, as in the paper's figure 3: with the configured"
            " and with the fitted constant. Grey: where both are equal, give or take the paper's RMSE.",
            partial(plot_torques, fits),
        ),
        Figure(
            "errors",
            "Errors of the torque by the fitted constant, each trial by the constant of the others; the bar is the"
            " mean of the trials. Grey band: the paper's RMSE, which is that of its configured constant.",
            partial(plot_errors, fits),
        ),
    ]


def _friction_figures(fits: Sequence[JointFit]) -> list[Figure]:
    """Return no figure for readings without loops."""
    if not all(fit.loops for fit in fits):
        return []
    return [
        Figure(
            "friction",
            "Torque of friction on loops of the empty arm at two speeds:"
            " each loop, and the line whose height at zero is dry friction and whose slope is viscous. Dotted: what"
            " acts at rest. The paper neglects friction.",
            partial(plot_friction, fits),
        )
    ]


def make_tables(fits: Sequence[JointFit]) -> list[TitledRows]:
    return [(CONSTANTS, constant_rows(fits)), (FRICTION, friction_rows(fits))]
