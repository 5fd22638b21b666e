"""The paper's choice of depth (section III-D), for comparison with the default one.

From the last stride's coefficients, by the laws of the plate's edge, b its width and t its thickness:

    no slip       2 f_x(z) > f_r + f_a      f_x = k_s b z²/2     f_r = drag + k_s · pad     f_a = m v / t_acc / 2
    extraction    f_e(z) < f_m              f_e = k_e b t z

The paper names both conditions, but not the depth that it takes between them. Its adaptive speed in the firm mud
(6.4 cm/s; at a depth of 5 cm: 6.6) suggests the deepest that comes out, which this method takes. The estimates are used
without their uncertainty; as on the paper's robot, the right flipper decides while it has an estimate. A motor at its
limit measures no more than f_m, so its force cannot show that f_e is greater. The body's motion can: a flipper that
came out late and pulled the body back (or no pose excludes that) proves f_e ≥ f_m at its depth, until the mud changes.
"""

from collections.abc import Sequence
from math import inf

from control.computing.bounded_work import Work, finished
from control.depth.depth_choice import DepthChoice, depth_grid
from control.depth.forecast import GRID_M
from control.geometry import FlipperGeometry
from control.mud_estimate import MudEstimate
from control.parameters.adaptation_parameters import AdaptationParameters
from control.parameters.gait_parameters import GaitParameters
from control.plate_integrals import mean_width_m, moment_width_m
from control.records import TWO_FLIPPERS, Estimate, Rig, StrideEstimate

NOT_REPORTED = Estimate(0.0, 0.0, 0, False)


class PaperAdaptation:
    """Owns the last coefficients that were valid, and the depth of the next stride."""

    def __init__(
        self,
        parameters: AdaptationParameters,
        geometry: FlipperGeometry,
        gait: GaitParameters,
        rig: Rig = TWO_FLIPPERS,
    ) -> None:
        self.parameters = parameters
        self.geometry = geometry
        self.gait = gait
        self._flippers = len(rig.flippers)
        self.grid_m = depth_grid(parameters, geometry, gait)
        self.reset(parameters.initial_depth_m)

    def reset(self, depth_m: float) -> None:
        self.choice = DepthChoice(depth_m, False, "start")
        self._k_s = self._k_e = NOT_REPORTED
        self._late_m = inf  # depth of the last stride, if a flipper was still in the mud after its extraction
        self._stuck_m = inf  # the shallowest one in this mud whose swing pulled the body back

    def prepare(self) -> Work[None]:
        return finished(None)

    def choose(
        self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float
    ) -> Work[DepthChoice]:
        for stride in sorted(strides, key=lambda stride: stride.flipper):  # the right one last
            self._k_s = stride.k_s if stride.k_s.valid else self._k_s
            self._k_e = stride.k_e if stride.k_e.valid else self._k_e
        self._remember(mud_estimate, strides, walked_m)
        if self._k_e.valid or self._stuck_m < inf:
            out = [depth_m for depth_m in self.grid_m if self._comes_out(depth_m)]
            depth_m = max(out, default=self.grid_m[0])
            self.choice = DepthChoice(depth_m, self._slips(depth_m), "deepest that comes out" if out else "extraction")
        else:
            self.choice = self.choice._replace(reason="no k_e known, depth kept")
        return finished(self.choice)

    @property
    def largest_insertion_nm(self) -> float:
        """Infinite: the paper's robot always inserts to the chosen depth."""
        return inf

    def _remember(self, mud_estimate: MudEstimate, strides: Sequence[StrideEstimate], walked_m: float) -> None:
        """Record a stuck stride; the step just measured includes the swing of the stride before."""
        if mud_estimate.boundary:
            self._stuck_m = inf
        if not all(stride.step_m >= self.geometry.flipper_length_m / 2.0 for stride in strides):
            self._stuck_m = min(self._stuck_m, self._late_m)
        self._late_m = inf if all(stride.released for stride in strides) else walked_m

    def _comes_out(self, depth_m: float) -> bool:
        edge_m2 = mean_width_m(self.geometry, depth_m) * self.geometry.plate_thickness_m
        extraction_n = self._k_e.value * edge_m2 * depth_m
        return depth_m < self._stuck_m - GRID_M / 2.0 and extraction_n < self.parameters.motor_force_n

    def _slips(self, depth_m: float) -> bool:
        if not self._k_s.valid:
            return False
        thrust_n = self._k_s.value * moment_width_m(self.geometry, depth_m) * depth_m * depth_m / 2.0
        return self._flippers * thrust_n <= self._resistance_n()

    def _resistance_n(self) -> float:
        """Return f_r + f_a, with f_a = m α l / (t_acc t_s) and the stance time t_s = 2 α l / v."""
        parameters = self.parameters
        pad_n = self._k_s.value * parameters.pad_width_m * parameters.pad_depth_m**2 / 2.0
        inertial_n = parameters.body_mass_kg * self.gait.stance_speed_m_s / (2.0 * parameters.paper.acceleration_s)
        return parameters.body_drag_n + pad_n + inertial_n
