"""The accuracy of the mud coefficients: estimates against a virtual load cell, over muds, trials and methods.

After the paper's sections III-B and III-C: a single flipper on a fixed base through five muds, the walking robot
through three muds and over their borders, and through the same three with the protocol `measuring`, in the simulator's
clay with the disturbances of the authors' logs. Each trial is simulated once, and every method estimates from the same
samples. The fields of the report are the keys of the summary in JSON.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain
from math import isfinite
from typing import NamedTuple

from estimation.estimation_parameters import EstimationParameters
from experiments.estimation.boundaries import BoundaryRow, Transition, boundary_rows, transitions_of
from experiments.reports.error_table import COEFFICIENTS, ErrorRow, Evaluation, PlateRow, error_rows, plate_rows
from experiments.study.workers import Workers, run_parallel
from experiments.trials.estimation_methods import COMPENSATED, DEFAULT, PAPER, with_method
from experiments.trials.latency import LATENCY_S
from experiments.trials.load_cell_truth import LoadCellTruth, load_cell_truth
from experiments.trials.session import Show
from experiments.trials.trial import MEASURING_WALK, SINGLE, TORQUE_ERROR, WALKING, Setup, Trial, run_trial, strides_of
from simulation.mud.clay import Clay, clay_of_water
from simulation.mud.disturbances import LAB, NONE, Disturbances
from simulation.mud.track import Track

SINGLE_WATERS = (47.6, 48.6, 49.5, 50.3, 51.2)  # figure 5 of the paper
WALKING_WATERS = (47.6, 49.5, 51.2)  # figure 6
ENDLESS_M = 100.0
COMPARTMENT_M = 0.5
REPEATS, TORQUE, LATENCY = "repeats", "torque", "latency"
LAYERS_OF_TRIAL = (REPEATS, TORQUE, LATENCY)  # of the samples and of what is known, not of mud and drives
FIELD_OF_LAYER = {
    "clinging": "clinging_n",
    "shaking": "shaken_fraction",
    "remoulding": "remoulding",
    "relaxation": "relaxation",
    "surface": "surface_sd_m",
    "trial-surface": "trial_surface_sd_m",
    "sweep-friction": "sweep_friction_nm",
    "adduction-friction": "adduction_friction_nm",
    "noise": "current_noise_a",
    "saturation": "current_limit_a",
}
LAYERS = (*FIELD_OF_LAYER, *LAYERS_OF_TRIAL)


class Method(NamedTuple):
    name: str
    setup: str  # its name in the table
    with_pose: bool
    parameters: EstimationParameters


@dataclass(frozen=True)
class Plan:
    """The trials to run.

    `repeats`: rows come more often than new samples. `torque`: torque constants have errors. `latency`: currents or
    angles are late.
    """

    single: tuple[Clay, ...] = tuple(clay_of_water(water) for water in SINGLE_WATERS)
    walking: tuple[Clay, ...] = tuple(clay_of_water(water) for water in WALKING_WATERS)
    measuring: tuple[Clay, ...] = tuple(clay_of_water(water) for water in WALKING_WATERS)
    seeds: int = 10
    single_strides: int = 2
    walking_strides: int = 8
    transition_strides: int = 24
    disturbances: Disturbances = LAB
    repeats: bool = True
    torque: bool = True
    latency: bool = True

    def parts(self) -> list[Part]:
        """Return the trials, the longest first, so that the last ones end together."""
        seeds = range(1, self.seeds + 1)
        orders = (self.walking, self.walking[::-1])
        transitions = [Part(WALKING, orders[seed % 2], self.transition_strides, seed) for seed in seeds]
        single = [Part(SINGLE, (clay,), self.single_strides, seed) for clay in self.single for seed in seeds]
        walks = [(setup, clay) for setup, muds in self._walks() for clay in muds]
        walking = [Part(setup, (clay,), self.walking_strides, seed) for setup, clay in walks for seed in seeds]
        return (transitions if len(self.walking) > 1 else []) + single + walking

    def _walks(self) -> tuple[tuple[Setup, tuple[Clay, ...]], ...]:
        return (WALKING, self.walking), (MEASURING_WALK, self.measuring)


class Part(NamedTuple):
    """One trial of a plan: over one mud, or over several in a row."""

    setup: Setup
    muds: tuple[Clay, ...]
    strides: int
    seed: int


class Outcome(NamedTuple):
    evaluated: list[Evaluation]
    transitions: list[Transition]


def with_layers(plan: Plan, layers: Sequence[str]) -> Plan:
    """Return the plan with these disturbances only. Raises ValueError for an unknown one."""
    unknown = [layer for layer in layers if layer not in LAYERS]
    if unknown:
        raise ValueError(f"layer {unknown[0]!r}: must be one of {', '.join(LAYERS)}, or none")
    fields = {field: getattr(LAB, field) for layer, field in FIELD_OF_LAYER.items() if layer in layers}
    repeats, torque, latency = (layer in layers for layer in LAYERS_OF_TRIAL)
    return replace(plan, disturbances=replace(NONE, **fields), repeats=repeats, torque=torque, latency=latency)


def methods_of(setup: Setup) -> tuple[Method, ...]:
    """Return the methods to evaluate. All know how uneven the mud is, as an operator would see."""
    known = EstimationParameters(fixed_base=setup.fixed_base, surface_error_m=LAB.surface_error_m)
    names = (DEFAULT, PAPER) if setup.fixed_base else (DEFAULT, PAPER, COMPENSATED)
    methods = [Method(name, setup.name, True, with_method(known, name)) for name in names]
    without_pose = Method(DEFAULT, f"{setup.name} without pose", False, known)
    return tuple(methods) if setup.fixed_base else (*methods, without_pose)


def evaluate(plan: Plan, show: Show, workers: Workers | None = None) -> Outcome:
    """Run all trials of a plan in parallel."""
    outcomes = run_parallel([partial(run_part, part, plan) for part in plan.parts()], show, workers)
    evaluated, transitions = zip(*outcomes, strict=True)
    return Outcome(list(chain(*evaluated)), list(chain(*transitions)))


def run_part(part: Part, plan: Plan) -> Outcome:
    """Simulate one trial and evaluate every method on it, or its transitions between muds."""
    length_m = ENDLESS_M if len(part.muds) == 1 else COMPARTMENT_M
    track = Track([(length_m, clay) for clay in part.muds])
    setup = part.setup if plan.repeats else replace(part.setup, row_period_s=0.0)
    torque_error = TORQUE_ERROR if plan.torque else 0.0
    latency_s = LATENCY_S if plan.latency else 0.0
    trial = run_trial(setup, track, plan.disturbances, part.strides, part.seed, torque_error, latency_s)
    truths = {
        (truth.flipper, truth.index): load_cell_truth(
            truth, trial.configuration.geometry, plan.disturbances.relaxation, setup.gait.pause_s
        )
        for truth in trial.truths
    }
    if len(part.muds) > 1:
        return Outcome([], transitions_of(trial, truths))
    (clay,) = part.muds
    evaluated = [_evaluate_method(method, clay.name, trial, truths) for method in methods_of(setup)]
    return Outcome(list(chain.from_iterable(evaluated)), [])


def _evaluate_method(
    method: Method, mud: str, trial: Trial, truths: Mapping[tuple[str, int], LoadCellTruth]
) -> Iterator[Evaluation]:
    for stride in strides_of(trial, method.parameters, method.with_pose):
        truth = truths.get((stride.flipper, stride.index))
        if truth is None:
            continue
        for name in COEFFICIENTS:
            estimate, leaning, upright = (getattr(each, name) for each in (stride, *truth))
            if isfinite(leaning):
                yield Evaluation(method.setup, mud, name, method.name, estimate, leaning, upright)


@dataclass(frozen=True)
class Settings:
    seeds: int
    single_strength_pa: Mapping[str, float]
    walking_strength_pa: Mapping[str, float]
    measuring_strength_pa: Mapping[str, float]
    disturbances: Mapping[str, float]
    repeats: bool
    torque_error: float
    latency_s: float  # largest of a trial


@dataclass(frozen=True, kw_only=True)
class EstimationReport:
    experiment: str = "estimation"
    errors: Sequence[ErrorRow]
    plates: Sequence[PlateRow]
    boundaries: Sequence[BoundaryRow]
    settings: Settings


def report_of(plan: Plan, outcome: Outcome) -> EstimationReport:
    return EstimationReport(
        errors=error_rows(outcome.evaluated),
        plates=plate_rows(outcome.evaluated),
        boundaries=boundary_rows(outcome.transitions),
        settings=Settings(
            seeds=plan.seeds,
            single_strength_pa=_strengths_pa(plan.single),
            walking_strength_pa=_strengths_pa(plan.walking),
            measuring_strength_pa=_strengths_pa(plan.measuring),
            disturbances=asdict(plan.disturbances),
            repeats=plan.repeats,
            torque_error=TORQUE_ERROR if plan.torque else 0.0,
            latency_s=LATENCY_S if plan.latency else 0.0,
        ),
    )


def _strengths_pa(muds: Sequence[Clay]) -> dict[str, float]:
    return {clay.name: round(clay.strength_pa, 1) for clay in muds}
