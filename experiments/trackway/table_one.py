"""Table I of the paper from walks, wherever they were walked, and the paper's own numbers next to it.

The speed of a trial in a mud is the distance over the time of its strides in that mud. Each cell has two speeds: one
over all strides that began in the mud (`mean_all`), and one over the strides after the second (`mean`), because an
adaptive robot still learns the mud in the first two. A trial with fewer than three strides in a mud counts with all of
them in both (`short_trials`). The keys of these mappings are those of the summary in JSON.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import fmean, stdev
from typing import Any, NamedTuple

from pandas import DataFrame

from experiments.reports.counted_nouns import counted
from experiments.reports.mud_names import mud_label
from experiments.reports.text_tables import number
from experiments.study.result import Table
from experiments.trackway.simulated_walk import LEARNING
from experiments.trackway.walk import Walk, WalkedStride, speed_m_s

Summary = dict[str, Any]


class Speed(NamedTuple):
    """The mean and the standard deviation of a speed over trials, in cm/s."""

    mean: float
    sd: float


# Table I of the paper, by gait and mud
FIXED_DEPTHS_M = {"3 cm": 0.03, "5 cm": 0.05}
ADAPTIVE = "adaptive"
PAPER_TABLE: dict[str, dict[str, Speed]] = {
    "3 cm": {"48.5": Speed(7.6, 0.5), "53.1": Speed(2.1, 0.8), "45.3": Speed(7.2, 0.5)},
    "5 cm": {"48.5": Speed(6.6, 0.3), "53.1": Speed(5.5, 0.7), "45.3": Speed(3.0, 1.0)},
    ADAPTIVE: {"48.5": Speed(6.4, 0.4), "53.1": Speed(5.1, 0.3), "45.3": Speed(7.2, 0.1)},
}


def table_one(
    walks: Mapping[str, Sequence[Walk]], arm_m: float, ends: Mapping[str, Mapping[str, int]], settings: Summary
) -> Summary:
    """Return the summary of trials by gait. `arm_m` is the length of a flipper; `ends` counts how walks ended."""
    muds = list(settings["mud_length_cm"])
    table = {rule: {mud: speed_cell(trials, mud, arm_m) for mud in muds} for rule, trials in walks.items()}
    return {
        "table": table,
        "mean_over_muds": {
            rule: {key: _mean([cell[key] for cell in row.values()]) for key in ("mean", "mean_all")}
            for rule, row in table.items()
        },
        "paper": PAPER_TABLE,
        "within_one_sd": {
            rule: {mud: within_one_sd(table[rule][mud]["mean"], paper) for mud, paper in PAPER_TABLE[rule].items()}
            for rule in FIXED_DEPTHS_M
            if rule in table and set(muds) == set(PAPER_TABLE[rule])
        },
        "walks": {
            rule: [[_stride(stride, arm_m) for stride in walk.strides] for walk in trials]
            for rule, trials in walks.items()
        },
        "ends": ends,
        "settings": settings,
    }


def speed_cell(walks: Sequence[Walk], mud: str, arm_m: float) -> Summary:
    """Summarise one gait in one mud over the trials that reached it. Speeds are in cm/s, None where no trial did."""
    trials = [strides for walk in walks if (strides := walk.in_mud(mud))]
    later = [strides[LEARNING:] for strides in trials]
    speeds = [100.0 * speed_m_s(after or strides) for after, strides in zip(later, trials, strict=True)]
    speeds_all = [100.0 * speed_m_s(strides) for strides in trials]
    return {
        "mean": _mean(speeds),
        "sd": _sd(speeds),
        "mean_all": _mean(speeds_all),
        "sd_all": _sd(speeds_all),
        "trials": len(trials),
        "short_trials": sum(not after for after in later),
        "strides": sum(len(strides) for strides in trials),
        "failures": count_failures(trials, arm_m),
        "failures_after_second": count_failures(later, arm_m),
    }


def count_failures(trials: Sequence[Sequence[WalkedStride]], arm_m: float) -> dict[str, int]:
    """Count the failed strides by the name of the failure."""
    names = Counter(stride.failure(arm_m) for strides in trials for stride in strides)
    return {name: names[name] for name in sorted(names) if name}


def within_one_sd(mean: float | None, paper: Speed) -> bool | None:
    return None if mean is None else abs(mean - paper.mean) <= paper.sd


def _stride(stride: WalkedStride, arm_m: float) -> Summary:
    return {
        "mud": stride.mud,
        "position_cm": round(100.0 * stride.position_m, 2),
        "depth_cm": round(100.0 * stride.depth_m, 3),
        "step_cm": round(100.0 * stride.step_m, 2),
        "duration_s": round(stride.duration_s, 3),
        "failure": stride.failure(arm_m),
    }


def _mean(speeds: Sequence[float | None]) -> float | None:
    """Return the mean; None where a speed is not known, or there is none."""
    known = [speed for speed in speeds if speed is not None]
    return round(fmean(known), 3) if known and len(known) == len(speeds) else None


def _sd(speeds: Sequence[float]) -> float | None:
    """Return the standard deviation between trials; None for fewer than two."""
    return round(stdev(speeds), 3) if len(speeds) > 1 else None


# tables for people


def speed_table(report: Summary) -> Table:
    """Return Table I: each gait after the second stride, over all strides, and the paper's."""
    rows: list[dict[str, str]] = []
    for gait, row in report["table"].items():
        over_muds = report["mean_over_muds"][gait]
        for head, mean, sd in ((gait, "mean", "sd"), ("  all strides", "mean_all", "sd_all")):
            cells = {mud: _plus_minus(cell[mean], cell[sd]) for mud, cell in row.items()}
            rows.append({"speed": head, **cells, "all muds": number(over_muds[mean], 2)})
        if gait in PAPER_TABLE:
            cells = {mud: _paper_text(report, gait, mud) for mud in row}
            of_paper = fmean(speed.mean for speed in PAPER_TABLE[gait].values())
            rows.append({"speed": "  paper", **cells, "all muds": number(of_paper, 2)})
    trials = [cell["trials"] for row in report["table"].values() for cell in row.values()]  # that reached the mud
    fewest = f"{min(trials)} to " * (min(trials) < max(trials))
    title = f"Table I: speed after the second stride in each mud, mean ± sd of {fewest}{counted(max(trials), 'trial')}"
    return Table("table", title, {"speed": "cm/s"}, DataFrame(rows).rename(columns=mud_label), "Table I")


