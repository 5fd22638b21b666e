"""The report of `experiment lablogs`. Its fields are the keys of the summary in JSON; None where logs are too few."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from estimation.estimation_parameters import Method
from experiments.lablogs.consistency import (
    Agreement,
    Contradictions,
    Counts,
    agreements,
    contradictions,
    count_estimates,
    estimates_of,
    flipper_pairs,
)
from experiments.lablogs.lab_trial import METHODS, LabTrial, Refusal
from experiments.lablogs.repeatability import (
    Strokes,
    coefficient_of_variation,
    first_values,
    later_levels,
    scatter_between_strokes,
    scatter_between_trials,
    separation,
)
from experiments.lablogs.sensitivity import SensitivityReport, sensitivity
from experiments.reports.error_table import COEFFICIENTS

FLAT = {"flat": True}  # metadata of a field whose entries stand next to those of its record
Groups = Mapping[str, Sequence[LabTrial]]  # by name, without logs in air


@dataclass(frozen=True)
class Repeatability(Counts):
    """One coefficient in one group. Counts are over all strides; the rest is over trials on a fixed base."""

    first_cv: float | None
    later_cv: float | None
    chi: float | None  # of both
    chi_between_trials: float | None
    chi_between_strokes: float | None
    n: int  # trials with a first value
    n_later: int
    first_mean: float | None  # N/m³


@dataclass(frozen=True)
class Separation:
    """The difference of two groups' mean first strokes, the first group minus the second."""

    groups: tuple[str, str]
    coefficient: str
    pooled_sd: float  # the difference in pooled standard deviations
    n: tuple[int, int]


@dataclass(frozen=True)
class StrideCounts:
    logs: Sequence[str]
    strides: int
    coefficients: Mapping[str, Counts] = field(metadata=FLAT)


@dataclass(frozen=True)
class MethodReport:
    groups: Mapping[str, Mapping[str, Repeatability]]
    separation: Sequence[Separation]
    left_right: Mapping[str, Agreement]
    air: StrideCounts
    mud: StrideCounts
    contradictions: Mapping[str, Contradictions]
    sensitivity: SensitivityReport


@dataclass(frozen=True)
class EvaluatedLog:
    name: str
    group: str | None
    flippers: Sequence[str]
    fixed_base: bool
    in_mud: bool
    strides: int
    findings: Sequence[str]  # peculiarities of the file


@dataclass(frozen=True, kw_only=True)
class LablogsReport:
    """The default method's figures at the top, those of the other methods by name."""

    experiment: str = "lablogs"
    default: MethodReport = field(metadata=FLAT)
    methods: Mapping[str, MethodReport]
    logs: Sequence[EvaluatedLog]
    refused: Sequence[Refusal]

    def of(self, method: str) -> MethodReport:
        return self.default if method == METHODS[0] else self.methods[method]


def report_of(
    trials: Sequence[tuple[LabTrial, str | None]], groups: Groups, refused: Sequence[Refusal]
) -> LablogsReport:
    """`trials` are all with the name of their group."""
    default, *others = METHODS
    every = [trial for trial, _ in trials]
    return LablogsReport(
        default=method_report(every, groups, default),
        methods={method: method_report(every, groups, method) for method in others},
        logs=[_evaluated_log(trial, group) for trial, group in trials],
        refused=refused,
    )


def method_report(trials: Sequence[LabTrial], groups: Groups, method: Method) -> MethodReport:
    mud, air = ([trial for trial in trials if trial.in_mud is wanted] for wanted in (True, False))
    whole = sensitivity(mud, method)
    return MethodReport(
        groups={
            name: {each: repeatability(members, method, each) for each in COEFFICIENTS}
            for name, members in groups.items()
        },
        separation=separations(groups, method),
        left_right=agreements(flipper_pairs(mud, method)),
        air=_stride_counts(air, method),
        mud=_stride_counts(mud, method),
        contradictions={"k_e": contradictions(mud, method)},
        sensitivity=SensitivityReport(
            whole.current_late,
            whole.current_early,
            whole.rows_missing,
            {name: sensitivity(members, method) for name, members in groups.items()},
        ),
    )


def strokes_of(trials: Sequence[LabTrial], method: Method, name: str) -> list[Strokes]:
    """Return one coefficient's estimates of each trial on a fixed base."""
    return [estimates_of(strokes, name) for trial in trials if trial.fixed_base for strokes in trial.strokes(method)]


def repeatability(trials: Sequence[LabTrial], method: Method, name: str) -> Repeatability:
    strokes = strokes_of(trials, method, name)
    counts = count_estimates(each for trial in trials for each in estimates_of(trial.replays[method].recorded, name))
    first, later = [each.value for each in first_values(strokes)], later_levels(strokes)
    between_trials, between_strokes = scatter_between_trials(strokes), scatter_between_strokes(strokes)
    return Repeatability(
        values=counts.values,
        bounds=counts.bounds,
        invalid=counts.invalid,
        first_cv=_rounded(coefficient_of_variation(first)),
        later_cv=_rounded(coefficient_of_variation(later)),
        chi=_rounded(between_trials.joined(between_strokes).chi),
        chi_between_trials=_rounded(between_trials.chi),
        chi_between_strokes=_rounded(between_strokes.chi),
        n=len(first),
        n_later=len(later),
        first_mean=round(float(np.mean(first))) if first else None,
    )


def separations(groups: Groups, method: Method) -> list[Separation]:
    found = []
    for one, other in combinations(groups, 2):
        for name in COEFFICIENTS:
            values = [
                [e.value for e in first_values(strokes_of(groups[group], method, name))] for group in (one, other)
            ]
            distance = separation(*values)
            if distance is not None:
                counts = (len(values[0]), len(values[1]))
                found.append(Separation((one, other), name, round(distance, 4), counts))
    return found


def _stride_counts(trials: Sequence[LabTrial], method: Method) -> StrideCounts:
    strides = [stride for trial in trials for stride in trial.replays[method].recorded]
    counts = {name: count_estimates(estimates_of(strides, name)) for name in COEFFICIENTS}
    return StrideCounts([trial.name for trial in trials], len(strides), counts)


def _evaluated_log(trial: LabTrial, group: str | None) -> EvaluatedLog:
    return EvaluatedLog(
        name=trial.name,
        group=group,
        flippers=trial.flippers,
        fixed_base=trial.fixed_base,
        in_mud=trial.in_mud,
        strides=len(trial.replays[METHODS[0]].recorded),
        findings=trial.findings,
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
