"""Learns the mud's coefficients while the robot walks, and adapts the gait to them.

Each sample goes to the estimator together with the phase in which the measured motion was commanded, as in the log.
An insertion that meets solid mud ends early. Once a stride, in swing, the strides of all flippers close, and the depth
of the next stride is chosen.

The fits at the end of an insertion, and the close of a stride with its choice, take longer than a tick. They are
bounded work (control/computing/bounded_work.py), of which the loop runs one unit a tick after the command of that tick.
So an insertion is fitted 21 to 31 ticks after its end, and a stride closes some 30 ticks after its swing began (40 with
the method `gait`). Where a swing is too short for that, all units left run at once before the next insertion begins; a
choice that still comes later, because the mud held a flipper, is logged as late. A new walk finishes the strides of the
one before.
"""

from collections.abc import Callable, Sequence
from math import hypot, inf, isfinite
from typing import NamedTuple

from control.computing.bounded_work import Work
from control.controller import Controller
from control.depth.depth_choice import Adaptation, DepthAdaptation, DepthChoice
from control.depth.gait_choice import GaitAdaptation
from control.depth.paper_choice import PaperAdaptation
from control.faults import Fault, FaultKind
from control.geometry import FlipperGeometry
from control.parameters.adaptation_parameters import AdaptationParameters, Method
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath, GaitPhase
from control.records import NO_LOAD, UNKNOWN, BodyPose, DriveStates, Estimate, FlipperLoad, Phase, Rig, StrideEstimate
from estimation.mud import MudEstimator
from estimation.stride_clock import STROKES
from firmware_host.configuration.configuration import Configuration

FIRM_TICKS = 3  # with a high load until an insertion ends: one outlier does not end it
UNITS_PER_TICK = 1  # of bounded work
STORED_STRIDES = 200  # for clients of the status socket
LARGEST_N_M3 = 1e10  # 10 kN/cm³, a thousand times the stiffest mud

METHODS: dict[Method, Callable[[AdaptationParameters, FlipperGeometry, GaitParameters, Rig], Adaptation]] = {
    "default": DepthAdaptation,
    "paper": PaperAdaptation,
    "gait": GaitAdaptation,
}


class ClosedStride(NamedTuple):
    """A finished stride of one flipper, with the depth chosen after it and the lowest voltage of its drives."""

    number: int  # since the start, counting all flippers
    estimate: StrideEstimate
    chosen_depth_m: float
    supply_min_v: float  # since the stride before closed; NaN where no drive reports it


class LearningReport(NamedTuple):
    """The results of the last units, for the log."""

    strides: Sequence[ClosedStride] = ()
    messages: Sequence[str] = ()


NOTHING_LEARNED = LearningReport()


