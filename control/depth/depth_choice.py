"""Choice of the insertion depth, once a stride, in swing (paper, section III-D), and the search for it.

Two conditions bound the depth z: the flippers must not slip, 2 f_x(z) > f_r + f_a, and the mud must release them,
τ_e(z) < τ_m. Within these bounds the robot should be fast. So of all candidates that come out of the mud, the search
takes the one with the highest predicted speed

    S(z)/T(z)        S: the body's step at the thrust of that depth (step_model.py)      T: the stride's duration

where thrust, drag and suction lie on the safe side of the estimates (forecast.py). A body that slips makes small steps,
so the first condition needs no bound of its own; the choice reports a slip where S is less than half an arm's length,
the bound of the authors' optimiser. If no candidate comes out, the search takes the shallowest; if none predicts a
step, the deepest that comes out.

The robot meets a boundary between two muds at the depth that suited the first one. Mud that will hold a flipper can be
felt during the insertion: in simulated clay of 3 to 5 kPa, at 2.5 and 3 cm, the largest torque of the extraction is 1.3
times that of the insertion. So an insertion ends at 1/1.3 of the torque that an extraction may take, and the stride
continues at the depth commanded by then. (Under the stance's load the flipper sinks further, by up to 1 cm.)

Mud can be too soft to be felt: the torques of the stance are then those of friction, and nothing is known of the
thrust. A body that stays where it is will do so at the same depth, so the next stride is deeper by a quarter, also
where no pose shows whether it stays.

A path of a gait file is searched in the same way. It is taken for its whole motion in the mud, and its plates rise
from where they are deepest; flippers that push in turn make a step each.

The drag pad's resistance k_s w d²/2 adds to the body's drag: w and d are its width and depth.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import degrees, fsum, isfinite
from typing import NamedTuple, Protocol

from control.computing.bounded_work import Work, batched
from control.depth.forecast import GRID_M, DepthForecast
from control.depth.step_model import BodyDrag, Motion, Traction, carried_m, motion_of, motion_of_path
from control.gait.stride_table import PhaseRow, stride_duration_s, stride_table
from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.parameters.adaptation_parameters import AdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath
from control.records import TWO_FLIPPERS, Rig, StrideEstimate

DEEPER = 1.25  # of a depth at which mud was not felt: half as much force again, since it grows with the depth squared
PARTS = 4  # of each row of a path that are tried for reach; a half ellipse has its peak at the second
ALIKE = 0.03  # of the speed of a path: its forecast is no better
LEVEL_M = 0.0005  # of depth, within which a path is at its deepest
DEPTHS_PER_UNIT, STEPS_PER_UNIT, EXTRACTIONS_PER_UNIT = 3, 4, 4  # of bounded work: less than half a tick


class DepthChoice(NamedTuple):
    depth_m: float
    slips: bool  # the predicted step is less than half an arm's length
    reason: str
    gait: GaitParameters | None = None  # of the next stride; None: as configured


class Adaptation(Protocol):
    """Chooses the depth of the next stride; a method may choose the gait as well."""

    @property
    def largest_insertion_nm(self) -> float:
        """The mud's torque on the adduction joint at which an insertion ends early."""

    def reset(self, depth_m: float) -> None: ...

    def prepare(self) -> Work[None]:
        """Compute the candidates of every choice; the first choice does it where nothing did it before."""

    def choose(
        self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float
    ) -> Work[DepthChoice]:
        """Choose from the strides that just closed at the commanded depth `walked_m`, and the estimate after them.

        The choice is work in bounded units, of which the loop runs one a tick.
        """


class Candidate(NamedTuple):
    """A stride that the search may choose."""

    depth_m: float
    gait: GaitParameters
    duration_s: float
    motion: Motion  # of the plates in the mud


