"""A Gymnasium environment, `mudskipper/MudWalk-v0`: one step of it is one stride of the simulated robot in unknown mud.

Importing this module registers it: `gymnasium.make("mudskipper/MudWalk-v0")`.

The whole product runs below it: buses, drives, estimator, monitors, limits and the daemon's own loop, in step with the
simulator (simulation/harness/lockstep.py). An action orders depth, sweep and speed of the next stride, as the socket's
`stride` does on a robot; an observation is what the robot felt in the last one. The body's advance comes from the pose,
which a robot has from its rail encoder or motion capture.

    reward = 100 (advance in m) - 0.1 (energy in J) - 5 if a flipper was stuck - 20 if a fault ended the walk

The energy is the motors' work in the stride, summed over the joints in which it is positive. `info` has the parts. A
seed draws the ground of `reset`: patches of mud with strengths, friction and noise in the ranges of the authors' logs
(simulation/mud/disturbances.py).
"""

from dataclasses import replace
from math import log
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from control.controller import WalkOrder
from control.modes import Mode
from control.records import FLIPPERS, Estimate, StrideEstimate
from experiments.pictures.side_view import view_from_side
from experiments.robot.lockstep_robot import simulated_configuration
from simulation.harness.joint_energy import JointEnergy
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

ACTION = {  # its range by name; -1 and 1 of an action are the ends
    "depth_m": (0.010, 0.045),
    "sweep_angle_deg": (15.0, 35.0),
    "stance_speed_m_s": (0.2, 0.8),
}
OBSERVATION = (  # means of both flippers; 0 where nothing is known
    "k_p (N/cm³)", "k_s (N/cm³)", "k_e (N/cm³)", "error of k_p", "error of k_s", "error of k_e", "insertion force (N)",
    "stance force (N)", "extraction force (N)", "depth (cm)", "step (cm)", "stuck",
)  # fmt: skip
STRENGTH_PA, PATCH_M = (300.0, 4000.0), (0.4, 0.9)
FRICTION_NM = (0.0, 0.05)
PATCHES, DURATION_S = 6, 60.0
FIRST_DEPTH_M = 0.02
CM_PER_M, PER_JOULE, STUCK, FAULT = 100.0, 0.1, 5.0, 20.0
LARGEST = 1000.0  # of any observation
LONGEST_STRIDE_S = 20.0  # with all attempts of a recovery
Array = NDArray[np.float32]


