"""The shell of both estimators: it follows one flipper through its strides and closes each of them in swing.

A method learns coefficients from the samples of a stride; the shell does the rest. It turns currents into loads, counts
phases and strides, records the largest forces, and closes a stride once the flipper has left the mud after its
extraction. The estimate of a stride takes longer than a tick, so a stride that closes returns it as bounded work
(control/computing/bounded_work.py), which depends on nothing that is measured later. The methods are
`FlipperEstimator` (flipper.py) and `PaperEstimator` (paper.py).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from math import inf, isfinite
from typing import NamedTuple

from control.computing.bounded_work import Work, WorkQueue
from control.gait.recovery import is_in_mud
from control.geometry import FlipperGeometry
from control.records import NO_LOAD, STANCES, UNKNOWN, DriveState, Estimate, FlipperLoad, Phase, StrideEstimate
from estimation.joint_load import NO_COMMANDS, CommandTimes, FlipperDrive, JointLoad, JointLoads, JointMotion
from estimation.path_motion import PathMotion
from estimation.stride_clock import StrideClock
from estimation.strokes.fit_samples import NO_FITS, StrideFits

GRACE_S = 0.3  # after the extraction, for a flipper that is still in the mud: joints follow late by up to 0.2 s


class Learned(NamedTuple):
    """The result of a method for one stride."""

    k_p: Estimate
    k_s: Estimate
    k_e: Estimate
    surface_m: float
    extraction_torque_nm: float
    surface_std_error_m: float = UNKNOWN
    other_surface_m: float = UNKNOWN
    stance: str = STANCES[0]
    yield_force_n: float = UNKNOWN
    yield_force_std_error_n: float = UNKNOWN
    tare_n: float = UNKNOWN
    tare_drift_n: float = UNKNOWN


class StrideEstimator(ABC):
    """Owns phase, load and extremes of the stride under way of one flipper."""

    def __init__(
        self,
        flipper: str,
        geometry: FlipperGeometry,
        drive: FlipperDrive,
        motion: Callable[[DriveState, DriveState, CommandTimes], JointMotion],
        work: WorkQueue | None = None,
    ) -> None:
        """`work` is the queue for what takes longer than a tick; the flippers of a robot share it."""
        self.work = WorkQueue() if work is None else work
        self.flipper = flipper
        self.geometry = geometry
        self._loads = JointLoads(geometry, drive, motion)
        self._clock = StrideClock()
        self._motion = PathMotion()
        self.reset()

    def reset(self) -> None:
        """Forget everything, the count of strides included."""
        self._loads.reset()
        self._clock.reset()
        self._motion.reset()
        self._is_path = False  # the samples are those of a path that does all strokes at once
        self.fits: StrideFits = NO_FITS  # of the stride that closed last, until its next insertion
        self.lift = 0.0  # uncertainty of ln k_p because the insertion of that stride may have lifted the body
        self.load = NO_LOAD
        self._body_at_close_m = UNKNOWN
        self._begin_stride(0.0, UNKNOWN)

    def _begin_stride(self, now_s: float, body_x_m: float) -> None:
        self._clock.begin(now_s)
        self._stuck = self._is_held = self.is_closing = False
        self._extracted_s = inf
        self._deepest_m = self._body_at_insertion_m = UNKNOWN
        self._insertion_n = self._stance_n = self._extraction_n = UNKNOWN
        if self._clock.index == 0 and not isfinite(self._body_at_close_m):
            self._body_at_close_m = body_x_m
        self._reset_stride()

    def add(
        self,
        now_s: float,
        phase: Phase,
        sweep: DriveState,
        adduction: DriveState,
        body_x_m: float,
        commands_s: CommandTimes = NO_COMMANDS,
    ) -> tuple[FlipperLoad, Work[StrideEstimate] | None]:
        """Return the load now, and the work that estimates the stride if it closes with this sample.

        A stride closes once the flipper has left the mud after its extraction; a flipper that is still in the mud has
        GRACE_S to come out.
        """
        closed = None
        is_path = phase is Phase.STROKE or (self._is_path and phase is Phase.PAUSE)
        if is_path:
            phase = self._motion.update(self.geometry.depth_m(*self._loads.angles_rad), self._is_in_mud())
        elif self._is_path:
            self._motion.reset()
        if phase is not self._clock.phase:
            closed = self._change_phase(now_s, phase, body_x_m)
        elif self._extracted_s < inf:
            closed = self._wait_for_exit(now_s, body_x_m)
        self._is_path = is_path
        if not isfinite(sweep.angle_rad + adduction.angle_rad + sweep.current_a + adduction.current_a):
            return NO_LOAD, closed
        load = self._loads.update(sweep, adduction, commands_s)
        if load is not None:
            self._learn(now_s, phase, load, body_x_m)
        return self.load, closed

    def _change_phase(self, now_s: float, phase: Phase, body_x_m: float) -> Work[StrideEstimate] | None:
        if self._is_path and self._clock.phase is Phase.EXTRACTION:
            self._clock.duration_s[Phase.STANCE] = now_s - self._clock.start_s
        change = self._clock.change(now_s, phase)
        self._end_phase(now_s, change.ended)
        if change.ended is Phase.EXTRACTION:
            self._extracted_s = now_s
        is_late = (phase is Phase.RECOVERY or change.closes_stride) and self._is_in_mud()
        self._stuck = self._stuck or is_late
        if change.closes_stride and is_late and phase is Phase.SWING and change.ended is Phase.EXTRACTION:
            self.is_closing = True
            return None
        closes = change.closes_stride or self.is_closing
        closed = self._close(now_s, body_x_m) if closes else None
        if change.begins_stride:
            self._begin_stride(now_s, body_x_m)
        self._begin_phase(phase)
        return closed

    def _wait_for_exit(self, now_s: float, body_x_m: float) -> Work[StrideEstimate] | None:
        """Close the stride that waits, as soon as its flipper is out of the mud or is held by it."""
        is_in_mud = self._is_in_mud()
        if is_in_mud and now_s - self._extracted_s < GRACE_S:
            return None
        self._is_held = is_in_mud
        self._extracted_s = inf
        if not self.is_closing:
            return None
        closed = self._close(now_s, body_x_m)
        self._begin_stride(now_s, body_x_m)
        return closed

    def _is_in_mud(self) -> bool:
        return is_in_mud(self.geometry, *self._loads.angles_rad)

    def _close(self, now_s: float, body_x_m: float) -> Work[StrideEstimate]:
        """Close the stride and return the work that estimates it from all that was measured in it."""
        duration_s = self._clock.duration_s
        measured = partial(
            StrideEstimate,
            flipper=self.flipper,
            index=self._clock.index,
            t_start_s=self._clock.start_s,
            t_end_s=now_s,
            insertion_s=duration_s[Phase.INSERTION],
            stance_s=duration_s[Phase.STANCE],
            extraction_s=duration_s[Phase.EXTRACTION],
            released=not self._stuck,
            insertion_force_n=self._insertion_n,
            stance_force_n=self._stance_n,
            extraction_force_n=self._extraction_n,
            step_m=body_x_m - self._body_at_close_m,
            position_m=self._body_at_insertion_m,
        )
        self._clock.index += 1
        self._body_at_close_m = body_x_m
        return _estimated(measured, self._deepest_m, self._learned())

    def _record_extremes(self, phase: Phase, load: FlipperLoad, body_x_m: float) -> None:
        """Record the largest forces of the stride, and where the body was at the end of the insertion."""
        if phase is Phase.EXTRACTION:
            self._extraction_n = -larger(-load.force_z_n, -self._extraction_n)
        elif phase is Phase.STANCE:
            self._stance_n = larger(load.force_x_n, self._stance_n)
        elif phase is Phase.INSERTION:
            self._insertion_n = larger(load.force_z_n, self._insertion_n)
            self._body_at_insertion_m = body_x_m

    @abstractmethod
    def _reset_stride(self) -> None:
        """Forget the stride before."""

    @abstractmethod
    def _learn(self, now_s: float, phase: Phase, load: JointLoad, body_x_m: float) -> None:
        """Take in a new load: set `load` and `_deepest_m`, and call `_record_extremes`."""

    @abstractmethod
    def _learned(self) -> Work[Learned]:
        """Return the work that fits the stride that closes, from the present state."""

    def _end_phase(self, now_s: float, ended: Phase) -> None:  # noqa: B027  a method may ignore it
        """React to the end of a phase."""

    def _begin_phase(self, phase: Phase) -> None:  # noqa: B027
        """React to the beginning of a phase, after a stride that ends with it has closed."""


def _estimated(
    measured: Callable[..., StrideEstimate], deepest_m: float, learning: Work[Learned]
) -> Work[StrideEstimate]:
    learned = yield from learning
    return measured(depth_m=deepest_m - learned.surface_m, **learned._asdict())


def larger(value: float, largest: float) -> float:
    """Return the larger of two values; `largest` may still be NaN."""
    return largest if largest >= value else value
