"""The result of a run first: how far, how fast, how many strides were good, what the muds are, and what went wrong."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from control.faults import FAULT_KINDS, Reaction
from experiments.pictures.recorded_walk import RecordedWalk
from experiments.pictures.stride_choice import Outcome
from experiments.reports.counted_nouns import counted
from experiments.run_report.mud_results import MudResult, Speed, count_outcomes, mud_results
from experiments.run_report.run import Run
from logs.fault_history import LoggedCause

DOING = {Outcome.GOOD: "good", Outcome.SLIPPING: "slipped", Outcome.STUCK: "stuck"}


@dataclass(frozen=True)
class Headline:
    walks: int
    motion: Speed = field(metadata={"flat": True})  # of all walks, from their first to their last known position
    strides: int
    outcomes: Mapping[str, int]
    muds: Sequence[MudResult]
    stops: int  # causes of faults that ended a walk or switched torque off
    warnings: int  # causes of faults that were only reported


def headline_of(run: Run) -> Headline:
    reactions = [reaction_of(cause) for cause in run.causes]
    return Headline(
        walks=len(run.walks),
        motion=travel_of(run.walks),
        strides=len(run.strides),
        outcomes=count_outcomes(run.strides),
        muds=mud_results(run),
        stops=sum(reaction > Reaction.WARN for reaction in reactions),
        warnings=sum(reaction is Reaction.WARN for reaction in reactions),
    )


def reaction_of(cause: LoggedCause) -> Reaction:
    """Return the hardest reaction to a cause and to what followed from it."""
    return max(FAULT_KINDS[name].reaction for name in (cause.name, *cause.consequences))


def travel_of(walks: Sequence[RecordedWalk]) -> Speed:
    """Return distance, time and mean speed of all walks; between two walks the robot may be moved."""
    distance_m = duration_s = 0.0
    for walk in walks:
        known = np.flatnonzero(np.isfinite(walk.body_x_m))
        if len(known):
            distance_m += float(walk.body_x_m[known[-1]] - walk.body_x_m[known[0]])
            duration_s += float(walk.time_s[known[-1]] - walk.time_s[known[0]])
    if not duration_s > 0.0:
        return Speed(None, None, None, None)
    return Speed(distance_m, duration_s, distance_m / duration_s, None)


def headline_sentences(run: Run, headline: Headline) -> list[str]:
    """Return the result in sentences; a CSV of the authors knows no faults."""
    faults = [_faults_sentence(headline)] if run.log else []
    return [_travel_sentence(headline), _strides_sentence(headline), *faults]


def _travel_sentence(headline: Headline) -> str:
    motion = headline.motion
    if not headline.walks:
        return "The robot did not walk."
    if motion.distance_m is None or motion.duration_s is None or motion.speed_m_s is None:
        return "The log has no position of the body: distance, speed and slip are not known."
    walks = f" in {headline.walks} walks" if headline.walks > 1 else ""
    speed = f"{100.0 * motion.speed_m_s:.1f} cm/s"
    return f"The robot walked {motion.distance_m:.2f} m in {motion.duration_s:.1f} s{walks}: {speed}."


def _strides_sentence(headline: Headline) -> str:
    if not headline.strides:
        return "No complete stride."
    known = [(number, DOING[outcome]) for outcome in DOING if (number := headline.outcomes[outcome])]
    text = ", ".join(f"{number} {doing}" for number, doing in known)
    return f"{counted(headline.strides, 'stride')}{': ' * bool(text)}{text}."


def _faults_sentence(headline: Headline) -> str:
    stops = f"{counted(headline.stops, 'fault')} stopped it" if headline.stops else "No fault stopped it"
    return f"{stops}; {counted(headline.warnings, 'warning')}." if headline.warnings else f"{stops}."
