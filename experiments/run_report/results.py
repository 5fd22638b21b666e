"""The result of a run: how far, how fast, how many strides were good, what each mud is, what went wrong; and how runs
differ, mud by mud.

The speed of a mud is the sum of its steps over the sum of their durations, without the last stride of a walk. Its
standard error is that of a ratio: the scatter of the steps around speed times duration, with Student's factor.
Coefficients are means over the strides of both flippers (coefficient_table.py). They fall with depth, so the depths
stand next to them.

Each run is compared with the first one in the muds that both have under the same name. Muds that a robot noticed have
none: alike by two digits of k_p, they may be two muds, and one mud may read otherwise. The error that all strides of
one robot share, such as that of its torque constants, moves its runs alike: where both are of the same robot only the
errors of the strides count. A difference is shown where it exceeds two of its standard errors.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from math import fsum, hypot, isfinite, sqrt
from typing import Any

import numpy as np
from pandas import DataFrame

from control.faults import FAULT_KINDS, Reaction
from control.records import COEFFICIENTS, UNKNOWN, Phase
from estimation.ground_law import UNDECIDED, LawEvidence, law_evidence, readings_of
from estimation.strokes.origin_fit import student_factor
from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.stride_choice import Outcome
from experiments.reports.coefficient_table import GatheredCoefficient, gather_coefficient
from experiments.reports.counted_nouns import counted
from experiments.reports.depth_law import NARROWEST, fit_depth_law, law_finding, re_entered
from experiments.reports.mud_names import mud_key
from experiments.run_report.run import MudsFrom, Run
from firmware_host.operator.reports import law_report
from firmware_host.trial import KEYS, Trial
from logs.fault_history import LoggedCause
from logs.files.log_summary import trial_of

Entry = dict[str, Any]  # of the JSON of a report
Value = tuple[float | None, float | None]  # with its standard error
SHOWN = 2.0  # standard errors
SPEED = "speed"
SPEED_KEYS = ("distance_m", "duration_s", "speed_m_s", "speed_std_error_m_s")
DOING = {Outcome.GOOD: "good", Outcome.SLIPPING: "slipped", Outcome.STUCK: "stuck"}


def headline_of(run: Run) -> Entry:
    """Return the result of all walks, and of each mud in the order of the walk without strides of uncertain mud."""
    reactions = [reaction_of(cause) for cause in run.causes]
    plate_width_m = max((walk.geometry.plate.width_m for walk in run.walks), default=0.0)
    strides = run.strides.assign(re_entered=re_entered(run.strides.groupby("walk"), plate_width_m))
    muds = strides[strides["mud"] != ""].groupby("mud", sort=False)
    return {
        "complete": run.log is None or run.log.complete,  # False where the writer was cut off, or still writes
        "trial": trial_of(run.log) if run.log else {},
        "walks": len(run.walks),
        **travel_of(run.walks, in_gait=run.log is None),
        "strides": len(run.strides),
        "outcomes": _count_outcomes(run.strides),
        "muds": [_mud_result(run, str(mud), of_mud) for mud, of_mud in muds],
        "stops": sum(reaction > Reaction.WARN for reaction in reactions),
        "warnings": sum(reaction is Reaction.WARN for reaction in reactions),
    }


def reaction_of(cause: LoggedCause) -> Reaction:
    """Return the hardest reaction to a cause and to what followed from it."""
    return max(FAULT_KINDS[name].reaction for name in (cause.name, *cause.consequences))


def travel_of(walks: Sequence[RecordedWalk], in_gait: bool = False) -> Entry:
    """Return distance, time and mean speed of all walks; between two walks the robot may be moved.

    `in_gait`: a walk is all of its file, in which the robot also rests before its first insertion and at the end.
    """
    distance_m = duration_s = 0.0
    for walk in walks:
        begun = np.maximum.accumulate(walk.phase == Phase.INSERTION) & (walk.phase != Phase.REST) if in_gait else True
        known = np.flatnonzero(np.isfinite(walk.body_x_m) & begun)
        if len(known):
            distance_m += float(walk.body_x_m[known[-1]] - walk.body_x_m[known[0]])
            duration_s += float(walk.time_s[known[-1]] - walk.time_s[known[0]])
    return _speed(distance_m, duration_s, distance_m / duration_s) if duration_s > 0.0 else _speed()


def _speed(*values: float | None) -> Entry:
    """Return the values of SPEED_KEYS, of which the last ones may be unknown."""
    return dict(zip_longest(SPEED_KEYS, values))


def _count_outcomes(strides: DataFrame) -> dict[str, int]:
    return {str(outcome): int((strides["outcome"] == outcome).sum()) for outcome in Outcome}


def _mud_result(run: Run, mud: str, strides: DataFrame) -> Entry:
    depths_m = [depth_m for depth_m in strides["depth_m"] if isfinite(depth_m)] or [UNKNOWN]
    estimates = run.estimates[run.estimates["mud"] == mud]
    by_flipper = {flipper: estimates[estimates["flipper"] == flipper] for flipper in run.replay.flippers}
    values = estimates[estimates["valid"] & ~estimates["at_least"]]
    fresh = values.merge(strides.loc[~strides["re_entered"], ["walk", "index"]])
    law = _ground_law(run, estimates)
    return {
        "mud": mud,
        "strides": len(strides),
        "outcomes": _count_outcomes(strides),
        **speed_of(strides),
        "shallowest_m": min(depths_m),
        "deepest_m": max(depths_m),
        "both": _gathered(estimates),
        "law": law_report(law),
        "findings": [*_depth_findings(fresh), *ground_finding(law, len(strides))],
        "flippers": {flipper: _gathered(own) for flipper, own in by_flipper.items()},
    }


def speed_of(strides: DataFrame) -> Entry:
    steps_m = [step_m for step_m in strides["step_m"] if isfinite(step_m)]
    distance_m = fsum(steps_m) if steps_m else None
    known = strides.dropna(subset=["step_m", "duration_s"])[["step_m", "duration_s"]].to_numpy(float).tolist()
    if not known:
        return _speed(distance_m)
    duration_s = fsum(seconds for _, seconds in known)
    speed_m_s = fsum(step_m for step_m, _ in known) / duration_s
    error = None
    if len(known) > 1:
        squares = fsum((step_m - speed_m_s * seconds) ** 2 for step_m, seconds in known)
        freedom = len(known) - 1
        error = student_factor(freedom) * sqrt(squares / freedom * len(known)) / duration_s
    return _speed(distance_m, duration_s, speed_m_s, error)


def _gathered(estimates: DataFrame) -> dict[str, GatheredCoefficient]:
    return {name: gather_coefficient(estimates[estimates["coefficient"] == name]) for name in COEFFICIENTS}


def _ground_law(run: Run, estimates: DataFrame) -> LawEvidence | None:
    """Return which ground's law the strides of a mud follow."""
    readings = readings_of((row.coefficient, row) for row in estimates.itertuples())
    return law_evidence(run.walks[0].geometry, readings) if run.walks else None


