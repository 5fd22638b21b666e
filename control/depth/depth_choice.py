"""Choice of the insertion depth, once a stride in swing (paper, section III-D).

Two conditions bound the depth z: the flippers must not slip, 2 f_x(z) > f_r + f_a, and they must come out again,
τ_e(z) < τ_m. Within them the robot should be fast. So of all depths that come out, the one is taken that promises the
highest speed

    S(z)/T(z)        S: the body's step with the thrust of that depth (step_model.py)      T: the stride's duration

with thrust and suction on the safe side of what is known (depth_forecast.py). A body that slips makes small steps, so
the first condition needs no bound of its own. It is said where S is less than half an arm, the bound of the authors'
optimiser. Where no depth comes out the shallowest is taken; where none promises a step, the deepest that comes out.

A boundary is met at the depth of the mud before it. What holds a flipper can be felt on the way in: in simulated clay
of 3 to 5 kPa, 2.5 and 3 cm deep, the hardest moment of the extraction takes 1.3 times the torque that the insertion
took. So an insertion ends where it takes 1/1.3 of what an extraction may, and the stride goes on at the depth that was
commanded by then. (Under the stance's load the flipper still sinks, by up to 1 cm.)

The drag pad's resistance k_s w d²/2 is counted with the body's: w and d are its width and depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, Protocol

from control.bounds import Bounds, Meaning
from control.depth.forecast import GRID_M, DepthForecast
from control.depth.step_model import BodyDrag, Traction, step_m
from control.gait.gait import GaitParameters, stride_duration_s
from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.records import StrideEstimate

Method = Literal["default", "paper", "gait"]


@dataclass(frozen=True)
class AdaptationParameters:
    method: Annotated[Method, Meaning("how the next stride is chosen: depth, the paper's rule, or depth and gait")] = (
        "default"
    )
    initial_depth_m: Annotated[float, Bounds(0.005, 0.2), Meaning("insertion depth of the first stride")] = 0.03
    min_depth_m: Annotated[float, Bounds(0.005, 0.2), Meaning("shallowest insertion")] = 0.015
    max_depth_m: Annotated[float, Bounds(0.005, 0.2), Meaning("deepest insertion")] = 0.05
    body_drag_n: Annotated[float, Bounds(0.01, 100.0), Meaning("on the body at rest, without the pad")] = (
        2.5  # the paper's
    )
    body_damping_n_s_m: Annotated[float, Bounds(0.0, 1000.0), Meaning("growth of the body's drag with its speed")] = 6.0
    pad_width_m: Annotated[float, Bounds(0.0, 0.5), Meaning("of the pad that the body slides on, across the track")] = (
        0.015
    )
    pad_depth_m: Annotated[float, Bounds(0.0, 0.5), Meaning("of the pad in the mud")] = 0.02
    body_mass_kg: Annotated[float, Bounds(0.05, 100.0), Meaning("of the whole robot")] = 1.0
    acceleration_s: Annotated[
        float, Bounds(0.01, 10.0), Meaning("time to reach the stance's speed, in method paper")
    ] = 0.1
    mobilisation_n_m: Annotated[float, Bounds(10.0, 1e5), Meaning("stiffness of a flipper with its servo")] = (
        250.0  # logs: 300 to 700
    )
    motor_force_n: Annotated[float, Bounds(0.1, 100.0), Meaning("that a motor can exert at the plate")] = (
        6.25  # 0.75 N·m at 0.12 m
    )
    lifting_fraction: Annotated[
        float, Bounds(0.1, 1.0), Meaning("of the motor's torque that the mud may take in an extraction")
    ] = 0.95
    insertion_fraction: Annotated[
        float, Bounds(0.1, 10.0), Meaning("of the motor's torque at which an insertion ends early")
    ] = 0.73
    min_sweep_deg: Annotated[float, Bounds(1.0, 60.0), Meaning("narrowest sweep that method gait chooses")] = 30.0
    max_sweep_deg: Annotated[float, Bounds(1.0, 60.0), Meaning("widest sweep that method gait chooses")] = 50.0
    swing_duration_s: Annotated[float, Bounds(0.2, 10.0), Meaning("of the swing in method gait")] = 0.3


class DepthChoice(NamedTuple):
    depth_m: float
    slips: bool  # less than half an arm of step is promised
    reason: str
    gait: GaitParameters | None = None  # of the next stride; None: as configured


class Adaptation(Protocol):
    """Owns the depth of the next stride, and its gait where the method chooses that as well."""

    @property
    def largest_insertion_nm(self) -> float:
        """Mud's torque on the adduction joint at which an insertion ends where it is."""

    def reset(self, depth_m: float) -> None: ...

    def step(self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float) -> DepthChoice: ...


