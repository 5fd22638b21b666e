"""How soon the robot notices another mud: walks over borders between muds that the robot does not know.

A transition begins with the first stride of a flipper whose insertion is in the next mud. The estimate has followed
once the flipper's current k_p is within FOLLOWED of the truth in that mud; the strides up to then are counted.
"""

from collections.abc import Mapping
from itertools import groupby, pairwise
from typing import Any

from pandas import DataFrame

from control.mud_estimate import MudEstimate
from experiments.trials.load_cell_truth import FlipperTruths
from experiments.trials.trial import Trial, replay_trial
from simulation.body.reference_sensor import StrideTruth

FOLLOWED = 0.2  # of the truth: two thirds of the smallest step between the muds


def transitions_of(trial: Trial, truths: FlipperTruths) -> list[dict[str, Any]]:
    """Return each step of a flipper from one mud into the next, with the strides until the estimate followed.

    They are None where it did not follow before the next border or the end. `truths` are by flipper and stride.
    """
    estimates = {stride.index: estimate for stride, estimate in replay_trial(trial, trial.configuration.estimation)}
    transitions: list[dict[str, Any]] = []
    for flipper in trial.configuration.rig.flippers:
        strides = [truth for truth in trial.truths if truth.flipper == flipper and truth.index in estimates]
        by_mud = [(mud, [*own]) for mud, own in groupby(strides, key=lambda stride: stride.ground.name)]
        for (before, _), (after, own) in pairwise(by_mud):
            close = [_is_close(stride, truths, estimates) for stride in own]
            followed = close.index(True) + 1 if True in close else None
            transitions.append({"before": before, "after": after, "flipper": flipper, "strides": followed})
    return transitions


def _is_close(stride: StrideTruth, truths: FlipperTruths, estimates: Mapping[int, MudEstimate]) -> bool:
    estimate, truth = estimates[stride.index].of(stride.flipper).k_p, truths[stride.flipper, stride.index].get("k_p")
    if estimate is None or truth is None:
        return False
    value, _ = estimate.at(max(stride.insertion.deepest_m, stride.stance.deepest_m))  # the depth that a stride reports
    return bool(abs(value / truth - 1.0) <= FOLLOWED)


def transition_rows(transitions: DataFrame) -> list[dict[str, Any]]:
    """Summarise all transitions between two muds: the fraction that the estimate followed within two strides."""
    groups = transitions.groupby(["before", "after"], sort=False)["strides"] if len(transitions) else ()
    return [
        {
            "from": before,
            "to": after,
            "transitions": len(strides),
            "within_two": round(float((strides <= 2).mean()), 4),
            "most_strides": "never" if strides.isna().any() else int(strides.max()),
        }
        for (before, after), strides in groups
    ]
