"""Speed against depth in mud from soup to firm clay, and the depth at which each method of adaptation settles.

In each mud the robot walks at constant depths, and then by each method, long enough for it to settle. A method is
evaluated from its third stride on: by its speed as a fraction of the best constant depth's, and by its failed strides.
The fields of the report are the keys of the summary in JSON.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from statistics import fmean, median

from experiments.study.workers import Workers, run_parallel
from experiments.trackway.depth_rule import METHODS, chosen_by, configuration_for
from experiments.trackway.one_mud import (
    CONSTANT_STRIDES,
    LEARNING,
    STARTING,
    BestDepth,
    MudWalk,
    best_depth,
    constant_walks,
    depths_m,
    mean_speeds_cm_s,
    run_mud_walk,
    speed_cm_s,
)
from experiments.trackway.report import count_failures
from experiments.trackway.walk import Walk
from experiments.trials.session import Show
from simulation.mud.clay import Clay
from simulation.mud.disturbances import TRACKWAY

STRENGTHS_PA = (300.0, 400.0, 500.0, 680.0, 1000.0, 1500.0, 2000.0, 2800.0, 3250.0, 4000.0, 5000.0, 6000.0)


@dataclass(frozen=True)
class Plan:
    strengths_pa: tuple[float, ...] = STRENGTHS_PA
    methods: tuple[str, ...] = METHODS
    depths_m: tuple[float, ...] = depths_m(0.0025)
    seeds: int = 2
    method_strides: int = 12

    def clays(self) -> list[Clay]:
        return [Clay(f"{strength_pa:g} Pa", strength_pa) for strength_pa in self.strengths_pa]

    def method_walks(self) -> list[MudWalk]:
        """Raises ValueError for an unknown method."""
        rules = [chosen_by(method) for method in self.methods]
        seeds = range(1, self.seeds + 1)
        return [
            MudWalk(clay, rule, seed, self.method_strides) for clay in self.clays() for rule in rules for seed in seeds
        ]


@dataclass(frozen=True)
class CountedStrides:
    strides: int
    failures: Mapping[str, int]
    faults: Sequence[str]  # that ended walks


@dataclass(frozen=True)
class ConstantDepth(CountedStrides):
    depth_cm: float
    mean: float  # cm/s


@dataclass(frozen=True)
class SettledMethod(CountedStrides):
    """A method after its second stride. The depth is a median; it is None where no walk had a third stride."""

    depth_cm: float | None
    depth_range_cm: tuple[float, float] | None
    mean: float  # cm/s
    fraction_of_best: float | None = field(metadata={"key": "share_of_best"})


@dataclass(frozen=True)
class SweptMud:
    strength_pa: float
    constant: Sequence[ConstantDepth]
    best: BestDepth
    methods: Mapping[str, SettledMethod]


@dataclass(frozen=True)
class Settings:
    methods: Sequence[str]
    seeds: int
    constant_strides: int
    method_strides: int
    disturbances: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class SweepReport:
    experiment: str = "sweep"
    strengths: Sequence[SweptMud]
    settings: Settings


Walked = tuple[MudWalk, Walk]


def run(plan: Plan, show: Show, workers: Workers | None = None) -> SweepReport:
    orders = plan.method_walks() + constant_walks(plan.clays(), plan.depths_m, plan.seeds)  # the longest first
    walks = run_parallel([partial(run_mud_walk, order) for order in orders], show, workers)
    return report_of(plan, list(zip(orders, walks, strict=True)))


def report_of(plan: Plan, walked: Sequence[Walked]) -> SweepReport:
    strengths = [_swept_mud(clay, [each for each in walked if each[0].clay == clay]) for clay in plan.clays()]
    settings = Settings(plan.methods, plan.seeds, CONSTANT_STRIDES, plan.method_strides, asdict(TRACKWAY))
    return SweepReport(strengths=strengths, settings=settings)


def _swept_mud(clay: Clay, walked: Sequence[Walked]) -> SweptMud:
    constant = [(order, walk) for order, walk in walked if not order.rule.method]
    speeds = mean_speeds_cm_s(*zip(*constant, strict=True))[clay.name]
    best = best_depth(speeds)
    methods = dict.fromkeys(order.rule.method for order, _ in walked if order.rule.method)
    by_depth = {depth_m: [walk for order, walk in constant if order.rule.depth_m == depth_m] for depth_m in speeds}
    by_method = {method: [walk for order, walk in walked if order.rule.method == method] for method in methods}
    return SweptMud(
        clay.strength_pa,
        [
            ConstantDepth(*_count(by_depth[depth_m], STARTING), round(100.0 * depth_m, 4), round(speed, 3))
            for depth_m, speed in speeds.items()
        ],
        best,
        {method: _settled(walks, best.mean) for method, walks in by_method.items()},
    )


def _settled(walks: Sequence[Walk], best_cm_s: float) -> SettledMethod:
    depths = [stride.depth_m for walk in walks for stride in walk.strides[LEARNING:]]
    mean = fmean(speed_cm_s(walk, LEARNING) for walk in walks)
    return SettledMethod(
        *_count(walks, LEARNING),
        depth_cm=round(100.0 * median(depths), 3) if depths else None,
        depth_range_cm=(round(100.0 * min(depths), 3), round(100.0 * max(depths), 3)) if depths else None,
        mean=round(mean, 3),
        fraction_of_best=round(mean / best_cm_s, 3) if best_cm_s > 0.0 else None,
    )


def _count(walks: Sequence[Walk], skipped: int) -> tuple[int, Mapping[str, int], Sequence[str]]:
    """Return how many strides count, how many of them failed, and the faults."""
    arm_m = configuration_for(chosen_by(METHODS[0])).geometry.flipper_length_m
    counted = [walk.strides[skipped:] for walk in walks]
    faults = sorted({walk.fault for walk in walks if walk.fault})
    return sum(len(strides) for strides in counted), count_failures(counted, arm_m), faults