class MudLearning:
    """Owns the estimator, the choice of depth and the latest strides."""

    def __init__(self, configuration: Configuration) -> None:
        self.estimator = MudEstimator(
            configuration.geometry,
            configuration.flipper_drives,
            configuration.estimation,
            configuration.adaptation.body_drag_n,
            configuration.rig,
            configuration.adaptation.body_mass_kg,
        )
        self._configuration = configuration
        self._adapt_to(configuration.gait)
        self.loads: tuple[FlipperLoad, ...] = tuple(NO_LOAD for _ in configuration.rig.flippers)
        self.units_per_tick = UNITS_PER_TICK
        self.strides: list[ClosedStride] = []
        self.strides_closed = 0  # since the start
        self.depth_reason = ""  # of the next stride
        self._firm_ticks = 0
        self._may_turn = configuration.adaptation.method == "gait"  # to another sweep, in the swing under way
        self._closing: Work[tuple[StrideEstimate, ...]] | None = None  # begun by the last sample
        self._closed: list[ClosedStride] = []  # since the last report
        self._messages: list[str] = []  # likewise
        self._unexamined: list[StrideEstimate] = []
        self._rig = configuration.rig
        self._lowest_v = [inf] * len(configuration.rig.joints)  # since the last stride closed

    def _adapt_to(self, gait: GaitParameters | GaitPath) -> None:
        """Choose strides of this gait from now on; their candidates are computed before the first one.

        The methods `paper` and `gait` know the crutching gait only, so paths have the default one.
        """
        configuration, self._gait = self._configuration, gait
        known = configuration.adaptation, configuration.geometry
        if isinstance(gait, GaitPath):
            self.adaptation: Adaptation = DepthAdaptation(*known, configuration.gait, configuration.rig, gait)
        else:
            self.adaptation = METHODS[configuration.adaptation.method](*known, gait, configuration.rig)
        self.estimator.work.add(self.adaptation.prepare())

    def reset(self, depth_m: float, gait: GaitParameters | GaitPath | None = None) -> None:
        """Start a new walk, whose depth is chosen for this gait or the configured one; earlier strides stay stored.

        Unfinished work is dropped, so call `finish` before.
        """
        gait = gait or self._configuration.gait
        self.estimator.reset()
        if gait != self._gait:
            self._adapt_to(gait)
        self.adaptation.reset(depth_m)
        self.depth_reason = "start"
        self._firm_ticks = 0
        self._lowest_v = [inf] * len(self._lowest_v)

    def update(self, now_s: float, phase: Phase, states: DriveStates, body: BodyPose) -> None:
        """Add a sample to the estimator."""
        self.loads, self._closing = self.estimator.add(now_s, phase, states, body)
        lowest_v = self._lowest_v
        for joint, state in enumerate(states):
            if state.bus_voltage_v < lowest_v[joint]:
                lowest_v[joint] = state.bus_voltage_v

    def adapt(self, controller: Controller) -> None:
        """Begin to close the strides that the last sample ended; end an insertion that has met solid mud."""
        closing, self._closing = self._closing, None
        if closing is not None:
            self.estimator.work.add(self._close(closing, controller, controller.gait.commanded_depth_m))
        conditions = controller.gait.conditions
        if conditions is not None and controller.target.phase is not Phase.REST:  # on the way into or out of the gait
            if self._lasts(self._meets(conditions)) and controller.gait.end_phase():
                self._firm_ticks = 0
                depth_m = controller.target.depth_m
                self._messages.append(f"{conditions.name} ended at {depth_m:.4f} m, as its gait says")
        elif self._is_firm(controller) and controller.gait.end_phase():
            self._messages.append(f"insertion ended at {controller.gait.commanded_depth_m:.4f} m: solid mud")

    def step(self, controller: Controller, within_s: float) -> LearningReport:
        """Run the units of this tick, or all if the next stride's depth must be set within this time."""
        work = self.estimator.work
        if not work.is_empty:
            if controller.gait.is_choice_due(within_s, self._may_turn):
                work.finish()
            else:
                work.run(self.units_per_tick)
        return self._pop_report()

    def finish(self) -> LearningReport:
        """Run all units that are left."""
        self.estimator.work.finish()
        return self._pop_report()

    def _pop_report(self) -> LearningReport:
        if not (self._closed or self._messages):
            return NOTHING_LEARNED
        report = LearningReport(self._closed, self._messages)
        self._closed, self._messages = [], []
        return report

    def _close(self, closing: Work[tuple[StrideEstimate, ...]], controller: Controller, walked_m: float) -> Work[None]:
        """Estimate the strides that end, choose the depth of the next one, and publish both."""
        strides = yield from closing
        yield
        messages = ["another mud"] if self.estimator.mud_estimate.boundary else []
        messages += yield from self._choose(controller, self.estimator.felt_strides, walked_m)
        self._messages += messages
        depth_m, first = controller.gait.next_depth_m, self.strides_closed
        lowest_v, self._lowest_v = self._lowest_v, [inf] * len(self._lowest_v)
        supply_v = {flipper: _lowest_v(lowest_v[self._rig.joints_of(flipper)]) for flipper in self._rig.flippers}
        closed = [
            ClosedStride(first + i, estimate, depth_m, supply_v[estimate.flipper]) for i, estimate in enumerate(strides)
        ]
        self._closed += closed
        self._unexamined += strides
        self.strides_closed += len(closed)
        self.strides = (self.strides + closed)[-STORED_STRIDES:]

    def _choose(self, controller: Controller, strides: Sequence[StrideEstimate], walked_m: float) -> Work[list[str]]:
        """Choose the depth of the next stride, and its gait if the method chooses that too; return messages."""
        gait, choice = controller.gait, None
        if controller.order.adaptive:
            choice = yield from self.adaptation.choose(self.estimator.mud_estimate, strides, walked_m)
        order = controller.order  # an operator may have fixed the strides since the choice began
        if choice is None or not order.adaptive:
            gait.next_depth_m = order.depth_of(gait.stride + 1)  # that of a late choice is one later
            self.depth_reason = "in turn" if order.depths_m else "fixed"
            return []
        parameters = choice.gait or gait.parameters
        self.depth_reason = _reason_text(choice)
        if (choice.depth_m, parameters) == (gait.next_depth_m, gait.next_parameters):
            return []
        gait.next_depth_m, gait.next_parameters = choice.depth_m, parameters
        late = ["the depth was chosen after the next insertion began"] if controller.target.phase in STROKES else []
        return [_choice_text(choice), *late]

    def _is_firm(self, controller: Controller) -> bool:
        """Return whether an insertion of an adaptive walk has met solid mud."""
        if not controller.order.adaptive or controller.target.phase is not Phase.INSERTION:
            self._firm_ticks = 0
            return False
        limit_nm = self.adaptation.largest_insertion_nm
        return self._lasts(any([load.adduction_torque_nm > limit_nm for load in self.loads]))

    def _lasts(self, firm: bool) -> bool:
        self._firm_ticks = self._firm_ticks + 1 if firm else 0
        return self._firm_ticks >= FIRM_TICKS

    def _meets(self, conditions: GaitPhase) -> bool:
        """Return whether a flipper meets a condition that ends its phase early."""
        force_n, depth_m = conditions.until_force_n, conditions.until_depth_m
        return any(
            (force_n is not None and _force_n(load) >= force_n) or (depth_m is not None and load.depth_m >= depth_m)
            for load in self.loads
        )

    def pop_faults(self) -> list[Fault]:
        """Return faults of the strides that closed since the last call: coefficients beyond what any mud has."""
        if not self._unexamined:
            return []
        strides, self._unexamined = self._unexamined, []
        wild = [stride for stride in strides if any(map(_is_wild, (stride.k_p, stride.k_s, stride.k_e)))]
        return [FaultKind.ESTIMATE_WILD.fault(each.flipper, stride=each.index) for each in wild]


def _force_n(load: FlipperLoad) -> float:
    """Return the force of the mud on a flipper, in a stance only its forward part."""
    return hypot(load.force_x_n, load.force_z_n) if isfinite(load.force_z_n) else abs(load.force_x_n)


def _lowest_v(voltages_v: Sequence[float]) -> float:
    return lowest_v if (lowest_v := min(voltages_v)) < inf else UNKNOWN


def _is_wild(estimate: Estimate) -> bool:
    return estimate.valid and not (abs(estimate.value) < LARGEST_N_M3 and estimate.std_error < LARGEST_N_M3)


def _choice_text(choice: DepthChoice) -> str:
    sweep = f", sweep {choice.gait.sweep_angle_deg:g} degrees" if choice.gait else ""
    return f"depth {choice.depth_m:.4f} m{sweep}: {_reason_text(choice)}"


def _reason_text(choice: DepthChoice) -> str:
    return f"{choice.reason}{', slips' if choice.slips else ''}"
