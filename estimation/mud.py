"""The estimator that the loop, the replay and the experiments share: both flippers, and the mud from stride to stride.

Its input is drive states, the gait's phase and the body's position, one sample a tick; it uses no bus and no clock. The
same samples give the same numbers to the last digit, live or from a log. Two methods share its interface: `default`, in
torque space, and `paper`, the published one, with its biases.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from control.bounds import Bounds, Meaning
from control.geometry import FlipperGeometry
from control.mud_estimate import NOTHING_KNOWN, MudEstimate
from control.records import FLIPPERS, NO_LOAD, BodyPose, DriveStates, FlipperLoad, Phase, StrideEstimate
from estimation.flipper import FlipperEstimator
from estimation.joint_load import NO_COMMANDS, FlipperDrive
from estimation.knowledge import MudKnowledge
from estimation.mud_map import MudMap
from estimation.paper import PaperEstimator
from estimation.strokes.fit_samples import StrideFits
from estimation.strokes.shear import Base

PAPER_DRAG_N = 2.5  # the body's drag on its rail in the paper
Method = Literal["default", "paper"]


@dataclass(frozen=True)
class PaperEstimationParameters:
    """Parameters of the method `paper` alone."""

    compensation: Annotated[bool, Meaning("add the body's drag to the thrust while the body advances")] = False


@dataclass(frozen=True)
class EstimationParameters:
    method: Annotated[Method, Meaning("default regresses in torque space; paper is the published method")] = "default"
    fixed_base: Annotated[bool, Meaning("the flippers hang from a bench: all their travel shears mud")] = False
    surface_error_m: Annotated[
        float, Bounds(0.0001, 0.05), Meaning("std_error of the mud's nominal height at one stride")
    ] = 0.001
    paper: PaperEstimationParameters = PaperEstimationParameters()


class MudReading(NamedTuple):
    left: FlipperLoad = NO_LOAD
    right: FlipperLoad = NO_LOAD
    strides: tuple[StrideEstimate, ...] = ()  # closed by this sample


class MudEstimator:
    """Owns both flippers' estimators, the memory from stride to stride, and the map along the track."""

    def __init__(
        self,
        geometry: FlipperGeometry,
        drives: tuple[FlipperDrive, FlipperDrive],
        parameters: EstimationParameters = EstimationParameters(),
        body_drag_n: float = PAPER_DRAG_N,
    ) -> None:
        """`drives` are the left and the right flipper's; a thrust below `body_drag_n` cannot move the body."""
        self.left, self.right = (
            _flipper_estimator(flipper, geometry, drive, parameters, body_drag_n)
            for flipper, drive in zip(FLIPPERS, drives, strict=True)
        )
        self._knowledge = MudKnowledge()
        self._commands_s = NO_COMMANDS  # the loop sends new commands after each sample
        self._closed: list[StrideEstimate] = []  # of one flipper, while the other one waits for its exit
        self.map = MudMap()
        self.mud_estimate: MudEstimate = NOTHING_KNOWN

    def reset(self) -> None:
        self.left.reset()
        self.right.reset()
        self._knowledge.reset()
        self._commands_s = NO_COMMANDS
        self._closed.clear()
        self.map.reset()
        self.mud_estimate = NOTHING_KNOWN

    def fits_of(self, flipper: str) -> StrideFits:
        """Return the fits of the flipper's last stride, until its next one closes."""
        return (self.left if flipper == "left" else self.right).fits

    def update(self, now_s: float, phase: Phase, states: DriveStates, body: BodyPose) -> MudReading:
        """Take in the newest state of every drive and the body's pose, in the gait's phase that they belong to."""
        commands_s, self._commands_s = self._commands_s, (self._commands_s[1], now_s)
        body_x_m = body.x_m
        left, left_stride = self.left.update(
            now_s, phase, states.left_sweep, states.left_adduction, body_x_m, commands_s
        )
        right, right_stride = self.right.update(
            now_s, phase, states.right_sweep, states.right_adduction, body_x_m, commands_s
        )
        if left_stride is not None:
            self._closed.append(left_stride)
        if right_stride is not None:
            self._closed.append(right_stride)
        if not self._closed or self.left.is_closing or self.right.is_closing:
            return MudReading(left, right)
        strides = tuple(sorted(self._closed, key=lambda stride: (stride.index, FLIPPERS.index(stride.flipper))))
        self._closed.clear()
        self.mud_estimate = self._knowledge.update(strides)
        self.map.update(body_x_m, strides)
        return MudReading(left, right, strides)


def _flipper_estimator(
    flipper: str, geometry: FlipperGeometry, drive: FlipperDrive, parameters: EstimationParameters, body_drag_n: float
) -> FlipperEstimator | PaperEstimator:
    if parameters.method == "paper":
        return PaperEstimator(flipper, geometry, drive, body_drag_n if parameters.paper.compensation else 0.0)
    base = Base.FIXED if parameters.fixed_base else Base.FREE
    return FlipperEstimator(flipper, geometry, drive, base, body_drag_n, parameters.surface_error_m)