def depth_grid(parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> tuple[float, ...]:
    """From the shallowest depth to the deepest that is within reach over the whole sweep."""
    low_m = parameters.min_depth_m
    high_m = min(parameters.max_depth_m, geometry.deepest_m(gait.sweep_angle_deg))
    count = max(0, int((high_m - low_m) / GRID_M + 1e-9)) + 1
    return tuple(low_m + i * GRID_M for i in range(count))


def body_drag(parameters: AdaptationParameters, forecast: DepthForecast) -> BodyDrag:
    """With the pad's in the mud that is forecast."""
    depth_m = parameters.pad_depth_m
    pad_n = forecast.shear_at(depth_m) * parameters.pad_width_m * depth_m * depth_m / 2.0
    return BodyDrag(parameters.body_drag_n + pad_n, parameters.body_damping_n_s_m, parameters.body_mass_kg)


class DepthAdaptation:
    """Owns the depth of the next stride."""

    def __init__(self, parameters: AdaptationParameters, geometry: FlipperGeometry, gait: GaitParameters) -> None:
        self.parameters = parameters
        self.geometry = geometry
        self.gait = gait
        self.grid_m = depth_grid(parameters, geometry, gait)
        self.forecast = DepthForecast(geometry, gait, parameters.motor_force_n)
        self._durations_s = {depth_m: stride_duration_s(gait, geometry, depth_m) for depth_m in self.grid_m}
        self.reset(parameters.initial_depth_m)

    def reset(self, depth_m: float) -> None:
        self.choice = DepthChoice(depth_m, False, "start")
        self.forecast.reset()

    def step(self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float) -> DepthChoice:
        """From the strides that just closed, the depth that they were told, and the belief after them.

        Where nothing is known the depth stays.
        """
        self.forecast.update(mud_estimate, strides, walked_m)
        stuck = any(not stride.released for stride in strides)
        speeds = self._speeds_m_s()
        if speeds:
            self.choice = self._fastest(speeds, "a flipper was stuck" if stuck else "")
        elif stuck:
            self.choice = DepthChoice(max(self._that_come_out(), default=self.grid_m[0]), False, "a flipper was stuck")
        else:
            self.choice = self.choice._replace(reason="nothing known of the thrust, depth kept")
        return self.choice

    @property
    def largest_insertion_nm(self) -> float:
        return self.parameters.insertion_fraction * self.forecast.lifting_torque_nm

    def _that_come_out(self) -> list[float]:
        limit_nm = self.parameters.lifting_fraction * self.forecast.lifting_torque_nm
        return [z for z in self.grid_m if self.forecast.extraction_nm(z) < limit_nm]

    def _speeds_m_s(self) -> dict[float, float]:
        """Promised at every depth of the grid; empty where nothing is known of the thrust."""
        drag, stiffness_n_m = body_drag(self.parameters, self.forecast), 2.0 * self.parameters.mobilisation_n_m
        length_m, speeds = self.geometry.flipper_length_m, dict[float, float]()
        for depth_m in self.grid_m:
            thrust_n = self.forecast.thrust_n(depth_m)
            if thrust_n is None:
                return {}
            traction = Traction(thrust_n, stiffness_n_m)
            speeds[depth_m] = step_m(self.gait, length_m, drag, traction, depth_m) / self._durations_s[depth_m]
        return speeds

    def _fastest(self, speeds: dict[float, float], reason: str) -> DepthChoice:
        out = self._that_come_out()
        if not out:
            return self._choice(self.grid_m[0], speeds, reason or "extraction")
        best_m = max(out, key=lambda depth_m: speeds[depth_m])
        if speeds[best_m] <= 0.0:
            return self._choice(out[-1], speeds, reason or "thrust")
        return self._choice(best_m, speeds, reason or "fastest")

    def _choice(self, depth_m: float, speeds: dict[float, float], reason: str) -> DepthChoice:
        promised_m = speeds[depth_m] * self._durations_s[depth_m]
        return DepthChoice(depth_m, promised_m < self.geometry.flipper_length_m / 2.0, reason)
