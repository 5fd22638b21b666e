"""The plan of the experiment, and a short part of it in simulation."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from math import isfinite
from typing import Any

import pytest

import experiments.estimation.evaluation
from experiments.estimation.evaluation import (
    FIELD_OF_LAYER,
    LATENCY,
    LAYERS,
    REPEATS,
    TORQUE,
    Outcome,
    Part,
    Plan,
    evaluate,
    methods_of,
    report_of,
    run_part,
    with_layers,
)
from experiments.reports.error_table import COEFFICIENTS, ErrorRow, Evaluation, error_rows
from experiments.reports.report_page import to_json
from experiments.study.workers import LocalWorkers
from experiments.trials.latency import LATENCY_S
from experiments.trials.trial import MEASURING_WALK, SINGLE, TORQUE_ERROR, WALKING, Setup
from simulation.mud.clay import clay_of_water
from simulation.mud.disturbances import LAB, NONE, Disturbances
from simulation.mud.track import Track

STRONG = clay_of_water(47.6)
SHORT = Plan(single=(STRONG,), walking=(STRONG,), measuring=(), seeds=1, single_strides=1, walking_strides=2)


@cache
def evaluated() -> tuple[Outcome, Sequence[tuple[int, int]]]:
    """Simulate a single flipper for one stride and a walk of two strides; return the outcome and the shown progress."""
    shown: list[tuple[int, int]] = []
    return evaluate(SHORT, lambda done, total: shown.append((done, total)), LocalWorkers(1)), shown


def outcome() -> Outcome:
    return evaluated()[0]


@cache
def two_trials() -> list[Evaluation]:
    """Return evaluations of two seeds: a trial draws only one latency, surface and torque constant."""
    second = replace(SHORT, seeds=2).parts()[1::2]
    return outcome().evaluated + [each for part in second for each in run_part(part, SHORT).evaluated]


# the plan


def test_with_all_layers_it_is_the_laboratory() -> None:
    assert with_layers(Plan(), LAYERS) == Plan()


@pytest.mark.parametrize("layer", LAYERS)
def test_one_layer_is_that_layer_alone(layer: str) -> None:
    plan = with_layers(Plan(), (layer,))
    field = FIELD_OF_LAYER.get(layer)
    assert plan.disturbances == (replace(NONE, **{field: getattr(LAB, field)}) if field else NONE)
    assert (plan.repeats, plan.torque, plan.latency) == (layer == REPEATS, layer == TORQUE, layer == LATENCY)
    assert replace(plan, disturbances=LAB, repeats=True, torque=True, latency=True) == Plan()


def test_an_unknown_layer_is_named() -> None:
    with pytest.raises(ValueError, match=r"'fog': must be one of clinging, .*, or none"):
        with_layers(Plan(), ("noise", "fog"))


def test_the_plan_is_every_mud_and_seed_and_a_walk_over_borders_for_each_seed() -> None:
    plan = Plan(seeds=3)
    parts = plan.parts()
    transitions, alone = [p for p in parts if len(p.muds) > 1], [p for p in parts if len(p.muds) == 1]
    assert parts[: len(transitions)] == transitions  # the longest parts first
    assert parts[0].muds == parts[1].muds[::-1]
    assert [(p.setup, p.seed, p.strides) for p in transitions] == [(WALKING, seed, 24) for seed in (1, 2, 3)]
    setups = ((SINGLE, plan.single, 2), (WALKING, plan.walking, 8), (MEASURING_WALK, plan.measuring, 8))
    for setup, muds, strides in setups:
        reported = {(p.muds[0], p.seed) for p in alone if p.setup == setup and p.strides == strides}
        assert reported == {(mud, seed) for mud in muds for seed in (1, 2, 3)}
    assert len(alone) == 3 * (5 + 3 + 3)


def test_a_walk_is_also_evaluated_with_the_papers_drag_and_without_a_pose() -> None:
    single, walking = (
        [
            (each.name, each.setup, each.with_pose, each.parameters.method, each.parameters.paper.compensation)
            for each in methods_of(setup)
        ]
        for setup in (SINGLE, WALKING)
    )
    assert single == [
        ("default", "single flipper", True, "default", False),
        ("paper", "single flipper", True, "paper", False),
    ]
    assert walking == [
        ("default", "walking", True, "default", False),
        ("paper", "walking", True, "paper", False),
        ("paper compensated", "walking", True, "paper", True),
        ("default", "walking without pose", False, "default", False),
    ]
    for setup in (SINGLE, WALKING):
        assert {each.parameters.fixed_base for each in methods_of(setup)} == {setup is SINGLE}


# a short one in simulation


def rows_of(setup: str, coefficient: str, evaluated: Sequence[Evaluation]) -> dict[str, ErrorRow]:
    """Return the rows of this setup and coefficient by method."""
    rows = error_rows(evaluated)
    return {row.method: row for row in rows if (row.setup, row.coefficient) == (setup, coefficient)}


def test_the_measuring_walk_finds_k_e_where_the_quick_one_finds_too_little() -> None:
    """Without disturbances, in mud of 49.5 %: right after a stance an extraction pulls less."""
    muds = (clay_of_water(49.5),)
    plan = with_layers(Plan(single=(), walking=muds, measuring=muds, seeds=1, walking_strides=2), ())
    evaluations = evaluate(plan, lambda done, total: None, LocalWorkers(1)).evaluated
    quick, measuring = (rows_of(setup, "k_e", evaluations)["default"] for setup in ("walking", "measuring walk"))
    assert quick.bias is not None and measuring.bias is not None
    assert quick.bias < -0.08
    assert abs(measuring.bias) < 0.06


@pytest.mark.parametrize(
    ("setup", "coefficient"),
    [
        ("single flipper", "k_p"),
        ("single flipper", "k_s"),
        ("single flipper", "k_e"),
        ("walking", "k_p"),
        ("walking", "k_e"),
    ],
)
def test_the_default_is_closer_to_the_truth_than_the_paper(setup: str, coefficient: str) -> None:
    rows = rows_of(setup, coefficient, two_trials())
    assert rows["default"].strides == rows["paper"].strides == (4 if setup == "single flipper" else 8)
    assert (rows["default"].median or 1.0) < (rows["paper"].median or 0.0)


def test_where_the_walking_body_moves_the_default_gives_bounds_and_they_hold() -> None:
    for setup in ("walking", "walking without pose"):
        row = rows_of(setup, "k_s", outcome().evaluated)["default"]
        assert row.bounds + row.strides == 4
        assert row.bounds >= 2
        assert row.bounds_hold == 1.0


def test_each_stride_of_each_method_is_evaluated_once() -> None:
    evaluated = outcome().evaluated
    assert all(isfinite(each.truth) for each in evaluated)
    for setup, methods, strides in (("single flipper", 2, 2), ("walking", 3, 4), ("walking without pose", 1, 4)):
        reported = [each for each in evaluated if each.setup == setup]
        assert len(reported) == methods * strides * len(COEFFICIENTS)
    assert {each.mud for each in evaluated} == {"47.6"}
    assert outcome().transitions == []


def test_progress_counts_all_trials() -> None:
    assert evaluated()[1] == [(0, 2), (1, 2), (2, 2)]


def trial_of(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return the arguments with which a part of the plan is simulated."""
    asked: dict[str, Any] = {}

    def run_trial(
        setup: Setup, track: Track, disturbances: Disturbances, strides: int, seed: int, error: float, latency_s: float
    ) -> Any:
        asked.update(setup=setup, disturbances=disturbances, torque_error=error, latency_s=latency_s)
        raise InterruptedError

    monkeypatch.setattr(experiments.estimation.evaluation, "run_trial", run_trial)
    with pytest.raises(InterruptedError):
        run_part(Part(WALKING, (STRONG,), 1, 1), plan)
    return asked


