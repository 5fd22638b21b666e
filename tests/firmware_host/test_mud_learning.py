"""Learning from synthetic strides: their numbering, the chosen depths, and coefficients out of bounds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import inf, nan
from typing import Any

import pytest

from control.computing.bounded_work import finished
from control.controller import WalkOrder
from control.depth.gait_choice import GaitAdaptation
from control.faults import Fault, FaultKind
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPhase
from control.records import NO_LOAD, Estimate, FlipperLoad, GaitTarget, Phase, StrideEstimate
from firmware_host.configuration.configuration import Configuration
from firmware_host.mud_learning import FIRM_TICKS, LARGEST_N_M3, STORED_STRIDES, MudLearning
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track

GOOD = Estimate(2e6, 1e5, 100, True)


def stride(flipper: str = "left", index: int = 0, **changes: Any) -> StrideEstimate:
    values: dict[str, Any] = {
        "k_p": GOOD, "k_s": GOOD, "k_e": GOOD, "surface_m": 0.0, "depth_m": 0.03, "released": True,
        "insertion_force_n": 2.0, "stance_force_n": 1.0, "extraction_force_n": -1.0, "step_m": 0.05,
    }  # fmt: skip
    return StrideEstimate(flipper, index, 0.0, 2.0, 0.5, 0.5, 0.2, **(values | changes))


@dataclass
class FakeGait:
    """The part of a gait that learning uses."""

    stride: int = 0
    commanded_depth_m: float = 0.03
    next_depth_m: float = 0.03
    parameters: GaitParameters = GaitParameters()
    next_parameters: GaitParameters = GaitParameters()
    conditions: GaitPhase | None = None
    ended: int = 0

    def is_choice_due(self, within_s: float, may_turn: bool) -> bool:
        return False

    def end_phase(self) -> bool:
        self.ended += 1
        return self.ended == 1


@dataclass
class FakeController:
    order: WalkOrder
    gait: FakeGait = field(default_factory=FakeGait)
    target: GaitTarget = GaitTarget(Phase.INSERTION, 0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def learning(configuration: Configuration) -> MudLearning:
    made = MudLearning(configuration)
    made.reset(0.03)
    return made


def step(
    learning: MudLearning,
    controller: FakeController,
    *strides: StrideEstimate,
    loads: tuple[FlipperLoad, ...] = (),
) -> tuple[list[Any], list[str]]:
    """Let one tick close these strides, and run all units of the work."""
    learning.loads, learning._closing = loads, finished(strides) if strides else None
    learning.estimator.felt_strides = strides
    learning.adapt(controller)  # type: ignore[arg-type]
    closed, messages = learning.finish()
    return list(closed), list(messages)


def test_strides_of_both_flippers_are_numbered_through(learning: MudLearning) -> None:
    controller = FakeController(WalkOrder(0.04, adaptive=False))
    numbers = []
    for index in range(3):
        closed, _ = step(learning, controller, stride("left", index), stride("right", index))
        numbers += [(each.number, each.estimate.flipper, each.chosen_depth_m) for each in closed]
    assert numbers == [(number, ("left", "right")[number % 2], 0.04) for number in range(6)]
    assert learning.strides_closed == 6


def test_a_fixed_depth_does_not_depend_on_the_mud(learning: MudLearning) -> None:
    controller = FakeController(WalkOrder(0.045, adaptive=False))
    step(learning, controller, stride(k_p=Estimate(1e9, 1.0, 100, True)))
    assert controller.gait.next_depth_m == 0.045


@pytest.mark.parametrize("begun", [WalkOrder(0.03), WalkOrder(0.03, adaptive=False, depths_m=(0.03, 0.04))])
def test_strides_that_an_operator_fixes_while_the_next_one_is_chosen_stay_fixed(
    learning: MudLearning, begun: WalkOrder
) -> None:
    """The choice takes some 30 ticks; it had put back the depth and, for the rest of the walk, the gait."""
    controller, slow = FakeController(begun), replace(GaitParameters(), stance_speed_m_s=0.25)
    learning.finish()
    learning._closing, learning.estimator.felt_strides = finished((stride(),)), (stride(),)
    learning.adapt(controller)  # type: ignore[arg-type]
    learning.step(controller, 0.0)  # type: ignore[arg-type]
    controller.order = WalkOrder(0.02, adaptive=False)
    controller.gait.next_depth_m, controller.gait.next_parameters = 0.02, slow
    (closed,), _ = learning.finish()
    assert (controller.gait.next_depth_m, controller.gait.next_parameters) == (0.02, slow)
    assert (closed.chosen_depth_m, learning.depth_reason) == (0.02, "fixed")


def test_only_the_latest_strides_are_stored_but_all_are_counted(learning: MudLearning) -> None:
    controller = FakeController(WalkOrder(0.03, adaptive=False))
    for index in range(STORED_STRIDES + 50):
        step(learning, controller, stride("left", index))
    assert len(learning.strides) == STORED_STRIDES
    assert learning.strides_closed == STORED_STRIDES + 50
    assert learning.strides[-1].number == STORED_STRIDES + 49


def test_a_new_walk_preserves_earlier_strides(learning: MudLearning) -> None:
    step(learning, FakeController(WalkOrder(0.03, adaptive=False)), stride())
    learning.reset(0.03)
    assert len(learning.strides) == learning.strides_closed == 1


@pytest.mark.parametrize(("phase", "messages"), [(Phase.SWING, 1), (Phase.INSERTION, 2), (Phase.STANCE, 2)])
def test_a_depth_that_comes_after_the_insertion_began_is_logged_as_late(
    learning: MudLearning, phase: Phase, messages: int
) -> None:
    controller = FakeController(WalkOrder(0.03), target=GaitTarget(phase, 0, 0.0, 0.0, 0.0, 0.0))
    closed = stride(released=False, depth_m=0.03)
    _, reported = step(learning, controller, closed)
    assert controller.gait.next_depth_m != 0.03
    assert len(reported) == messages


# firm mud


def firm_ticks(learning: MudLearning, order: WalkOrder, phase: Phase, loads: list[bool]) -> list[bool]:
    """Return in which ticks the gait was requested to end its insertion."""
    target = GaitTarget(phase, 0, 0.0, 0.0, 0.02, 0.1)
    controller = FakeController(order, target=target)
    limit_nm = learning.adaptation.largest_insertion_nm
    reported = []
    for firm in loads:
        load = NO_LOAD._replace(adduction_torque_nm=limit_nm + 0.01 if firm else limit_nm)
        before = controller.gait.ended
        step(learning, controller, loads=(NO_LOAD, load))
        reported.append(controller.gait.ended > before)
    return reported


def test_an_insertion_ends_at_a_lasting_load_but_not_at_an_outlier(learning: MudLearning) -> None:
    adaptive = WalkOrder(0.03, adaptive=True)
    assert firm_ticks(learning, adaptive, Phase.INSERTION, [True] * 4) == [False] * (FIRM_TICKS - 1) + [True, True]
    learning.reset(0.03)
    assert not any(firm_ticks(learning, adaptive, Phase.INSERTION, [True, True, False] * 5))


@pytest.mark.parametrize(
    ("adaptive", "phase"), [(False, Phase.INSERTION), (True, Phase.STANCE), (True, Phase.EXTRACTION)]
)
def test_only_adaptive_insertions_end_early(learning: MudLearning, adaptive: bool, phase: Phase) -> None:
    assert not any(firm_ticks(learning, WalkOrder(0.03, adaptive=adaptive), phase, [True] * 10))


@pytest.mark.parametrize(("phase", "ended"), [(Phase.STROKE, 1), (Phase.REST, 0)])
def test_a_condition_counts_only_while_the_flippers_follow_the_gait(
    learning: MudLearning, phase: Phase, ended: int
) -> None:
    """Flippers that a walk first raises out of the mud had ended the first phase before it began."""
    controller = FakeController(
        WalkOrder(0.03, adaptive=False), FakeGait(conditions=GaitPhase("stance", until_force_n=1.0))
    )
    controller.target = controller.target._replace(phase=phase)
    for _ in range(FIRM_TICKS):
        step(learning, controller, loads=(NO_LOAD._replace(force_x_n=-1.5),))
    assert controller.gait.ended == ended


def test_the_early_end_of_an_insertion_is_logged_once(learning: MudLearning) -> None:
    controller = FakeController(WalkOrder(0.03))
    load = NO_LOAD._replace(adduction_torque_nm=10.0)
    reported = [message for _ in range(10) for message in step(learning, controller, loads=(load, load))[1]]
    assert reported == ["insertion ended at 0.0300 m: solid mud"]


def test_a_walk_in_another_gait_prepares_its_choices_one_candidate_a_unit(configuration: Configuration) -> None:
    learning = MudLearning(replace(configuration, adaptation=replace(configuration.adaptation, method="gait")))
    learning.finish()
    learning.reset(0.03, GaitParameters(stance_speed_m_s=0.05))
    adaptation, prepared = learning.adaptation, []
    assert isinstance(adaptation, GaitAdaptation)
    while not learning.estimator.work.is_empty:
        learning.estimator.work.run(1)
        prepared.append(len(adaptation.candidates))
    assert prepared[:-1] == list(range(1, len(prepared)))
    assert {each.gait.stance_speed_m_s for each in adaptation.candidates} == {0.05}


# wild coefficients


def faults_of(learning: MudLearning, closed: StrideEstimate) -> list[Fault]:
    step(learning, FakeController(WalkOrder(0.03, adaptive=False)), closed)
    return learning.pop_faults()


WILD = [
    *(Estimate(value, 1e5, 100, True) for value in (nan, inf, -inf, LARGEST_N_M3, -1.01 * LARGEST_N_M3)),
    *(Estimate(2e6, std_error, 100, True) for std_error in (nan, inf, LARGEST_N_M3)),
]


@pytest.mark.parametrize("name", ["k_p", "k_s", "k_e"])
@pytest.mark.parametrize("estimate", WILD)
def test_a_coefficient_beyond_any_mud_is_a_fault_for_one_tick(
    learning: MudLearning, name: str, estimate: Estimate
) -> None:
    assert faults_of(learning, stride("right", 7, **{name: estimate})) == [
        FaultKind.ESTIMATE_WILD.fault("right", stride=7)
    ]
    assert learning.pop_faults() == []


@pytest.mark.parametrize(
    "estimate",
    [
        GOOD,
        Estimate(0.99 * LARGEST_N_M3, 1e5, 100, True),
        Estimate(nan, nan, 0, False, "no samples"),  # is marked as not valid
        Estimate(-1e4, 1e5, 100, True),  # within its uncertainty of zero
    ],
)
def test_coefficients_within_bounds_or_invalid_are_no_fault(learning: MudLearning, estimate: Estimate) -> None:
    assert faults_of(learning, stride(k_e=estimate)) == []


def test_wild_coefficients_never_lead_to_a_depth_out_of_bounds(
    learning: MudLearning, configuration: Configuration
) -> None:
    """The estimate of the mud rejects them; a depth is still chosen."""
    controller = FakeController(WalkOrder(0.03))
    estimator = learning.estimator
    for index, value in enumerate((nan, inf, -inf, 1e300, -1e300, 0.0)):
        wild = Estimate(value, abs(value), 100, True)
        strides = (stride("left", index, k_p=wild, k_s=wild, k_e=wild),)
        estimator.mud_estimate = estimator._knowledge.update(strides)
        step(learning, controller, *strides)
        bounds = configuration.adaptation
        assert bounds.min_depth_m <= controller.gait.next_depth_m <= bounds.max_depth_m


def test_a_stride_has_the_lowest_voltage_of_its_own_drives(configuration: Configuration) -> None:
    robot = Lockstep(configuration, paper_track(), seed=5)
    robot.arm()
    robot.walk(WalkOrder(0.03, True, 2))
    drive = robot.robot.drives[0]
    assert robot.run_until(lambda: robot.loop.target.phase is Phase.STANCE, 5.0)
    drive.parameters = replace(drive.parameters, bus_voltage_v=21.5)
    robot.run_for(0.2)
    drive.parameters = replace(drive.parameters, bus_voltage_v=24.0)
    assert robot.run_until(lambda: robot.loop.learning.strides_closed == 4, 10.0)
    assert [(each.estimate.flipper, each.supply_min_v) for each in robot.loop.learning.strides] == [
        ("left", 21.5),
        ("right", 24.0),
        ("left", 24.0),
        ("right", 24.0),
    ]
