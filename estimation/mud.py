"""The estimator that the loop, the replay and the experiments share: all flippers, and the mud from stride to stride.

Its input is drive states, the gait's phase and the body's position, one sample a tick; it uses no bus and no clock. The
fits at a stride's ends take longer than a tick. The loop calls `add` and runs the fits afterwards in units of bounded
work; a replay calls `update`, which runs them at once. The same samples give the same numbers to the last digit, live
or from a log, however many units run in a tick. Two methods share the interface: `default`, in torque space, and
`paper`, the published one, with its biases.
"""

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from control.computing.bounded_work import Work, WorkQueue, finish
from control.geometry import FlipperGeometry
from control.mud_estimate import NOTHING_KNOWN, MudEstimate
from control.parameters.arm_mass import GRAVITY_M_S2
from control.records import (
    FLIPPERS,
    NO_LOAD,
    TWO_FLIPPERS,
    BodyPose,
    DriveStates,
    FlipperLoad,
    Phase,
    Rig,
    StrideEstimate,
)
from estimation.estimation_parameters import EstimationParameters
from estimation.flipper import FlipperEstimator
from estimation.joint_load import NO_COMMANDS, FlipperDrive
from estimation.knowledge import MudKnowledge
from estimation.mud_map import MudMap
from estimation.paper import PaperEstimator
from estimation.strokes.fit_samples import StrideFits
from estimation.strokes.lift import LIFTING_FRACTION, as_felt, less_deep, with_lift
from estimation.strokes.shear import Base

PAPER_DRAG_N = 2.5  # the body's drag on its rail in the paper


class MudReading(NamedTuple):
    loads: tuple[FlipperLoad, ...] = ()  # of one flipper after the other
    strides: tuple[StrideEstimate, ...] = ()  # closed by this sample


class Sampled(NamedTuple):
    """The result of one sample, without that of the work which it causes."""

    loads: tuple[FlipperLoad, ...]
    closing: Work[tuple[StrideEstimate, ...]] | None = None  # estimates the strides that this sample closed


class MudEstimator:
    """Owns the flippers' estimators, the memory from stride to stride, and the map along the track."""

    def __init__(
        self,
        geometry: FlipperGeometry,
        drives: Sequence[FlipperDrive],
        parameters: EstimationParameters = EstimationParameters(),  # noqa: B008 - immutable
        body_drag_n: float = PAPER_DRAG_N,
        rig: Rig = TWO_FLIPPERS,
        body_mass_kg: float = 0.0,
    ) -> None:
        """`drives` has one item for each flipper; a thrust below `body_drag_n` cannot move the body; 0 kg: unknown."""
        drag_n = body_drag_n / len(rig.flippers)
        lift_n = LIFTING_FRACTION * body_mass_kg * GRAVITY_M_S2 / len(rig.flippers) if parameters.free_body else inf
        self.work = WorkQueue()  # of the ends of insertions
        self.flippers = tuple(
            _flipper_estimator(flipper, geometry, drive, parameters, drag_n, lift_n, self.work)
            for flipper, drive in zip(rig.flippers, drives, strict=True)
        )
        self._knowledge = MudKnowledge()
        self._commands_s = NO_COMMANDS  # the loop sends new commands after each sample
        self._closed: list[Work[StrideEstimate]] = []  # of one flipper, while the other one waits for its exit
        self.map = MudMap()
        self.mud_estimate: MudEstimate = NOTHING_KNOWN
        self.felt_strides: tuple[StrideEstimate, ...] = ()  # that closed last, by the depth of the joints

    def reset(self) -> None:
        """Forget everything; work that is not finished is dropped."""
        self.work.clear()
        for flipper in self.flippers:
            flipper.reset()
        self._knowledge.reset()
        self._commands_s = NO_COMMANDS
        self._closed.clear()
        self.map.reset()
        self.mud_estimate, self.felt_strides = NOTHING_KNOWN, ()

    def fits_of(self, flipper: str) -> StrideFits:
        """Return the fits of the flipper's last stride, until its next insertion ends."""
        return next(each.fits for each in self.flippers if each.flipper == flipper)

    def update(self, now_s: float, phase: Phase, states: DriveStates, body: BodyPose) -> MudReading:
        """Add a sample and finish all the work that it causes."""
        loads, closing = self.add(now_s, phase, states, body)
        if not self.work.is_empty:
            self.work.finish()
            pairs = zip(loads, self.flippers, strict=True)
            loads = tuple(NO_LOAD if load is NO_LOAD else flipper.load for load, flipper in pairs)
        return MudReading(loads, () if closing is None else finish(closing))

    def add(self, now_s: float, phase: Phase, states: DriveStates, body: BodyPose) -> Sampled:
        """Take in the newest state of every drive and the body's pose, in the gait's phase that they belong to."""
        commands_s, self._commands_s = self._commands_s, (self._commands_s[1], now_s)
        body_x_m = body.x_m
        loads, joints = [], iter(states)
        for flipper in self.flippers:
            load, stride = flipper.add(now_s, phase, next(joints), next(joints), body_x_m, commands_s)
            loads.append(load)
            if stride is not None:
                self._closed.append(stride)
        if not self._closed or any([flipper.is_closing for flipper in self.flippers]):
            return Sampled(tuple(loads))
        closing = self._estimate(tuple(self._closed), body_x_m)
        self._closed.clear()
        return Sampled(tuple(loads), closing)

    def _estimate(self, closed: Sequence[Work[StrideEstimate]], body_x_m: float) -> Work[tuple[StrideEstimate, ...]]:
        """Estimate the strides that closed, and the mud after them."""
        yield  # the tick in which the strides close has other work already
        found = []
        for each in closed:
            found.append((yield from each))
            yield
        raw = sorted(found, key=lambda stride: (stride.index, FLIPPERS.index(stride.flipper)))
        lifts = {flipper.flipper: flipper.lift for flipper in self.flippers}
        self.felt_strides = tuple([with_lift(stride, lifts[stride.flipper], as_felt) for stride in raw])
        self.mud_estimate = self._knowledge.update(self.felt_strides)
        yield
        strides = tuple([with_lift(stride, lifts[stride.flipper], less_deep) for stride in raw])
        self.map.update(body_x_m, strides)
        return strides


def _flipper_estimator(
    flipper: str,
    geometry: FlipperGeometry,
    drive: FlipperDrive,
    parameters: EstimationParameters,
    drag_n: float,
    lift_n: float,
    work: WorkQueue,
) -> FlipperEstimator | PaperEstimator:
    if parameters.method == "paper":
        return PaperEstimator(flipper, geometry, drive, drag_n if parameters.paper.compensation else 0.0, work)
    base = Base.FIXED if parameters.fixed_base else Base.FREE
    return FlipperEstimator(flipper, geometry, drive, base, drag_n, parameters.surface_error_m, lift_n, work)
