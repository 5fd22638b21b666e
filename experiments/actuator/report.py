"""The report of the actuator calibration, for programs and for people: the paper's numbers next to ours."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from pandas import DataFrame

from experiments.actuator.fit import (
    PAPER_CONSTANT_NM_A,
    PAPER_REPEATABILITY,
    PAPER_RMSE_NM,
    JointFit,
    repeatability,
)
from experiments.actuator.plan import WeighingPlan, steps_of
from experiments.actuator.plots import draw_friction, draw_torques
from experiments.actuator.simulation import truth_rows
from experiments.reports.text_tables import number
from experiments.reports.value_text import fraction_text, miss_text, value_text
from experiments.study.notebook import Entry
from experiments.study.result import Figure, Result, Table

Readings = Mapping[str, Mapping[str, Entry]]  # by joint and step
TITLE = "Actuator calibration"
CONSTANTS, FRICTION, TRUTH = "Torque constants", "Friction and offset", "The simulated motors themselves"
CONSTANTS_HEADING = "Torque constants ± one standard error; RMSE and repeatability by the paper's definitions"
FRICTION_COLUMNS = {  # values with their errors, by their keys in JSON
    "dry friction": ("friction_nm", "friction_error_nm"),
    "viscous": ("viscous_nm_s", "viscous_error_nm_s"),
    "at rest at least": ("rest_friction_nm",),
    "offset": ("offset_nm", "offset_error_nm"),
    "empty arm": ("tare_nm", "tare_error_nm"),
    "swinging": ("lifted_nm",),
}
FRICTION_HEADING = "Friction and offset ± one standard error"

TORQUES = (
    "Torque by the motor's current against the weights' own, as in the paper's figure 3: with the configured and with "
    "the fitted constant. Grey: where both are equal, give or take the paper's RMSE."
)
LOOPS = (
    "Torque of friction on loops of the empty arm at two speeds: each loop, and the line whose height at zero is dry "
    "friction and whose slope is viscous. Dotted: what acts at rest. The paper neglects friction."
)
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
    "trials gave, and a single trial by its own.\n\n"
    "Repeatability is the standard deviation over the trials of a weight, relative to their mean, averaged over the "
    "weights. The lightest weights make nearly all of it, as the tables by weight show."
)
SETTING = (
    "The constant is set in two files, and both must agree. torque_constant_nm_a of [drive.JOINT] in the configuration "
    "turns the reported current into torque. The drive's own constant turns the commanded torque into current; "
    "'mudskipper drives setup' compares both where the drive lets its own be read.\n\n"
    "60/(2π KV) = 0.083 N·m/A for 115 rpm/V is the constant of a motor whose current is counted as direct current. "
    "ODrive counts the peak of the phase current, for which the same motor gives 8.27/KV = 0.0719. This experiment "
    "shows which of them is true for these drives."
)


PAPER = {
    "rmse_nm": PAPER_RMSE_NM,
    "repeatability": PAPER_REPEATABILITY,
    "torque_constant_nm_a": PAPER_CONSTANT_NM_A,
}


def make_result(
    plan: WeighingPlan, readings: Readings, fits: Sequence[JointFit], applied: str | None, simulated: bool
) -> Result:
    """Return tables, figures and numbers. `applied` is a message on the configuration file."""
    left_out = [  # skipped, or kept as doubtful and not fitted
        {"joint": joint, "trial": step.trial, "weight_g": step.weight_g, "why": why}
        for joint, entries in readings.items()
        for step in steps_of(plan)
        if (why := entries.get(step.key, {}).get("skipped") or entries.get(step.key, {}).get("doubt"))
    ]
    tables = _tables(fits, left_out, simulated)
    method = METHOD.format(
        lever_mm=1000.0 * plan.lever_tolerance_m,
        weight_percent=100.0 * plan.weight_tolerance,
        lever_cm=100.0 * plan.lever_m,
        millimetre_percent=0.1 / plan.lever_m,
    )
    fitted = [fit.numbers["joint"] for fit in fits]
    not_fitted = [joint for joint in plan.joints if joint not in fitted]
    texts = {CONSTANTS: DEFINITIONS, **{table.section: "" for table in tables[1:]}}
    return Result(
        tables=tables,
        figures=_figures(fits),
        summary={
            "plan": plan,
            "joints": [fit.numbers for fit in fits],
            "not_fitted": not_fitted,
            "left_out": left_out,
            "readings": readings,
            "applied": applied,
            "paper": PAPER,
        },
        title=TITLE,
        texts=texts | {"What to set where": SETTING, "How it was measured": method},
        notes=[*_remarks(fits, not_fitted, len(left_out)), *filter(None, [applied])],
    )


def _tables(fits: Sequence[JointFit], left_out: Sequence[Mapping[str, Any]], simulated: bool) -> list[Table]:
    tables = [_constant_table(fits), _friction_table(fits)]
    if simulated:
        tables.append(Table("truth", TRUTH, {}, DataFrame(truth_rows(fits)), TRUTH))
    for fit in fits:
        section = f"Weights on {fit.numbers['joint']}"
        tables.append(Table(section, "", {}, _weight_rows(fit), section, on_page_only=True))
    if left_out:
        tables.append(Table("left_out", "", {}, DataFrame(left_out), "Left out", on_page_only=True))
    return tables


def _figures(fits: Sequence[JointFit]) -> list[Figure]:
    if not fits:
        return []
    figures = [Figure("torques", TORQUES, partial(draw_torques, fits), CONSTANTS)]
    if all(fit.loops for fit in fits):
        figures.append(Figure("friction", LOOPS, partial(draw_friction, fits), FRICTION))
    return figures


def _remarks(fits: Sequence[JointFit], not_fitted: Sequence[str], left_out: int) -> Iterator[str]:
    for joint in not_fitted:
        yield f"{joint}: too few readings for a line"
    for joint, direction in ((fit.numbers["joint"], fit.numbers["direction"]) for fit in fits):
        if direction > 0 and joint.endswith("adduction"):
            yield f"{joint}: by the sign of the current the weights pull upwards: check drive.{joint}.sign"
    if left_out:
        yield f"{left_out} readings are left out: see the report"


def _constant_table(fits: Sequence[JointFit]) -> Table:
    """Return one line per joint, and the paper's numbers last."""
    rows = [
        {
            "joint": numbers["joint"],
            "k_t": value_text(numbers["torque_constant_nm_a"], numbers["torque_constant_error_nm_a"]),
            "configured": f"{numbers['configured_nm_a']:g}",
            "k_t from it": miss_text(numbers["torque_constant_nm_a"], numbers["configured_nm_a"]),
            "RMSE": f"{numbers['rmse_configured_nm']:.4f}",
            "RMSE fitted": f"{numbers['rmse_fitted_nm']:.4f}",
            "repeatability": fraction_text(numbers["repeatability"]),
            "readings": numbers["readings"],
        }
        for numbers, *_ in fits
    ]
    rows += [
        {
            "joint": f"paper, {kind}",
            "configured": f"{PAPER_CONSTANT_NM_A:g}",
            "RMSE": f"{rmse_nm:.4f}",
            "repeatability": fraction_text(PAPER_REPEATABILITY),
        }
        for kind, rmse_nm in PAPER_RMSE_NM.items()
    ]
    units = {"k_t": "N·m/A", "configured": "N·m/A", "RMSE": "N·m", "RMSE fitted": "N·m"}
    return Table("constants", CONSTANTS_HEADING, units, DataFrame(rows).astype(object).fillna("-"), CONSTANTS)


