"""The tables of a report about runs, as rows of text with the head first."""

from collections.abc import Mapping, Sequence
from math import isfinite, nan

from experiments.pictures.stride_choice import Outcome
from experiments.reports.coefficient_table import GatheredCoefficient
from experiments.reports.error_table import COEFFICIENTS
from experiments.reports.text_tables import number
from experiments.reports.value_text import N_CM3, value_text
from experiments.run_report.comparison import SPEED, ComparedRun, Difference, flipper_difference
from experiments.run_report.event_groups import EventGroup
from experiments.run_report.fit_quality import N_CM
from experiments.run_report.headline import Headline, reaction_of
from experiments.run_report.mud_results import MudResult, Speed, estimate_of_row
from experiments.run_report.run import ReportedStride, Run
from logs.fault_history import LoggedCause

Table = list[list[str]]
CM = 0.01  # in metres
OUTCOMES = (Outcome.GOOD, Outcome.SLIPPING, Outcome.STUCK)
COUNTED = "good / slipped / stuck"
MUD_HEAD = ["strides", COUNTED, "distance (m)", "speed (cm/s)", "depth (cm)"]
COEFFICIENT_HEAD = [f"{name} (N/cm³)" for name in COEFFICIENTS]


def coefficient_cell(gathered: GatheredCoefficient) -> str:
    """Format in N/cm³ with the whole standard error; ≥ marks a lower bound."""
    if gathered.value is None:
        return "-"
    if gathered.at_least:
        return f"≥ {gathered.value / N_CM3:#.2g}"
    return value_text(gathered.value, gathered.std_error, per=N_CM3)


def counts_cell(outcomes: Mapping[str, int]) -> str:
    known = " / ".join(str(outcomes[outcome]) for outcome in OUTCOMES)
    unknown = outcomes[Outcome.UNKNOWN]
    if unknown and not sum(outcomes[outcome] for outcome in OUTCOMES):
        return "-"
    return f"{known} ({unknown} unknown)" if unknown else known


def motion_cells(motion: Speed) -> list[str]:
    return [number(motion.distance_m, 2), value_text(motion.speed_m_s, motion.speed_std_error_m_s, per=CM)]


def mud_cells(result: MudResult) -> list[str]:
    depths_cm = [number(depth_m / CM, 1) for depth_m in (result.shallowest_m, result.deepest_m)]
    depth = " to ".join(dict.fromkeys(depths_cm))
    coefficients = [coefficient_cell(result.both[name]) for name in COEFFICIENTS]
    return [str(result.strides), counts_cell(result.outcomes), *motion_cells(result.motion), depth, *coefficients]


def mud_rows(headline: Headline) -> Table:
    return [["mud", *MUD_HEAD, *COEFFICIENT_HEAD], *([result.mud, *mud_cells(result)] for result in headline.muds)]


def flipper_rows(headline: Headline) -> Table:
    rows = [["mud", "", "left (N/cm³)", "right (N/cm³)", "right - left"]]
    for result in headline.muds:
        for name in COEFFICIENTS:
            left, right = (result.flippers[flipper][name] for flipper in ("left", "right"))
            difference = value_text(*flipper_difference(left, right), per=N_CM3)
            mud = result.mud if name == COEFFICIENTS[0] else ""
            rows.append([mud, name, coefficient_cell(left), coefficient_cell(right), difference])
    return rows


def cause_rows(causes: Sequence[LoggedCause], begin_s: float) -> Table:
    head = ["first at (s)", "times", "cause", "parts", "reaction", "consequences", "what to do"]
    return [head, *(_cause_row(cause, begin_s) for cause in causes)]


def _cause_row(cause: LoggedCause, begin_s: float) -> list[str]:
    return [
        f"{cause.first_s - begin_s:.2f}",
        str(cause.times),
        cause.message,
        ", ".join(cause.subjects),
        reaction_of(cause).name.lower().replace("_", " "),
        ", ".join(cause.consequences),
        cause.what_to_do,
    ]


