"""The summary of `experiment lablogs`, and its tables. Values are None where logs are too few."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

from pandas import DataFrame

from control.records import COEFFICIENTS
from experiments.lablogs.comparisons import (
    MOVED,
    agreements,
    contradictions,
    count_kinds,
    disturbed_values,
    flipper_pairs,
    sensitivity,
)
from experiments.lablogs.estimates import (
    DELAY_S,
    DISTURBED,
    METHODS,
    MISSING_ROWS,
    RECORDED,
    SEEDS,
    EvaluatedLog,
    Refusal,
    strokes_of,
)
from experiments.lablogs.log_choice import group_key
from experiments.lablogs.repeatability import first_values, repeatability, separation, walk_scatter
from experiments.reports.value_text import N_CM3
from experiments.study.result import Table

DEFINITIONS = (
    "first CV: coefficient of variation over trials of the first stroke's value. later CV: the same of each trial's "
    "geometric mean over its later strokes. chi: scatter over claimed error, between trials (first strokes) and "
    "between strokes (later ones, without the decline that the trials have in common); 1 is expected. Only trials of "
    "one flipper on a fixed base repeat a stroke.\n\n"
    "Errors are the estimates' repeatability: what differs between strides of one session.\n\n"
    "Walks: sd of ln k and chi over all strides in one mud, of any depth; the exponent of depth over those in "
    "no hole, -2 where k_s is a force that does not depend on depth.\n\n"
    "Left against right: the difference over its claimed error in the strides of walks; a median of 0.67 and a root "
    "mean square of 1 are expected. "
    "In air every value and every bound is wrong. Lost: values that became invalid or a bound."
)
Summary = dict[str, Any]
HEADS = {
    "log_sd": "sd of ln k",
    "exponent_std_error": "its error",
    "first_cv": "first CV",
    "later_cv": "later CV",
    "first_mean": "first mean",
    "chi_between_trials": "chi between trials",
    "chi_between_strokes": "chi between strokes",
    "re_entered": "in a hole",
    "with_neighbour": "with a neighbour",
}
AGREEMENT = {"median": "median of |difference| / error", "rms": "root mean square", "n": "strides"}


def summary_of(
    logs: Sequence[EvaluatedLog], groups: Sequence[str | None], estimates: DataFrame, refused: Sequence[Refusal]
) -> Summary:
    """Return the figures of the default method at the top, and those of the other methods by name."""
    default, *others = (_method_summary(logs, estimates[estimates["method"] == method]) for method in METHODS)
    recorded = estimates[(estimates["method"] == METHODS[0]) & (estimates["disturbance"] == RECORDED)]
    strides = recorded["log"].value_counts() // len(COEFFICIENTS)
    evaluated = [
        {key: value for key, value in log._asdict().items() if key != "estimates"}
        | {"group": group, "strides": int(strides.get(number, 0))}
        for number, (log, group) in enumerate(zip(logs, groups, strict=True))
    ]
    methods = dict(zip(METHODS[1:], others, strict=True))
    return {"experiment": "lablogs", **default, "methods": methods, "logs": evaluated, "refused": refused}


def members_of(estimates: DataFrame) -> dict[str, DataFrame]:
    """Return the estimates in mud by group, the groups in order."""
    mud = estimates[estimates["in_mud"].astype(bool)]
    return {name: mud[mud["group"] == name] for name in sorted(mud["group"].dropna().unique(), key=group_key)}


def _method_summary(logs: Sequence[EvaluatedLog], estimates: DataFrame) -> Summary:
    recorded = estimates[estimates["disturbance"] == RECORDED]
    in_mud = recorded["in_mud"].astype(bool)
    mud, groups = recorded[in_mud], members_of(recorded)
    changes = disturbed_values(estimates[estimates["in_mud"].astype(bool)])
    by_group = {name: sensitivity(changes[changes["group"] == name]) for name in groups}
    settings = {"delay_s": DELAY_S, "missing_fraction": MISSING_ROWS, "seeds": SEEDS}
    return {
        "groups": {
            group: {name: repeatability(strokes_of(each)) | count_kinds(each) for name, each in _by_coefficient(own)}
            for group, own in groups.items()
        },
        "walks": {
            group: {
                name: count_kinds(each) | walk_scatter(name, each)
                for name, each in _by_coefficient(own[~own["fixed_base"].astype(bool)])
            }
            for group, own in groups.items()
            if not own["fixed_base"].all()
        },
        "separation": _separations(groups),
        "left_right": agreements(flipper_pairs(mud)),
        "air": _stride_counts([log.name for log in logs if not log.in_mud], recorded[~in_mud]),
        "mud": _stride_counts([log.name for log in logs if log.in_mud], mud),
        "contradictions": {"k_e": contradictions(mud)},
        "sensitivity": sensitivity(changes) | {"groups": by_group} | settings,
    }


def _separations(groups: Mapping[str, DataFrame]) -> list[dict[str, Any]]:
    """Compare the first strokes of each two groups, the first group minus the second."""
    firsts = {name: first_values(strokes_of(own)).set_index("coefficient")["value"] for name, own in groups.items()}
    found = []
    for pair in combinations(firsts, 2):
        for name in COEFFICIENTS:
            one, other = (firsts[group][firsts[group].index == name] for group in pair)
            distance = separation(one, other)
            if distance is not None:
                counts = [len(one), len(other)]
                found.append({"groups": list(pair), "coefficient": name, "pooled_sd": round(distance, 4), "n": counts})
    return found


def _stride_counts(names: Sequence[str], recorded: DataFrame) -> dict[str, Any]:
    counts = {name: count_kinds(each) for name, each in _by_coefficient(recorded)}
    return {"logs": names, "strides": len(recorded) // len(COEFFICIENTS), **counts}


def _by_coefficient(estimates: DataFrame) -> list[tuple[str, DataFrame]]:
    return [(name, estimates[estimates["coefficient"] == name]) for name in COEFFICIENTS]


# tables for people


def tables_of(summary: Summary) -> list[Table]:
    """Return the tables of every method, and those of the logs."""
    methods = {METHODS[0]: summary} | summary["methods"]
    tables = [table for method, own in methods.items() if summary["logs"] for table in _method_tables(method, own)]
    refused = [each._asdict() for each in summary["refused"]]
    findings = [{"log": log["name"], "finding": each} for log in summary["logs"] for each in log["findings"]]
    logs = [log | {"findings": len(log["findings"])} for log in summary["logs"]]
    about_logs = {"Logs": logs, "Findings": findings, "Not evaluated": refused}
    return tables + [
        Table(title.lower(), title, {}, DataFrame(rows), "Logs") for title, rows in about_logs.items() if rows
    ]


def _method_tables(method: str, summary: Summary) -> list[Table]:
    walks = DataFrame(_rows_by_group(summary["walks"]), columns=None if summary["walks"] else ["group", "finding"])
    counts = [
        {"": f"in {where}", "logs": len(own["logs"]), "strides": own["strides"], "coefficient": name} | own[name]
        for where in ("mud", "air")
        for own in (summary[where],)
        for name in COEFFICIENTS
    ]
    agreement = [{"": name} | row for name, row in summary["left_right"].items()]
    effects = {"all in mud": summary["sensitivity"]} | summary["sensitivity"]["groups"]
    disturbed = [
        {"group": group, "": name, "disturbance": run.replace("_", " ")} | own[run][name]
        for group, own in effects.items()
        for run in dict(DISTURBED)
        for name in COEFFICIENTS
        if own[run][name]["n"] + own[run][name]["lost"]
    ]
    disturbed_title = (
        f"Disturbed over recorded values (currents {1000.0 * DELAY_S:g} ms late or early), and the fraction that moved "
        f"by more than {MOVED:g} claimed errors with {100.0 * MISSING_ROWS:g} % of the rows missing"
    )
    repeated = [
        row | {"first_mean": row["first_mean"] and row["first_mean"] / N_CM3}
        for row in _rows_by_group(summary["groups"])
    ]
    tables = {
        "Repeatability": DataFrame(repeated).drop(columns=["n_later"], errors="ignore"),
        "Walks": walks.drop(columns="finding"),
        "Depth law": walks.loc[walks["finding"] != "", ["group", "finding"]],
        "Separation of first strokes, in pooled standard deviations": DataFrame(summary["separation"]),
        "Left against right": DataFrame(agreement).rename(columns=AGREEMENT),
        "Values and bounds": DataFrame(counts),
        disturbed_title: DataFrame(disturbed),
        "Bounds on k_e that contradict a neighbouring stride": DataFrame([summary["contradictions"]["k_e"]]),
    }
    section = f"Method {method}"
    return [
        Table(f"{method} {title}", f"{section}: {title}", {"first mean": "N/cm³"}, rows.rename(columns=HEADS), section)
        for title, rows in tables.items()
        if len(rows)
    ]


def _rows_by_group(groups: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[dict[str, Any]]:
    return [{"group": group, "": name, **row} for group, own in groups.items() for name, row in own.items()]
