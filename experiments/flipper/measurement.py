"""A single flipper on a fixed base strides through muds: their coefficients, after the paper's sections II-C and III-B.

The robot's own daemon makes the strides, at 0.1 m/s with pauses of 3 s for the mud to relax, and says what each told of
the mud; angles and forces come from its log, and the other methods' coefficients from the same log. The first stride
of a trial counts: the same hole loses 15 to 20 % a stroke.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np

from control.records import Phase
from experiments.flipper.base_watch import SPOILING_M, load_remarks, moved_text, pose_remarks, surface_remarks
from experiments.flipper.modelled_force import misfit_n, modelled_forces
from experiments.reports.coefficient_table import (
    ComparedStride,
    MudSummary,
    error_table,
    gather_coefficients,
)
from experiments.reports.error_table import COEFFICIENTS
from experiments.robot.bench_robot import BenchError, arm, rest, walk
from experiments.trials.estimation_methods import DEFAULT, PAPER, configured_method, strides_by_method
from experiments.trials.mud_trials import Bench, InvalidTrialError, PlannedTrial, conduct_trials
from experiments.trials.notebook import Entry
from experiments.trials.session import Show
from experiments.trials.stride_profile import StrideProfile, profile_from_row, profile_of, profile_row, thinned
from experiments.trials.truth_file import TruthOfMud, missing_text, truth_in
from firmware_host.configuration.configuration import Configuration
from firmware_host.log_reading.log_reader import Log

MUDS = ("47.6", "48.6", "49.5", "50.3", "51.2")  # the paper's, by their water in percent
METHODS = (DEFAULT, PAPER)
SETTLED_S = 0.5  # in free air after the stride
LEAST_N = 0.25  # mean force over the end of a stroke: less is air
PROTOCOL = "single_flipper"

# What the authors' raw logs hold of first strokes in the mud that they call 12.5N: least and largest force in N.
AUTHORS_MUD, AUTHORS_N = "12.5N", {"insertion": (2.5, 2.8), "stance": (7.4, 8.3), "extraction": (1.9, 2.3)}


@dataclass(frozen=True)
class Plan:
    muds: tuple[str, ...] = MUDS
    trials: int = 3
    depth_m: float = 0.03
    strides: int = 1
    flipper: str = "right"
    simulated: bool = False

    @property
    def kept(self) -> dict[str, Any]:
        """What may not change where an experiment goes on: muds and trials may be added."""
        return {
            "experiment": "flipper",
            "depth_m": self.depth_m,
            "strides": self.strides,
            "flipper": self.flipper,
            "simulated": self.simulated,
        }

    @property
    def planned(self) -> list[PlannedTrial]:
        return [
            PlannedTrial(f"{mud}/{number}", mud, number, self.trials)
            for mud in self.muds
            for number in range(1, self.trials + 1)
        ]


@dataclass(frozen=True)
class FlipperMud(MudSummary):
    remarks: Sequence[str]


def require_fixed_base(configuration: Configuration) -> None:
    """Raises BenchError with what to set."""
    protocol = tomllib.loads(configuration.text).get("gait", {}).get("protocol")
    missing = ['gait.protocol = "single_flipper"'] * (protocol != PROTOCOL)
    missing += ["estimation.fixed_base = true"] * (not configuration.estimation.fixed_base)
    if missing:
        raise BenchError(
            f"the daemon is set up to walk: set {' and '.join(missing)} in its configuration and start it anew"
        )


def run(bench: Bench, plan: Plan, show: Show) -> None:
    """Every trial that is not in the notebook. Raises BenchError."""
    require_fixed_base(bench.robot.configuration)
    conduct_trials(bench, plan.planned, lambda trial: measure(bench, plan, trial), show)


def measure(bench: Bench, plan: Plan, trial: PlannedTrial) -> Entry:
    """One trial. Raises SpoiltTrialError, BenchError."""
    robot = bench.robot
    arm(robot, bench.operator)
    before_m = robot.call("status")["body_x_m"]
    walked = walk(robot, plan.depth_m, plan.strides)
    robot.wait(SETTLED_S)
    after = robot.call("status")
    log = robot.record(walked.from_s, after["now_s"])
    rest(robot)  # reading it takes longer on a slow computer than the robot is left alone
    strides = strides_by_method(walked.strides, log, robot.configuration, plan.flipper, METHODS)
    truths = bench.bed.truths(plan.flipper)
    entry: Entry = {"mud": trial.mud, "trial": trial.number, "strides": strides, "truths": truths}
    entry |= _reported(
        log, strides[configured_method(robot.configuration.estimation)], robot.configuration, plan.flipper
    )
    entry |= {"from_s": walked.from_s, "to_s": after["now_s"]}
    invalid = moved_text(before_m, after["body_x_m"], SPOILING_M)
    if invalid:
        raise InvalidTrialError(invalid, entry)
    entry["remarks"] += pose_remarks(before_m, after["body_x_m"])
    return entry


def _reported(log: Log, own: Sequence[dict[str, Any]], configuration: Configuration, flipper: str) -> Entry:
    """The first stride's course and what is to be remarked. Raises SpoiltTrialError."""
    if not own:
        raise InvalidTrialError(f"the daemon closed no stride of the {flipper} flipper")
    profile = profile_of(log, flipper, own[0]["t_start_s"])
    require_mud(profile)
    remarks = load_remarks(log, configuration, flipper) + surface_remarks(own[0])
    return {"course": profile_row(thinned(profile)), "remarks": remarks}


