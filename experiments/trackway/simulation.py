"""The simulated trackway: three muds in a row, walked at fixed and chosen depths. Table I and figure 8F of the paper.

After section III-D of the paper the trackway of 1.83 m holds mud of 48.5, 53.1 and 45.3 % of water, here in the
simulator's clay with the disturbances of the authors' logs. A walk ends when the plates would go down past the end,
after 90 s in one mud, or with a fault. The report compares each gait with the best that a constant depth could do: the
robot walks at every depth in each mud alone, on an endless track.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from math import fsum

from experiments.study.notebook import Notebook
from experiments.study.workers import Workers, run_parallel
from experiments.trackway.depth_rule import DepthRule, chosen_by, configuration_for, constant_depth, walk_by
from experiments.trackway.one_mud import (
    CONSTANT_STRIDES,
    BestDepth,
    MudWalk,
    best_depth,
    constant_walks,
    depths_m,
    mean_speeds_cm_s,
    run_mud_walk,
)
from experiments.trackway.report import ADAPTIVE, FIXED_DEPTHS_M, Settings, TrackwayReport, table_report
from experiments.trackway.walk import Walk, WalkedStride, walk_of
from experiments.trials.session import Show
from experiments.trials.trial import WALKING, configuration_of
from firmware_host.configuration.toml_records import parse_document
from simulation.mud.clay import MUDS, Clay
from simulation.mud.disturbances import TRACKWAY
from simulation.mud.track import COMPARTMENT_M, Track

STUCK_S = 90.0  # longest walking time in one mud
FIXED = tuple(constant_depth(depth_m) for depth_m in FIXED_DEPTHS_M.values())


@dataclass(frozen=True)
class SimulatedSettings(Settings):
    methods: Mapping[str, str]  # by gait
    strength_pa: Mapping[str, float]  # by mud
    constant_strides: int
    constant_seeds: int
    disturbances: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class SimulatedReport(TrackwayReport):
    """Table I next to the best constant depth in each mud."""

    settings: SimulatedSettings
    best_constant_depth: Mapping[str, BestDepth]  # by mud
    best_constant_mean_over_muds: float
    over_best: Mapping[str, Mapping[str, float | None]]  # speed over that of the best constant depth, by gait and mud
    constant_depth_cm_s: Mapping[str, Mapping[str, float]]  # by mud and depth in cm


@dataclass(frozen=True)
class Plan:
    rules: tuple[DepthRule, ...] = (*FIXED, chosen_by("default", ADAPTIVE))
    muds: tuple[Clay, ...] = tuple(MUDS.values())
    compartment_m: float = COMPARTMENT_M
    seeds: int = 3  # as in the paper
    constant_depths_m: tuple[float, ...] = depths_m(0.0025)
    constant_seeds: int = 1

    @property
    def identity(self) -> dict[str, object]:
        """The settings that must not change when an experiment is continued."""
        return {
            "experiment": "trackway",
            "simulated": True,
            "methods": [rule.method for rule in self.rules if rule.method],
            "muds": [[clay.name, clay.strength_pa] for clay in self.muds],
            "compartment_m": self.compartment_m,
            "disturbances": asdict(TRACKWAY),
            "configuration": parse_document(configuration_of(WALKING).text),
        }

    def walks(self) -> dict[str, Callable[[], Walk]]:
        """All walks by their key in the notebook. The longest begin first, so that the last ones end together."""
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

    @property
    def settings(self) -> SimulatedSettings:
        return SimulatedSettings(
            seeds=self.seeds,
            mud_length_cm={clay.name: 100.0 * self.compartment_m for clay in self.muds},
            methods={rule.name: rule.method for rule in self.rules if rule.method},
            strength_pa={clay.name: clay.strength_pa for clay in self.muds},
            constant_strides=CONSTANT_STRIDES,
            constant_seeds=self.constant_seeds,
            disturbances=asdict(TRACKWAY),
        )


def rules_of(methods: Sequence[str]) -> tuple[DepthRule, ...]:
    """Return the fixed depths, the first method as "adaptive", and the others by name.

    Raises ValueError for an unknown method.
    """
    first, *others = methods
    return (*FIXED, chosen_by(first, ADAPTIVE), *(chosen_by(each, f"{ADAPTIVE}, {each}") for each in others))


def walk_trackway(rule: DepthRule, muds: Sequence[Clay], compartment_m: float, seed: int) -> Walk:
    track = Track([(compartment_m, clay) for clay in muds])
    return walk_by(rule, track, seed, partial(is_over, track.length_m))


def is_over(length_m: float, strides: Sequence[WalkedStride]) -> bool:
    return bool(strides) and (is_past(length_m, strides[-1]) or is_stuck(strides))


def is_past(length_m: float, last: WalkedStride) -> bool:
    """Return whether the plates go down past the end of the track next."""
    return last.position_m + last.step_m >= length_m


def is_stuck(strides: Sequence[WalkedStride]) -> bool:
    mud = strides[-1].mud
    return fsum(stride.duration_s for stride in strides if stride.mud == mud) >= STUCK_S


def run(plan: Plan, notebook: Notebook, show: Show, workers: Workers | None = None) -> SimulatedReport:
    """Make every walk that is not in the notebook yet, write each down at once, and report all."""
    orders = plan.walks()
    left = [key for key in orders if key not in notebook.entries]
    walked = len(orders) - len(left)
    run_parallel(
        [orders[key] for key in left],
        lambda done, _: show(walked + done, len(orders)),
        workers,
        keep=lambda number, walk: notebook.write(left[number], walk.entry),
    )
    walks = [walk_of(notebook.entries[key]) for key in orders]
    by_rule = {rule.name: walks[i * plan.seeds : (i + 1) * plan.seeds] for i, rule in enumerate(plan.rules)}
    return report_of(plan, by_rule, mean_speeds_cm_s(plan.constant_walks(), walks[len(plan.rules) * plan.seeds :]))


def report_of(
    plan: Plan, walks: Mapping[str, Sequence[Walk]], constant_cm_s: Mapping[str, Mapping[float, float]]
) -> SimulatedReport:
    """`walks` are by gait, `constant_cm_s` by mud and depth in metres."""
    arm_m = configuration_for(plan.rules[0]).geometry.flipper_length_m
    best = {mud: best_depth(speeds) for mud, speeds in constant_cm_s.items()}
    ends = {rule: dict(Counter(end_of(plan, trial) for trial in trials)) for rule, trials in walks.items()}
    report = table_report(walks, arm_m, ends, plan.settings)
    return SimulatedReport(
        **vars(report),
        best_constant_depth=best,
        best_constant_mean_over_muds=round(fsum(each.mean for each in best.values()) / len(best), 3),
        over_best={
            rule: {mud: _ratio(cell.mean, best[mud].mean) for mud, cell in row.items()}
            for rule, row in report.table.items()
        },
        constant_depth_cm_s={
            mud: {f"{100.0 * depth_m:g}": round(speed, 3) for depth_m, speed in speeds.items()}
            for mud, speeds in constant_cm_s.items()
        },
    )


def end_of(plan: Plan, walk: Walk) -> str:
    """Describe how a walk ended."""
    if walk.fault:
        return walk.fault
    last = walk.strides[-1]
    return "past the end" if is_past(plan.compartment_m * len(plan.muds), last) else f"stuck in {last.mud}"


def _ratio(mean: float | None, best: float) -> float | None:
    return None if mean is None or best <= 0.0 else round(mean / best, 3)