def _plus_minus(mean: float | None, sd: float | None) -> str:
    return number(mean, 2) if sd is None else f"{number(mean, 2)} ± {sd:.2f}"


def _paper_text(report: Summary, rule: str, mud: str) -> str:
    paper = PAPER_TABLE[rule].get(mud)
    if paper is None:
        return "-"
    within = report["within_one_sd"].get(rule, {}).get(mud)
    verdict = "" if within is None else (", ours within" if within else ", ours outside")
    return f"{paper.mean:.1f} ± {paper.sd:.1f}{verdict}"


def failure_table(report: Summary) -> Table:
    """Return the failed strides of each gait by mud, and how its walks ended."""
    rows = []
    for gait, row in report["table"].items():
        ends = ", ".join(f"{count} {end}" for end, count in report["ends"][gait].items())
        rows.append({"": gait, **{mud: _failures_of(cell) for mud, cell in row.items()}, "ends": ends})
    title = "Failed strides, in brackets those after the second"
    return Table("failures", title, {}, DataFrame(rows).rename(columns=mud_label), "Table I")


def _failures_of(cell: Summary) -> str:
    later = cell["failures_after_second"]
    named = [f"{count} ({later.get(name, 0)}) {name}" for name, count in cell["failures"].items()]
    return f"{', '.join(named) or 'none'} of {cell['strides']}"


def short_note(report: Summary) -> list[str]:
    """Return a sentence on the trials with fewer than three strides in a mud; nothing where there is none."""
    short = sum(cell["short_trials"] for row in report["table"].values() for cell in row.values())
    return [f"Trials with fewer than three strides in a mud, all counted: {counted(short, 'time')}."] if short else []