def require_mud(profile: StrideProfile) -> None:
    """Raises SpoiltTrialError where insertion and stance felt nothing."""
    felt_n = [_late_mean_n(profile.force_z_n, profile.during(Phase.INSERTION))]
    felt_n.append(_late_mean_n(profile.force_x_n, profile.during(Phase.STANCE)))
    if max(felt_n) < LEAST_N:
        raise InvalidTrialError(
            "the flipper met no mud: look whether it hangs over the mud, and how high its axes are "
            "(geometry.axis_height_m)"
        )


def _late_mean_n(force_n: Any, rows: Any) -> float:
    """Over the last third of a stroke."""
    reported = force_n[rows]
    late = reported[2 * len(reported) // 3 :]
    late = late[np.isfinite(late)]
    return float(late.mean()) if len(late) else 0.0


# the report


def report_of(
    plan: Plan, entries: Mapping[str, Entry], configuration: Configuration, truth: TruthOfMud | None
) -> dict[str, Any]:
    """`truth`: another experiment's; without it that of the bed, where it has one."""
    method = configured_method(configuration.estimation)
    by_mud = {mud: trials for mud in muds_of(plan, entries) if (trials := trials_of(mud, entries))}
    rows = list(_beside(by_mud, truth))
    muds = [_mud_report(mud, trials, method, rows) for mud, trials in by_mud.items()]
    return {
        "experiment": "flipper",
        "muds": muds,
        "errors": error_table(rows, "single flipper"),
        "falls_with_water": {name: _falls(muds, name) for name in COEFFICIENTS},
        "largest_forces_n": {mud: _largest_forces(trials, method) for mud, trials in by_mud.items()},
        "misfit_n": {mud: _misfits(trials[0], configuration, method) for mud, trials in by_mud.items()},
        "later_strokes": _later_strokes(by_mud, method),
        "missing_truth": missing_text(truth, by_mud),
        "settings": plan.kept | {"method": method, "truth": "file" if truth else "bed"},
        "plate_m": {
            "width": configuration.geometry.plate_width_m,
            "height": configuration.geometry.plate_height_m,
            "thickness": configuration.geometry.plate_thickness_m,
        },
    }


def muds_of(plan: Plan, entries: Mapping[str, Entry]) -> list[str]:
    return list(dict.fromkeys([*plan.muds, *(entry["mud"] for entry in entries.values())]))


def trials_of(mud: str, entries: Mapping[str, Entry]) -> list[Entry]:
    return sorted((entry for entry in entries.values() if entry["mud"] == mud), key=lambda entry: int(entry["trial"]))


def _beside(by_mud: Mapping[str, Sequence[Entry]], truth: TruthOfMud | None) -> list[ComparedStride]:
    return [
        ComparedStride(mud, method, strides[0], truth_in(truth, mud) if truth else trial["truths"].get("0", {}))
        for mud, trials in by_mud.items()
        for trial in trials
        for method, strides in trial["strides"].items()
        if strides
    ]


def _mud_report(mud: str, trials: Sequence[Entry], method: str, rows: Sequence[ComparedStride]) -> FlipperMud:
    own = [row for row in rows if row.mud == mud and row.method == method]
    reported = {name: [row.truth.get(name) for row in own] for name in COEFFICIENTS}
    truths = {name: [value for value in values if value is not None] for name, values in reported.items()}
    return FlipperMud(
        mud=mud,
        **gather_coefficients([row.stride for row in own]),
        truth={name: fmean(values) for name, values in truths.items() if values} or None,
        remarks=[remark for trial in trials for remark in trial["remarks"]],
    )


def _falls(muds: Sequence[FlipperMud], name: str) -> bool | None:
    """Whether more water means less, as in the paper; None where the muds are not named after their water."""
    try:
        reported = sorted((float(mud.mud), value) for mud in muds if (value := mud.coefficient(name).value) is not None)
    except ValueError:
        return None
    return all(a > b for (_, a), (_, b) in zip(reported, reported[1:], strict=False)) if len(reported) > 1 else None


def _largest_forces(trials: Sequence[Entry], method: str) -> dict[str, float | None]:
    """Mean over first strides, in N."""
    first = [trial["strides"][method][0] for trial in trials]
    reported = {
        "insertion": [stride["insertion_force_n"] for stride in first],
        "stance": [stride["stance_force_n"] for stride in first],
        "extraction": [stride["extraction_force_n"] for stride in first],
    }
    known = {name: [abs(value) for value in values if value is not None] for name, values in reported.items()}
    return {name: fmean(values) if values else None for name, values in known.items()}


def _misfits(trial: Entry, configuration: Configuration, method: str) -> dict[str, float | None]:
    """What the laws leave over of the forces of one stride, root mean square in N."""
    profile, stride = profile_from_row(trial["course"]), trial["strides"][method][0]
    laws = modelled_forces(
        profile, configuration.geometry, stride["surface_m"] or 0.0, drawn_coefficients(stride), method
    )
    left = {"insertion": Phase.INSERTION, "extraction": Phase.EXTRACTION}
    misfits = {
        name: misfit_n(profile.force_z_n[profile.during(phase)], laws.force_z_n[profile.during(phase)])
        for name, phase in left.items()
    }
    return misfits | {"stance": misfit_n(profile.force_x_n, laws.force_x_n)}


def drawn_coefficients(stride: Mapping[str, Any]) -> dict[str, float | None]:
    """Those of which a law is drawn: values, and bounds as what the mud bore."""
    return {name: stride[name]["value"] if stride[name]["valid"] else None for name in COEFFICIENTS}


def _later_strokes(by_mud: Mapping[str, Sequence[Entry]], method: str) -> dict[str, list[float]]:
    """k_s of each stride over that of the first in the same hole, mean over all trials that have both."""
    trials = [trial["strides"][method] for reported in by_mud.values() for trial in reported]
    longest = max((len(strides) for strides in trials), default=0)
    found: dict[str, list[float]] = {}
    for name in COEFFICIENTS:
        fractions = [
            [
                strides[number][name]["value"] / strides[0][name]["value"]
                for strides in trials
                if len(strides) > number and strides[0][name]["valid"] and strides[number][name]["valid"]
            ]
            for number in range(1, longest)
        ]
        found[name] = [fmean(each) for each in fractions if each]
    return found