def event_rows(groups: Sequence[EventGroup], begin_s: float) -> Table:
    rows = [
        [f"{group.first_s - begin_s:.2f}", _last_text(group, begin_s), str(group.times), group.text] for group in groups
    ]
    return [["first at (s)", "last at (s)", "times", "event"], *rows]


def _last_text(group: EventGroup, begin_s: float) -> str:
    return f"{group.last_s - begin_s:.2f}" if group.times > 1 else ""


# stride by stride


def stride_rows(run: Run) -> Table:
    head = ["walk", "stride", "mud", "from (s)", "depth (cm)", "step (cm)", "outcome"]
    return [head, *(_stride_row(stride) for stride in run.strides)]


def _stride_row(stride: ReportedStride) -> list[str]:
    lengths_cm = [number(length_m / CM, 1) for length_m in (stride.depth_m, stride.step_m)]
    mud = stride.mud or "at a border"
    two = any(isfinite(row.get("other_surface_m", nan)) for row in stride.rows.values())
    outcome = f"{stride.outcome}, two surfaces" if two else str(stride.outcome)
    return [str(stride.walk), str(stride.index), mud, f"{stride.start_s:.2f}", *lengths_cm, outcome]


def estimate_rows(run: Run, name: str) -> Table:
    """List one coefficient of every stride with R² and residual of its fit, the flippers side by side."""
    head = ["walk", "stride"]
    for flipper in run.flippers:
        head += [f"{flipper} (N/cm³)", "R²", "residual (N·cm)"]
    rows = [head]
    for stride in run.strides:
        cells = [cell for flipper in run.flippers for cell in _estimate_cells(stride, flipper, name)]
        rows.append([str(stride.walk), str(stride.index), *cells])
    return rows


def _estimate_cells(stride: ReportedStride, flipper: str, name: str) -> list[str]:
    if flipper not in stride.rows:
        return ["-", "-", "-"]
    estimate, samples = estimate_of_row(stride.rows[flipper], name), stride.samples(flipper, name)
    text = value_text(estimate["value"], estimate["std_error"], per=N_CM3)
    text = f"≥ {text}" if estimate["at_least"] else text
    text = text if estimate["valid"] or text == "-" else f"({text})"
    if samples is None:
        return [text, "-", "-"]
    return [text, number(samples.r_squared), number(N_CM * samples.rms_residual_nm, 2)]


# several runs


def run_rows(runs: Sequence[ComparedRun]) -> Table:
    """List each mud of each run, without columns that are empty in all."""
    rows = [["run", "mud", *MUD_HEAD, *COEFFICIENT_HEAD, "faults"]]
    for each in runs:
        faults = f"{each.headline.stops} stopped it" if each.headline.stops else "-"
        if not each.headline.muds:
            rows.append([each.run.name, "-", str(each.headline.strides), *["-"] * (len(rows[0]) - 4), faults])
        for result in each.headline.muds:
            name, fault = (each.run.name, faults) if result is each.headline.muds[0] else ("", "")
            rows.append([name, result.mud, *mud_cells(result), fault])
    filled = [any(row[column] not in ("", "-") for row in rows[1:]) for column in range(len(rows[0]))]
    return [[cell for cell, is_filled in zip(row, filled, strict=True) if is_filled] for row in rows]


def difference_rows(differences: Sequence[Difference]) -> Table:
    head = ["run", "mud", "quantity", "in the first run", "in this run", "difference", "of the first", ""]
    return [head, *(_difference_row(each) for each in differences)]


def _difference_row(each: Difference) -> list[str]:
    per, unit = (CM, "cm/s") if each.quantity == SPEED else (N_CM3, "N/cm³")
    fraction = f"{100.0 * each.difference / each.first:+.0f} %" if each.first and isfinite(each.first) else "-"
    return [
        each.run,
        each.mud,
        f"{each.quantity} ({unit})",
        value_text(each.first, per=per),
        value_text(each.other, per=per),
        value_text(each.difference, each.std_error, per=per),
        fraction,
        {None: "uncertainty not known", True: "differs", False: "no difference shown"}[each.is_shown]
        + (", at another depth" if each.quantity != SPEED and not each.like_depths else ""),
    ]
