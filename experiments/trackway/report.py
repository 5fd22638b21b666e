"""The report of the trackway experiment: Table I of the paper from walks, and the paper's own numbers next to it.

The speed of a trial in a mud is the distance over the time of its strides in that mud. Each cell has two speeds: one
over all strides that began in the mud (`mean_all`), and one over the strides after the second (`mean`), because an
adaptive robot still learns the mud in the first two. A trial with fewer than three strides in a mud counts with all of
them in both (`short_trials`). The fields of these records are the keys of the summary in JSON.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean, stdev

from experiments.trackway.one_mud import LEARNING
from experiments.trackway.walk import Walk, WalkedStride, speed_m_s


@dataclass(frozen=True)
class Speed:
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


@dataclass(frozen=True)
class SpeedCell:
    """One gait in one mud, over the trials that reached the mud. Speeds are in cm/s, None where no trial did."""

    mean: float | None
    sd: float | None
    mean_all: float | None
    sd_all: float | None
    trials: int
    short_trials: int
    strides: int
    failures: Mapping[str, int]
    failures_after_second: Mapping[str, int]


@dataclass(frozen=True)
class StrideReport:
    mud: str
    position_cm: float = field(metadata={"key": "place_cm"})
    depth_cm: float
    step_cm: float
    duration_s: float
    failure: str


@dataclass(frozen=True)
class Settings:
    seeds: int  # trials of each gait
    mud_length_cm: Mapping[str, float]


@dataclass(frozen=True)
class MeanOverMuds:
    mean: float | None
    mean_all: float | None


@dataclass(frozen=True, kw_only=True)
class TrackwayReport:
    """Mappings are by gait, then by mud."""

    experiment: str = "trackway"
    table: Mapping[str, Mapping[str, SpeedCell]]
    mean_over_muds: Mapping[str, MeanOverMuds]
    paper: Mapping[str, Mapping[str, Speed]]
    within_one_sd: Mapping[str, Mapping[str, bool | None]]
    walks: Mapping[str, Sequence[Sequence[StrideReport]]]
    ends: Mapping[str, Mapping[str, int]]  # how many walks ended in each way
    settings: Settings


def table_report(
    walks: Mapping[str, Sequence[Walk]], arm_m: float, ends: Mapping[str, Mapping[str, int]], settings: Settings
) -> TrackwayReport:
    """Report trials by gait, wherever they were walked. `arm_m` is the length of a flipper."""
    names = list(settings.mud_length_cm)
    table = {rule: {mud: speed_cell(trials, mud, arm_m) for mud in names} for rule, trials in walks.items()}
    return TrackwayReport(
        table=table,
        mean_over_muds={rule: mean_over_muds(list(row.values())) for rule, row in table.items()},
        paper=PAPER_TABLE,
        within_one_sd={
            rule: {mud: within_one_sd(table[rule][mud].mean, paper) for mud, paper in PAPER_TABLE[rule].items()}
            for rule in FIXED_DEPTHS_M
            if rule in table and set(names) == set(PAPER_TABLE[rule])
        },
        walks={rule: [_stride_reports(trial, arm_m) for trial in trials] for rule, trials in walks.items()},
        ends=ends,
        settings=settings,
    )


def speed_cell(walks: Sequence[Walk], mud: str, arm_m: float) -> SpeedCell:
    trials = [strides for walk in walks if (strides := walk.in_mud(mud))]
    later = [strides[LEARNING:] for strides in trials]
    speeds = [_speed_cm_s(after or strides) for after, strides in zip(later, trials, strict=True)]
    speeds_all = [_speed_cm_s(strides) for strides in trials]
    return SpeedCell(
        mean=_mean(speeds),
        sd=_sd(speeds),
        mean_all=_mean(speeds_all),
        sd_all=_sd(speeds_all),
        trials=len(trials),
        short_trials=sum(not after for after in later),
        strides=sum(len(strides) for strides in trials),
        failures=count_failures(trials, arm_m),
        failures_after_second=count_failures(later, arm_m),
    )


def count_failures(trials: Sequence[Sequence[WalkedStride]], arm_m: float) -> dict[str, int]:
    """Count the failed strides by the name of the failure."""
    names = Counter(stride.failure(arm_m) for strides in trials for stride in strides)
    return {name: names[name] for name in sorted(names) if name}


def within_one_sd(mean: float | None, paper: Speed) -> bool | None:
    return None if mean is None else abs(mean - paper.mean) <= paper.sd


def mean_over_muds(cells: Sequence[SpeedCell]) -> MeanOverMuds:
    """Average over muds with equal weight; None where a mud was never reached."""
    return MeanOverMuds(_mean([cell.mean for cell in cells]), _mean([cell.mean_all for cell in cells]))


def _stride_reports(walk: Walk, arm_m: float) -> list[StrideReport]:
    return [
        StrideReport(
            stride.mud,
            round(100.0 * stride.position_m, 2),
            round(100.0 * stride.depth_m, 3),
            round(100.0 * stride.step_m, 2),
            round(stride.duration_s, 3),
            stride.failure(arm_m),
        )
        for stride in walk.strides
    ]


def _speed_cm_s(strides: Sequence[WalkedStride]) -> float:
    return 100.0 * speed_m_s(strides)


def _mean(speeds: Sequence[float | None]) -> float | None:
    known = [speed for speed in speeds if speed is not None]
    return round(fmean(known), 3) if known and len(known) == len(speeds) else None


def _sd(speeds: Sequence[float]) -> float | None:
    """Return the standard deviation between trials; None for fewer than two."""
    return round(stdev(speeds), 3) if len(speeds) > 1 else None