@pytest.mark.parametrize(
    ("layer", "period_s", "error", "latency_s"),
    [(REPEATS, 0.005, 0.0, 0.0), (TORQUE, 0.0, 0.032, 0.0), (LATENCY, 0.0, 0.0, LATENCY_S)],
)
def test_rows_torque_constants_and_times_are_disturbed_as_asked(
    layer: str, period_s: float, error: float, latency_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = trial_of(with_layers(SHORT, (layer,)), monkeypatch)
    assert (asked["setup"].row_period_s, asked["torque_error"], asked["latency_s"]) == (period_s, error, latency_s)
    assert asked["setup"].gait == WALKING.gait
    assert asked["disturbances"] == NONE


def test_a_walk_over_a_border_reports_how_soon_the_estimate_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Strong mud follows after 10 cm; the first stride goes in at l sin 30° = 6 cm, and each is at most 12 cm long.

    So each flipper's transition is reported, and the estimate follows within three strides.
    """
    monkeypatch.setattr(experiments.estimation.evaluation, "COMPARTMENT_M", 0.1)
    soft = clay_of_water(51.2)
    outcome = run_part(Part(WALKING, (soft, STRONG), 5, 1), with_layers(SHORT, ()))
    assert outcome.evaluated == []
    assert {(each.before, each.after) for each in outcome.transitions} == {("51.2", "47.6")}
    assert sorted(each.flipper for each in outcome.transitions) == ["left", "right"]
    assert all(each.strides is not None and each.strides <= 3 for each in outcome.transitions)


# the report


def test_the_report_is_json_with_errors_plates_boundaries_and_settings() -> None:
    report = to_json(report_of(SHORT, outcome()))
    assert set(report) == {"experiment", "errors", "plates", "boundaries", "settings"}
    assert report["boundaries"] == []
    settings = report["settings"]
    assert (settings["seeds"], settings["torque_error"], settings["repeats"]) == (1, TORQUE_ERROR, True)
    assert settings["latency_s"] == LATENCY_S
    assert settings["single_strength_pa"] == {"47.6": round(STRONG.strength_pa, 1)}
