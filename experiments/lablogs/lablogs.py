"""Estimates from real logs, of which the truth is unknown: do they repeat, and do their errors say how well?

Any folder of logs is evaluated by each method: trials of one mud against each other, muds against each other, the left
flipper against the right one, mud against air, and each log against itself with disturbed columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from experiments.lablogs.lab_trial import LabTrial, Refusal, read_trial
from experiments.lablogs.log_choice import GroupRule, Paths, group_key, group_of, matches
from experiments.lablogs.report import LablogsReport, report_of
from experiments.study.workers import run_parallel
from experiments.trials.session import Show
from firmware_host.configuration.configuration import CaptureAxis
from logs.lab.body_track import VERTICAL_AXIS


@dataclass(frozen=True)
class Plan:
    """The logs and their groups. Logs that match `air` are those without mud; without patterns they are detected.

    `vertical` is the axis of the captures of CSV logs that points up.
    """

    logs: Sequence[Paths]
    rules: Sequence[GroupRule] = ()
    air: Sequence[str] = ()
    vertical: CaptureAxis = VERTICAL_AXIS

    def group_of(self, name: str) -> str | None:
        return group_of(name, self.rules)

    def is_in_mud(self, trial: LabTrial) -> bool:
        return not any(matches(trial.name, pattern) for pattern in self.air) if self.air else trial.in_mud

    def unmatched(self) -> list[str]:
        """Return the patterns that no log matches."""
        patterns = [*(rule.pattern for rule in self.rules), *self.air]
        return [pattern for pattern in patterns if not any(matches(paths[0].name, pattern) for paths in self.logs)]


@dataclass(frozen=True)
class Evaluated:
    """The trials with their groups, for the figures, and the report on them."""

    trials: Sequence[tuple[LabTrial, str | None]]
    report: LablogsReport

    @property
    def groups(self) -> dict[str, list[LabTrial]]:
        return group_trials(self.trials)


def evaluate(plan: Plan, show: Show) -> Evaluated:
    """Read and replay every log in parallel."""
    read = run_parallel([partial(read_trial, paths, vertical=plan.vertical) for paths in plan.logs], show)
    refused = [each for each in read if isinstance(each, Refusal)]
    trials = [each._replace(in_mud=plan.is_in_mud(each)) for each in read if isinstance(each, LabTrial)]
    grouped = [(trial, plan.group_of(trial.name)) for trial in trials]
    return Evaluated(grouped, report_of(grouped, group_trials(grouped), refused))


def group_trials(trials: Sequence[tuple[LabTrial, str | None]]) -> dict[str, list[LabTrial]]:
    """Return the trials in mud by group, the groups in order."""
    names = {group for trial, group in trials if group is not None and trial.in_mud}
    return {
        name: [trial for trial, group in trials if group == name and trial.in_mud]
        for name in sorted(names, key=group_key)
    }