class MudWalk(gymnasium.Env[Array, Array]):
    """Owns a simulated robot that walks, from `reset` on."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2, "action": ACTION, "observation": OBSERVATION}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        duration_s: float = DURATION_S,
        track: Track | None = None,
        adaptive: bool = False,
    ) -> None:
        """An episode ends with the first stride after `duration_s`: who walks further was faster.

        Each episode has a random ground unless a `track` is given.

        `adaptive`: the robot's own method chooses, and actions are ignored; to compare a policy with it.
        """
        self.render_mode = render_mode
        self.action_space = Box(-1.0, 1.0, (len(ACTION),), np.float32)
        self.observation_space = Box(-LARGEST, LARGEST, (len(OBSERVATION),), np.float32)
        self._episode_s, self._given_track, self._adaptive = duration_s, track, adaptive
        self._lockstep: Lockstep | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Put the robot on a new ground, arm it, and walk the first stride at 2 cm."""
        super().reset(seed=seed)
        friction_nm = self.np_random.uniform(*FRICTION_NM)
        self._lockstep = lockstep = Lockstep(
            simulated_configuration(),
            self._given_track or self._random_track(),
            seed=int(self.np_random.integers(1, 2**31)),
            disturbances=replace(LAB, sweep_friction_nm=friction_nm, adduction_friction_nm=friction_nm),
        )
        self._energy = JointEnergy(lockstep.robot, lockstep.loop.configuration.joint_ranges)
        lockstep.arm()
        lockstep.walk(WalkOrder(FIRST_DEPTH_M, adaptive=self._adaptive))
        self._walked_s = 0.0
        self._walk_a_stride()
        return self._observation(), self._parts()

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Walk the next stride as ordered, up to the swing in which its estimates are known."""
        lockstep = self._lockstep
        if lockstep is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        if not self.action_space.contains(np.asarray(action, np.float32)):
            raise ValueError(f"action {action}: must be {len(ACTION)} numbers from -1 to 1, for {', '.join(ACTION)}")
        ordered = {
            name: low + (high - low) * (float(part) + 1.0) / 2.0
            for (name, (low, high)), part in zip(ACTION.items(), action, strict=True)
        }
        loop = lockstep.loop
        geometry, gait = loop.configuration.geometry, loop.controller.gait.parameters
        depth_m = min(ordered.pop("depth_m"), geometry.deepest_m(ordered["sweep_angle_deg"]))
        if not self._adaptive:
            loop.change_strides(depth_m, replace(gait, **ordered), lockstep.now_s, "gymnasium")
        self._walk_a_stride()
        self._walked_s += self._duration_s
        parts = self._parts()
        reward = CM_PER_M * parts["advance_m"] - PER_JOULE * parts["energy_j"]
        reward -= STUCK * parts["stuck"] + FAULT * bool(parts["fault"])
        return self._observation(), reward, bool(parts["fault"]), self._walked_s >= self._episode_s, parts

    def render(self) -> NDArray[np.uint8]:
        """Return the side view as an image of 640 by 240 pixels."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to import, and seldom wanted
        from matplotlib.figure import Figure

        from experiments.pictures.robot_sketch import draw_view, prepare

        if self._lockstep is None:
            raise gymnasium.error.ResetNeeded("call reset() before render()")
        plant, geometry = self._lockstep.robot.plant, self._lockstep.loop.configuration.geometry
        figure = Figure(figsize=(6.4, 2.4), dpi=100)
        panel = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        prepare(panel, plant.body_m - 0.2, plant.body_m + 0.28, deepest_m=0.06, highest_m=0.12)
        sweep_rad, adduction_rad = plant.arms[0].sweep_rad, plant.arms[0].adduction_rad
        draw_view(panel, view_from_side(geometry, sweep_rad, adduction_rad, plant.body_m), FLIPPERS[0])
        canvas = FigureCanvasAgg(figure)
        canvas.draw()  # type: ignore[no-untyped-call]
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        self._lockstep = None

    def _random_track(self) -> Track:
        low, high = map(log, STRENGTH_PA)
        lengths_m = self.np_random.uniform(*PATCH_M, PATCHES)
        strengths_pa = np.exp(self.np_random.uniform(low, high, PATCHES))
        patches = [(float(m), Clay(f"{pa:.0f} Pa", float(pa))) for m, pa in zip(lengths_m, strengths_pa, strict=True)]
        return Track(patches)

    def _walk_a_stride(self) -> None:
        """Walk until the next stride has closed, or a fault ends the walk."""
        lockstep = self._lockstep
        assert lockstep is not None
        loop, robot = lockstep.loop, lockstep.robot
        self._energy.begin()
        begun_m, begun_s, closed = robot.plant.body_m, lockstep.now_s, loop.learning.strides_closed
        lockstep.run_until(
            lambda: loop.learning.strides_closed > closed or loop.mode is not Mode.WALKING, LONGEST_STRIDE_S
        )
        self._advance_m, self._duration_s = robot.plant.body_m - begun_m, lockstep.now_s - begun_s
        flippers = len(loop.configuration.rig.flippers)
        self._last: list[StrideEstimate] = [each.estimate for each in loop.learning.strides[-flippers:]]

    def _parts(self) -> dict[str, Any]:
        assert self._lockstep is not None
        loop, plant = self._lockstep.loop, self._lockstep.robot.plant
        walks = loop.mode is Mode.WALKING
        return {
            "advance_m": self._advance_m,
            "duration_s": self._duration_s,
            "energy_j": sum(max(0.0, joint.work_j) for joint in self._energy.joints),
            "stuck": any(not stride.released for stride in self._last),
            "fault": "" if walks else str(loop.fault or loop.mode.name.lower()),
            "body_m": plant.body_m,
        }

    def _observation(self) -> Array:
        flippers = [
            (
                *(1e-6 * each.value if each.valid else 0.0 for each in _coefficients(stride)),
                *(each.std_error / each.value if each.valid and each.value else 1.0 for each in _coefficients(stride)),
                stride.insertion_force_n,
                stride.stance_force_n,
                stride.extraction_force_n,
                CM_PER_M * stride.depth_m,
                CM_PER_M * stride.step_m,
                float(not stride.released),
            )
            for stride in self._last
        ]
        felt: Array = np.clip(np.nan_to_num(np.mean(flippers, axis=0)), -LARGEST, LARGEST).astype(np.float32)
        return felt


def _coefficients(stride: StrideEstimate) -> tuple[Estimate, Estimate, Estimate]:
    return stride.k_p, stride.k_s, stride.k_e


gymnasium.register("mudskipper/MudWalk-v0", entry_point="mudskipper.gym:MudWalk")