def ground_finding(law: LawEvidence | None, strides: int) -> list[str]:
    """Return a sentence where the coefficients of a ground do not compare as those of mud.

    A single stride may have gone down in one mud and swept into the next, so it finds nothing.
    """
    if law is None or law.name == "mud" or strides < 2:
        return []
    wrong = " and ".join(f"{name} by {100.0 * error:.0f} %" for name, error in law.errors.items())
    finding = "no known law explains" if law.name == UNDECIDED else f"the law of {law.name} explains"
    return [f"{finding} how the coefficients compare: each is predicted wrong from the others, as {wrong}."]


def _depth_findings(fresh: DataFrame) -> list[str]:
    """Return what contradicts the depth law of mud; strides without a repeatability, as of older logs, do not."""
    findings = [law_finding(name, fit_depth_law(fresh[fresh["coefficient"] == name])) for name in COEFFICIENTS]
    return [finding for finding in findings if finding]


def headline_sentences(run: Run, headline: Entry) -> list[str]:
    """Return the result in sentences; a CSV of the authors knows no faults."""
    strides, outcomes = headline["strides"], headline["outcomes"]
    known = [f"{outcomes[outcome]} {doing}" for outcome, doing in DOING.items() if outcomes[outcome]]
    text = f"{counted(strides, 'stride')}{': ' * bool(known)}{', '.join(known)}." if strides else "No complete stride."
    sentences = [*end_sentences([run]), *trial_sentences(headline["trial"]), _travel_sentence(headline), text]
    if run.log:
        stops = f"{counted(headline['stops'], 'fault')} stopped it" if headline["stops"] else "No fault stopped it"
        warnings = f"; {counted(headline['warnings'], 'warning')}" * bool(headline["warnings"])
        sentences.append(f"{stops}{warnings}.")
    return sentences + [f"{mud['mud']}: {finding}" for mud in headline["muds"] for finding in mud["findings"]]