def _friction_table(fits: Sequence[JointFit]) -> Table:
    rows = [
        {"joint": numbers["joint"]}
        | {head: value_text(*(numbers[name] for name in names)) for head, names in FRICTION_COLUMNS.items()}
        for numbers, *_ in fits
    ]
    units = dict.fromkeys(FRICTION_COLUMNS, "N·m") | {"viscous": "N·m·s"}
    return Table("friction", FRICTION_HEADING, units, DataFrame(rows), FRICTION)


def _weight_rows(fit: JointFit) -> DataFrame:
    """Return a row for each weight, averaged over the trials."""
    numbers, by_weight = fit.numbers, fit.loads.groupby("weight_g")
    mean = by_weight.mean()
    spread_nm = numbers["torque_constant_nm_a"] * by_weight.current_a.std()
    return DataFrame(
        {
            "weight": [f"{weight_g:g} g" for weight_g in mean.index],
            "trials": by_weight.size().to_list(),
            "τ_ext (N·m)": [f"{nm:.4f}" for nm in mean.torque_nm],
            "τ_sense configured (N·m)": [f"{numbers['configured_nm_a'] * a:.4f}" for a in mean.current_a],
            "τ_sense fitted (N·m)": [f"{nm:.4f}" for nm in mean.fitted_nm],
            "error fitted (mN·m)": [f"{1e3 * nm:+z.1f}" for nm in mean.fitted_nm - mean.torque_nm],
            "spread fitted (mN·m)": [number(1e3 * nm, 1) for nm in spread_nm],
            "repeatability": [fraction_text(repeatability(loads)) for _, loads in by_weight],
        }
    )
