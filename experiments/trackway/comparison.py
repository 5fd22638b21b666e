"""Three muds in a row, walked with two fixed depths and with chosen ones: Table I and figure 8F of the paper.

After section III-D: the trackway of 1.83 m holds mud of 48.5, 53.1 and 45.3 % of water, here in the clay of the
simulator with the disturbances of the authors' logs. A walk ends when the plates would go down past the end, after 90 s
in one mud, or by a fault. Beside the table stands what a constant depth could have done at best: every depth in each
mud alone, on a long track.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from experiments.trackway.depth_rule import DepthRule, chosen_by, configuration_for, constant_depth, walk_by
from experiments.trackway.one_mud import (
    CONSTANT_STRIDES,
    MudWalk,
    best_depth,
    constant_walks,
    depths_m,
    mean_speeds_cm_s,
    run_mud_walk,
)
from experiments.trackway.paper_table import ADAPTIVE, FIXED_DEPTHS_M, PAPER_TABLE
from experiments.trackway.speed_table import cell, mean_over_muds, within_one_sd
from experiments.trackway.walk import Walk, WalkedStride, walk_of
from experiments.trials.notebook import Notebook
from experiments.trials.parallel_trials import run_parallel
from experiments.trials.session import Show
from simulation.mud.clay import MUDS, Clay
from simulation.mud.disturbances import LAB
from simulation.mud.track import COMPARTMENT_M, Track

STUCK_S = 90.0  # of walking in one mud
FIXED = tuple(constant_depth(depth_m) for depth_m in FIXED_DEPTHS_M.values())


@dataclass(frozen=True)
class Plan:
    rules: tuple[DepthRule, ...] = (*FIXED, chosen_by("default", ADAPTIVE))
    muds: tuple[Clay, ...] = tuple(MUDS.values())
    compartment_m: float = COMPARTMENT_M
    seeds: int = 3  # as the paper
    constant_depths_m: tuple[float, ...] = depths_m(0.0025)
    constant_seeds: int = 1

    @property
    def kept(self) -> dict[str, Any]:
        """What may not change where an experiment goes on."""
        return {
            "experiment": "trackway",
            "simulated": True,
            "methods": [rule.method for rule in self.rules if rule.method],
            "muds": [[clay.name, clay.strength_pa] for clay in self.muds],
            "compartment_m": self.compartment_m,
        }

    def walks(self) -> dict[str, Callable[[], Walk]]:
        """By key in the notebook; the longest begin first, so that the last ones end together."""
        long = {
            f"{rule.name}, trial {seed}": partial(walk_trackway, rule, self.muds, self.compartment_m, seed)
            for rule in self.rules
            for seed in range(1, self.seeds + 1)
        }
        constant = {
            f"{order.clay.name}, {order.rule.name}, seed {order.seed}": partial(run_mud_walk, order)
            for order in self.constant_walks()
        }
        return {**long, **constant}

    def constant_walks(self) -> list[MudWalk]:
        return constant_walks(self.muds, self.constant_depths_m, self.constant_seeds)


def rules_of(methods: Sequence[str]) -> tuple[DepthRule, ...]:
    """The fixed depths, the first method as "adaptive", the others by name. Raises ValueError for an unknown one."""
    first, *others = methods
    return (*FIXED, chosen_by(first, ADAPTIVE), *(chosen_by(each, f"{ADAPTIVE}, {each}") for each in others))


def walk_trackway(rule: DepthRule, muds: Sequence[Clay], compartment_m: float, seed: int) -> Walk:
    track = Track([(compartment_m, clay) for clay in muds])
    return walk_by(rule, track, seed, partial(is_over, track.length_m))


def is_over(length_m: float, strides: Sequence[WalkedStride]) -> bool:
    return bool(strides) and (is_past(length_m, strides[-1]) or is_stuck(strides))


def is_past(length_m: float, last: WalkedStride) -> bool:
    """Whether the plates go down behind the track next."""
    return last.position_m + last.step_m >= length_m


def is_stuck(strides: Sequence[WalkedStride]) -> bool:
    mud = strides[-1].mud
    return sum(stride.duration_s for stride in strides if stride.mud == mud) >= STUCK_S


def run(plan: Plan, notebook: Notebook, show: Show, processes: int | None = None) -> dict[str, Any]:
    """The report; what was walked is in the notebook."""
    orders = plan.walks()
    left = [key for key in orders if key not in notebook.entries]
    walked = len(orders) - len(left)
    run_parallel(
        [orders[key] for key in left],
        lambda done, _: show(walked + done, len(orders)),
        processes,
        keep=lambda place, walk: notebook.write(left[place], walk.entry),
    )
    walks = [walk_of(notebook.entries[key]) for key in orders]
    by_rule = {rule.name: walks[i * plan.seeds : (i + 1) * plan.seeds] for i, rule in enumerate(plan.rules)}
    return report_of(plan, by_rule, mean_speeds_cm_s(plan.constant_walks(), walks[len(plan.rules) * plan.seeds :]))


def report_of(plan: Plan, walks: dict[str, list[Walk]], constant_cm_s: dict[str, dict[float, float]]) -> dict[str, Any]:
    """`walks` by rule, `constant_cm_s` by mud and depth in metres."""
    arm_m = configuration_for(plan.rules[0]).geometry.flipper_length_m
    names = [clay.name for clay in plan.muds]
    best = {mud: best_depth(speeds) for mud, speeds in constant_cm_s.items()}
    beside_paper = paper_report(walks, names, arm_m)
    return beside_paper | {
        "best_constant_depth": best,
        "best_constant_mean_over_muds": round(sum(each["mean"] for each in best.values()) / len(best), 3),
        "over_best": {
            rule: {mud: _ratio(row[mud]["mean"], best[mud]["mean"]) for mud in names}
            for rule, row in beside_paper["table"].items()
        },
        "constant_depth_cm_s": {
            mud: {f"{100.0 * depth_m:g}": round(speed, 3) for depth_m, speed in speeds.items()}
            for mud, speeds in constant_cm_s.items()
        },
        "ends": {rule: dict(Counter(end_of(plan, trial) for trial in trials)) for rule, trials in walks.items()},
        "settings": _settings(plan),
    }


def paper_report(walks: Mapping[str, Sequence[Walk]], names: Sequence[str], arm_m: float) -> dict[str, Any]:
    """Trials by rule through muds of these names, wherever they were walked, and the paper's beside them."""
    cells = {rule: {mud: cell(trials, mud, arm_m) for mud in names} for rule, trials in walks.items()}
    return {
        "experiment": "trackway",
        "table": cells,
        "mean_over_muds": {
            rule: {figure: mean_over_muds(row, figure) for figure in ("mean", "mean_all")}
            for rule, row in cells.items()
        },
        "paper": {
            rule: {mud: reported._asdict() for mud, reported in row.items()} for rule, row in PAPER_TABLE.items()
        },
        "within_one_sd": {
            rule: {
                mud: within_one_sd(cells[rule][mud]["mean"], reported) for mud, reported in PAPER_TABLE[rule].items()
            }
            for rule in FIXED_DEPTHS_M
            if rule in cells and set(names) == set(PAPER_TABLE[rule])
        },
        "walks": {rule: [_strides_of(trial, arm_m) for trial in trials] for rule, trials in walks.items()},
    }


