"""Learns the mud's coefficients while the robot walks, and adapts the gait to them.

Each sample goes to the estimator together with the phase in which the measured motion was commanded, as in the log.
Once a stride, in swing, the depth of the next stride is chosen. An insertion that meets solid mud ends early.
"""

from collections.abc import Callable
from typing import NamedTuple

from control.controller import Controller
from control.depth.depth_choice import Adaptation, AdaptationParameters, DepthAdaptation, DepthChoice, Method
from control.depth.gait_choice import GaitAdaptation
from control.depth.paper_choice import PaperAdaptation
from control.faults import Fault, FaultKind
from control.gait.gait import GaitParameters
from control.geometry import FlipperGeometry
from control.records import NO_LOAD, BodyPose, DriveStates, Estimate, Phase, Rig, StrideEstimate
from estimation.mud import MudEstimator, MudReading
from firmware_host.configuration.configuration import Configuration

FIRM_TICKS = 3  # with a high load until an insertion ends: one outlier does not end it
STORED_STRIDES = 200  # for clients of the status socket
LARGEST_N_M3 = 1e10  # 10 kN/cm³, a thousand times the stiffest mud

METHODS: dict[Method, Callable[[AdaptationParameters, FlipperGeometry, GaitParameters, Rig], Adaptation]] = {
    "default": DepthAdaptation,
    "paper": PaperAdaptation,
    "gait": GaitAdaptation,
}


class ClosedStride(NamedTuple):
    """A finished stride of one flipper, with the depth that was chosen after it."""

    number: int  # since the start, counting all flippers
    estimate: StrideEstimate
    chosen_depth_m: float


class MudLearning:
    """Owns the estimator, the choice of depth and the latest strides."""

    def __init__(self, configuration: Configuration) -> None:
        self.estimator = MudEstimator(
            configuration.geometry,
            configuration.flipper_drives,
            configuration.estimation,
            configuration.adaptation.body_drag_n,
            configuration.rig,
        )
        method = METHODS[configuration.adaptation.method]
        self.adaptation = method(
            configuration.adaptation, configuration.geometry, configuration.gait, configuration.rig
        )
        self.reading = MudReading(tuple(NO_LOAD for _ in configuration.rig.flippers))
        self.strides: list[ClosedStride] = []
        self.strides_closed = 0  # since the start
        self.depth_reason = ""  # of the next stride
        self._firm_ticks = 0

    def reset(self, depth_m: float) -> None:
        """Start a new walk; earlier strides stay stored."""
        self.estimator.reset()
        self.adaptation.reset(depth_m)
        self.depth_reason = "start"
        self._firm_ticks = 0

    def update(self, now_s: float, phase: Phase, states: DriveStates, body: BodyPose) -> None:
        self.reading = self.estimator.update(now_s, phase, states, body)

    def step(self, controller: Controller) -> tuple[list[ClosedStride], list[str]]:
        """Adapt the gait in this tick; returns the strides that closed, and messages for the log."""
        closed, messages = self._close(controller) if self.reading.strides else ([], [])
        if self._is_firm(controller) and controller.gait.end_insertion():
            messages.append(f"insertion ended at {controller.gait.commanded_depth_m:.4f} m: solid mud")
        return closed, messages

    def _close(self, controller: Controller) -> tuple[list[ClosedStride], list[str]]:
        messages = ["another mud"] if self.estimator.mud_estimate.boundary else []
        messages += self._choose(controller)
        depth_m = controller.gait.next_depth_m
        first = self.strides_closed
        closed = [ClosedStride(first + i, estimate, depth_m) for i, estimate in enumerate(self.reading.strides)]
        self.strides_closed += len(closed)
        self.strides = (self.strides + closed)[-STORED_STRIDES:]
        return closed, messages

    def _choose(self, controller: Controller) -> list[str]:
        """Choose the depth of the next stride, and its gait if the method chooses that too; returns messages."""
        gait, order = controller.gait, controller.order
        if not order.adaptive:
            gait.next_depth_m, self.depth_reason = order.depth_m, "fixed"
            return []
        choice = self.adaptation.step(self.estimator.mud_estimate, self.reading.strides, gait.commanded_depth_m)
        parameters = choice.gait or gait.parameters
        self.depth_reason = _reason_text(choice)
        changes = (choice.depth_m, parameters) != (gait.next_depth_m, gait.next_parameters)
        gait.next_depth_m, gait.next_parameters = choice.depth_m, parameters
        return [_choice_text(choice)] if changes else []

    def _is_firm(self, controller: Controller) -> bool:
        """Whether an insertion of an adaptive walk has met solid mud."""
        if not controller.order.adaptive or controller.target.phase is not Phase.INSERTION:
            self._firm_ticks = 0
            return False
        limit_nm = self.adaptation.largest_insertion_nm
        firm = any([load.adduction_torque_nm > limit_nm for load in self.reading.loads])
        self._firm_ticks = self._firm_ticks + 1 if firm else 0
        return self._firm_ticks >= FIRM_TICKS

    @property
    def faults(self) -> list[Fault]:
        """Faults of strides in this tick whose coefficients are beyond what any mud has."""
        wild = [stride for stride in self.reading.strides if any(map(_is_wild, (stride.k_p, stride.k_s, stride.k_e)))]
        return [FaultKind.ESTIMATE_WILD.fault(each.flipper, stride=each.index) for each in wild]


def _is_wild(estimate: Estimate) -> bool:
    return estimate.valid and not (abs(estimate.value) < LARGEST_N_M3 and estimate.std_error < LARGEST_N_M3)


def _choice_text(choice: DepthChoice) -> str:
    sweep = f", sweep {choice.gait.sweep_angle_deg:g} degrees" if choice.gait else ""
    return f"depth {choice.depth_m:.4f} m{sweep}: {_reason_text(choice)}"


def _reason_text(choice: DepthChoice) -> str:
    return f"{choice.reason}{', slips' if choice.slips else ''}"