def end_sentences(runs: Sequence[Run]) -> list[str]:
    """Return which logs end early; none where all are whole."""
    early = [run.name for run in runs if run.log and not run.log.complete]
    what = f"{', '.join(early)} {'ends' if len(early) == 1 else 'end'} early"
    return [f"{what}: cut off, or still being written."] * bool(early)


def trial_sentences(trial: Trial) -> list[str]:
    """Return the description of a trial in a sentence, the usual keys first; none without one."""
    keys = [*[key for key in KEYS if key in trial], *[key for key in trial if key not in KEYS]]
    text = ", ".join(f"{key} {trial[key]}{' %' * (key == 'water')}" for key in keys)
    return [f"{text[0].upper()}{text[1:]}."] if text else []


def _travel_sentence(headline: Entry) -> str:
    if not headline["walks"]:
        return "The robot did not walk."
    if headline["speed_m_s"] is None:
        return "The log has no position of the body: distance, speed and slip are not known."
    walks = f" in {headline['walks']} walks" if headline["walks"] > 1 else ""
    speed = f"{100.0 * headline['speed_m_s']:z.1f} cm/s"
    return f"The robot walked {headline['distance_m']:.2f} m in {headline['duration_s']:.1f} s{walks}: {speed}."


# several runs


def run_labels(runs: Sequence[Run], headlines: Sequence[Entry]) -> dict[str, str]:
    """Return what tables and pictures call each run, by its name: mud, trial and tags, and its name if these repeat."""
    texts = {run.name: _trial_label(each["trial"]) for run, each in zip(runs, headlines, strict=True)}
    return {
        name: f"{text}, {name}" if text and [*texts.values()].count(text) > 1 else text or name
        for name, text in texts.items()
    }


def _trial_label(trial: Trial) -> str:
    parts = (f"{key} {trial[key]}" for key in ("mud", "trial") if key in trial)
    return ", ".join([*parts, *filter(None, [trial.get("tags", "").replace(",", ", ")])])


def differences(runs: Sequence[Run], headlines: Sequence[Entry]) -> list[Entry]:
    """Compare every run with the first. A quantity is in m/s for the speed, else in N/m³.

    `std_error` is None where a run has a single value without an error.
    """
    return [
        each
        for run, headline in list(zip(runs, headlines, strict=True))[1:]
        if MudsFrom.ROBOT not in (runs[0].muds_from, run.muds_from)
        for before in headlines[0]["muds"]
        for after in headline["muds"]
        if mud_key(before["mud"]) == mud_key(after["mud"])
        for each in _between(runs[0], before, run, after)
    ]


def _between(first: Run, before: Entry, other: Run, after: Entry) -> Iterator[Entry]:
    for quantity, (a, a_error), (b, b_error) in _quantities(before, after, first.robot == other.robot):
        if a is not None and b is not None:
            yield {
                "run": other.name,
                "first_run": first.name,
                "mud": before["mud"],
                "quantity": quantity,
                "first": a,
                "other": b,
                "difference": b - a,
                "std_error": None if a_error is None or b_error is None else hypot(a_error, b_error),
                "like_depths": all(_is_like(before[name], after[name]) for name in ("shallowest_m", "deepest_m")),
            }


def _is_like(one_m: float, other_m: float) -> bool:
    """Return whether two depths are so close that coefficients hardly differ by a depth law; an unknown one is not."""
    return one_m < NARROWEST * other_m and other_m < NARROWEST * one_m


def _quantities(before: Entry, after: Entry, same_robot: bool) -> Iterator[tuple[str, Value, Value]]:
    a, b = [(each["speed_m_s"], each["speed_std_error_m_s"]) for each in (before, after)]
    yield SPEED, a, b
    for name in COEFFICIENTS:
        both: list[GatheredCoefficient] = [each["both"][name] for each in (before, after)]
        if not any(each.at_least for each in both):
            by_trials = same_robot and all(each.trials_error is not None for each in both)
            a, b = [(each.value, each.trials_error if by_trials else each.std_error) for each in both]
            yield name, a, b


def is_shown(difference: Mapping[str, Any]) -> bool | None:
    """Return whether the runs differ; None where the logs do not show it."""
    error = difference["std_error"]
    return None if error is None else bool(abs(difference["difference"]) > SHOWN * error)


def flipper_difference(left: GatheredCoefficient, right: GatheredCoefficient) -> Value:
    """Return right minus left: two flippers have motors, and so torque constants, of their own."""
    if left.value is None or right.value is None or left.at_least or right.at_least:
        return None, None
    errors = (left.std_error, right.std_error)
    return right.value - left.value, None if None in errors else hypot(*(error or 0.0 for error in errors))