def end_of(plan: Plan, walk: Walk) -> str:
    """How a walk ended."""
    if walk.fault:
        return walk.fault
    last = walk.strides[-1]
    return "past the end" if is_past(plan.compartment_m * len(plan.muds), last) else f"stuck in {last.mud}"


def _ratio(mean: float | None, best: float) -> float | None:
    return None if mean is None or best <= 0.0 else round(mean / best, 3)


def _strides_of(walk: Walk, arm_m: float) -> list[dict[str, Any]]:
    return [
        {
            "mud": stride.mud,
            "place_cm": round(100.0 * stride.position_m, 2),
            "depth_cm": round(100.0 * stride.depth_m, 3),
            "step_cm": round(100.0 * stride.step_m, 2),
            "duration_s": round(stride.duration_s, 3),
            "failure": stride.failure(arm_m),
        }
        for stride in walk.strides
    ]


def _settings(plan: Plan) -> dict[str, Any]:
    return {
        "seeds": plan.seeds,
        "mud_length_cm": {clay.name: 100.0 * plan.compartment_m for clay in plan.muds},
        "methods": {rule.name: rule.method for rule in plan.rules if rule.method},
        "strength_pa": {clay.name: clay.strength_pa for clay in plan.muds},
        "constant_strides": CONSTANT_STRIDES,
        "constant_seeds": plan.constant_seeds,
        "disturbances": asdict(LAB),
    }