def depth_grid(parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> tuple[float, ...]:
    """Return the depths from the shallowest to the deepest that the flipper reaches over the whole sweep."""
    low_m = parameters.min_depth_m
    high_m = min(parameters.max_depth_m, geometry.deepest_m(gait.sweep_angle_deg))
    count = max(0, int((high_m - low_m) / GRID_M + 1e-9)) + 1
    return tuple(low_m + i * GRID_M for i in range(count))


def path_depths(parameters: AdaptationParameters, geometry: FlipperGeometry, path: GaitPath) -> tuple[float, ...]:
    """Return the depths of the grid at which all of a path is in reach."""
    grid_m = depth_grid(parameters, geometry, GaitParameters(sweep_angle_deg=0.0))
    return tuple([depth_m for depth_m in grid_m if _is_in_reach(stride_table(path, geometry, depth_m), geometry)])


def _is_in_reach(rows: Sequence[PhaseRow], geometry: FlipperGeometry) -> bool:
    return all([geometry.is_reachable(*place) for place in _places(rows)])


def _places(rows: Sequence[PhaseRow]) -> list[tuple[float, float]]:
    """Return sweep and depth at some points of a stride."""
    return [row.at(part / PARTS)[:2] for row in rows for part in range(PARTS + 1)]


def rising_deg(path: GaitPath, geometry: FlipperGeometry, depth_m: float) -> float:
    """Return the sweep from the middle at which the plates leave the deepest part of a path."""
    places = _places(stride_table(path, geometry, depth_m))
    deepest_m = max(at_m for _, at_m in places)
    return degrees(abs([sweep_rad for sweep_rad, at_m in places if at_m > deepest_m - LEVEL_M][-1]))


def make_candidate(geometry: FlipperGeometry, gait: GaitParameters, depth_m: float) -> Candidate:
    motion = motion_of(gait, geometry, depth_m)
    return Candidate(depth_m, gait, stride_duration_s(gait, geometry, depth_m), motion)


def body_drag(parameters: AdaptationParameters, forecast: DepthForecast) -> BodyDrag:
    """Return the drag of body and pad in the mud of the forecast."""
    depth_m = parameters.pad_depth_m
    pad_n = forecast.drag_shear(depth_m) * parameters.pad_width_m * depth_m * depth_m / 2.0
    return BodyDrag(parameters.body_drag_n + pad_n, parameters.body_damping_n_s_m, parameters.body_mass_kg)


class DepthAdaptation:
    """Searches the candidates, which here are the depths of the grid, for the fastest that comes out of the mud.

    Owns the forecast and the choice. The method `gait` adds candidates and conditions.
    """

    def __init__(
        self,
        parameters: AdaptationParameters,
        geometry: FlipperGeometry,
        gait: GaitParameters,
        rig: Rig = TWO_FLIPPERS,
        path: GaitPath | None = None,
    ) -> None:
        """`path`: of a gait file in place of the crutching gait, of which the forecast knows where its plates rise."""
        self.parameters = parameters
        self.geometry = geometry
        self.path = path
        self.gait = gait
        if path:
            self.gait = replace(gait, sweep_angle_deg=rising_deg(path, geometry, parameters.initial_depth_m))
        self._flippers = len(rig.flippers)
        self._pushes = self._flippers if path and path.right_offset_fraction else 1  # a stride, by flippers in turn
        self._pairs = list(self._gaits_and_depths())  # that are no candidates yet
        self.candidates: list[Candidate] = []
        self.forecast = DepthForecast(geometry, self.gait, parameters.motor_force_n, rig)
        self.reset(parameters.initial_depth_m)

    def reset(self, depth_m: float) -> None:
        self.choice = DepthChoice(depth_m, False, "start")
        self.forecast.reset()

    def _gaits_and_depths(self) -> Sequence[tuple[GaitParameters, float]]:
        """Return gait and depth of every candidate, narrow before wide and shallow before deep."""
        return [(self.gait, depth_m) for depth_m in depth_grid(self.parameters, self.geometry, self.gait)]

    def prepare(self) -> Work[None]:
        while self._pairs:
            gait, depth_m = self._pairs[0]
            if self.path is None:
                self.candidates.append(make_candidate(self.geometry, gait, depth_m))
            else:
                yield from self._prepare_path(self.path, depth_m)
            del self._pairs[0]
            yield

    def _prepare_path(self, path: GaitPath, depth_m: float) -> Work[None]:
        """Add the path at this depth to the candidates if all of it is in reach."""
        rows = stride_table(path, self.geometry, depth_m)
        yield
        if _is_in_reach(rows, self.geometry):
            duration_s, motion = fsum(row.duration_s for row in rows), motion_of_path(rows, self.geometry, depth_m)
            self.candidates.append(Candidate(depth_m, self.gait, duration_s, motion))

    def choose(
        self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float
    ) -> Work[DepthChoice]:
        """Choose the next stride; without an estimate of the thrust a deeper one unless the body advances."""
        yield from self.prepare()
        self.forecast.update(mud_estimate, strides, walked_m)
        yield
        stuck = any(not stride.released for stride in strides)
        steps_m = yield from self._steps_m()
        if steps_m or stuck:
            index, reason = yield from self._fastest(steps_m or [0.0] * len(self.candidates))
            slips = bool(steps_m) and steps_m[index] < self.geometry.flipper_length_m / 2.0
            self.choice = self._choice_of(self.candidates[index], slips, "a flipper was stuck" if stuck else reason)
        elif any(isfinite(stride.depth_m) for stride in strides) and not self._advances(strides):
            self.choice = self._deeper(walked_m)
        else:
            self.choice = self.choice._replace(reason="nothing known of the thrust, depth kept")
        return self.choice

    def _advances(self, strides: Sequence[StrideEstimate]) -> bool:
        """Return whether the body made a step; a path may go backward."""
        steps_m = [abs(stride.step_m) if self.path else stride.step_m for stride in strides]
        return any(step_m > self.geometry.flipper_length_m / 2.0 for step_m in steps_m)

    def _deeper(self, walked_m: float) -> DepthChoice:
        """Return the next stride where the mud was too soft to be felt: it would stay so at the same depth.

        A gait that is no candidate, as the first stride's may be, gives way to the narrowest.
        """
        gaits = [each.gait for each in self.candidates]
        gait = self.choice.gait if self.choice.gait in gaits else gaits[0]
        same_gait = [each for each in self.candidates if each.gait == gait]
        deeper = (each for each in same_gait if each.depth_m >= DEEPER * walked_m)
        return self._choice_of(next(deeper, same_gait[-1]), False, "nothing known of the thrust, deeper")

    @property
    def largest_insertion_nm(self) -> float:
        return self.parameters.insertion_fraction * self.forecast.lifting_torque_nm

    def _choice_of(self, best: Candidate, slips: bool, reason: str) -> DepthChoice:
        return DepthChoice(best.depth_m, slips, reason)

    def _steps_m(self) -> Work[list[float]]:
        """Predict the step of every candidate; an empty list if nothing is known of the thrust.

        The thrust is that in the middle of the sweep: a gait that reaches a depth at the ends reaches it there too.
        """
        drag = body_drag(self.parameters, self.forecast)
        pushing = self._flippers // self._pushes
        motor_n, stiffness_n_m = pushing * self.parameters.motor_force_n, pushing * self.parameters.mobilisation_n_m
        self.forecast.gait = self.candidates[0].gait
        tractions = dict[float, Traction]()
        for depths_m in batched(sorted({each.depth_m for each in self.candidates}), DEPTHS_PER_UNIT):
            for depth_m in depths_m:
                yield_n = self.forecast.yield_n(depth_m)
                if yield_n is None:
                    return []
                yield_n /= self._pushes
                tractions[depth_m] = Traction(yield_n=yield_n, motor_n=motor_n, stiffness_n_m=stiffness_n_m)
            yield
        steps_m: list[float] = []
        for candidates in batched(self.candidates, 1 if self.path else STEPS_PER_UNIT):
            carried = [carried_m(each.motion, drag, tractions[each.depth_m]) for each in candidates]
            steps_m += [self._pushes * each_m for each_m in carried]
            yield
        return steps_m

    def _fastest(self, steps_m: Sequence[float]) -> Work[tuple[int, str]]:
        """Return the index of the fastest candidate that comes out, and the reason; of equals, the deepest.

        Depths of a path are equals within ALIKE, of which the shallowest needs the least torque. The candidates are
        tried from the fastest on, because the forecast of an extraction takes time.
        """
        pairs = zip(steps_m, self.candidates, strict=True)
        merits = [(step_m / each.duration_s, each.depth_m) for step_m, each in pairs]
        if self.path and (most_m_s := (1.0 - ALIKE) * max(merits)[0]) > 0.0:
            merits = [(min(speed_m_s, most_m_s), -depth_m) for speed_m_s, depth_m in merits]
        ordered = sorted(range(len(merits)), key=merits.__getitem__, reverse=True)
        for indices in batched(ordered, EXTRACTIONS_PER_UNIT):
            for index in indices:
                if self._comes_out(self.candidates[index]):
                    return index, "fastest" if merits[index][0] > 0.0 else "thrust"
            yield
        return 0, "extraction"

    def _comes_out(self, stride: Candidate) -> bool:
        self.forecast.gait = stride.gait
        limit_nm = self.parameters.lifting_fraction * self.forecast.lifting_torque_nm
        return self.forecast.extraction_nm(stride.depth_m) < limit_nm
