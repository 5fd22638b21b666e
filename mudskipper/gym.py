"""A Gymnasium environment, `mudskipper/MudWalk-v0`: one step of it is one stride of a robot in unknown mud.

Importing this module registers it: `gymnasium.make("mudskipper/MudWalk-v0")`.

An action orders depth, sweep and speed of the next stride, as the socket's `stride` does on a robot; an observation is
what the robot felt in the last one. Backends: `lockstep`, the whole product with buses, drives, monitors and the
daemon's own loop in step with the simulator; `direct`, the same without buses and frames, faster; `daemon`, a simulated
robot in real time with a daemon of its own, or the one of a `socket`, which may be real: then an operator has to watch
it, says so by `operated`, and arms it before each reset. The body's advance comes from the pose, which a robot has from
its rail encoder or motion capture.

    reward = 100 (advance in m) - 0.1 (energy in J) - 5 if a flipper was stuck - 20 if a fault ended the walk

The energy is the motors' work in the stride, summed over the joints in which it is positive. `info` has the parts. A
seed draws the world of `reset`: patches of mud with strengths, a weak or a firm layer in some of them, friction and
noise in the ranges of the authors' logs (simulation/mud/disturbances.py), and motors with torque constants that differ.
"""

from dataclasses import asdict, replace
from math import log
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from control.records import COEFFICIENTS, FLIPPERS
from experiments.pictures.side_view import view_from_side
from experiments.robot.lockstep_robot import simulated_configuration
from mudskipper.ground_and_gait import World, ground_of
from mudskipper.stride_walks import DaemonWalk, SimulatedWalk, Stride, Tables
from simulation.harness.direct import Direct
from simulation.harness.lockstep import Lockstep
from simulation.mud.disturbances import LAB

Backend = Literal["direct", "lockstep", "daemon"]
ACTION = {  # its range by name; -1 and 1 of an action are the ends
    "depth_m": (0.010, 0.050),
    "sweep_angle_deg": (15.0, 35.0),
    "stance_speed_m_s": (0.2, 0.8),
}
OBSERVATION = (  # means of what is known of the flippers; 0 where nothing is, and an error of 1
    "k_p (N/cm³)", "k_s (N/cm³)", "k_e (N/cm³)", "error of k_p", "error of k_s", "error of k_e", "insertion force (N)",
    "stance force (N)", "extraction force (N)", "depth (cm)", "step (cm)", "stuck",
)  # fmt: skip
STRENGTH_PA, PATCH_M = (300.0, 4000.0), (0.4, 0.9)
FRICTION_NM = (0.0, 0.05)
LAYERED, LAYER_TOP_M, LAYER_FACTOR = (
    0.3,
    (0.01, 0.04),
    (0.4, 2.0),
)  # a fraction of the patches has a layer down from there
TORQUE_ERROR = 0.03  # the standard deviation of a robot's torque constants
PATCHES, DURATION_S = 6, 60.0
FIRST_DEPTH_M = 0.02
CM_PER_M, PER_JOULE, STUCK, FAULT = 100.0, 0.1, 5.0, 20.0
SCALES = [1.0] * 9 + [CM_PER_M] * 2 + [1.0]  # from the reports to OBSERVATION
NOTHING_FELT = [0.0] * 3 + [1.0] * 3 + [0.0] * 6  # no stride has closed yet
LARGEST = 1000.0  # of any observation
Array = NDArray[np.float32]


class MudWalk(gymnasium.Env[Array, Array]):
    """Owns a robot that walks, from `reset` on.

    >>> walk = MudWalk(backend="direct")
    >>> felt, info = walk.reset(seed=1)
    >>> felt, reward, fault, over, info = walk.step(np.zeros(3, np.float32))
    >>> fault, over, info["stuck"]
    (False, False, False)
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2, "action": ACTION, "observation": OBSERVATION}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        backend: Backend = "lockstep",
        duration_s: float = DURATION_S,
        world: World | None = None,
        adaptive: bool = False,
        socket: str | Path | None = None,
        operated: bool = False,
    ) -> None:
        """An episode ends with the first stride after `duration_s`: who walks further was faster.

        Each episode has a random world unless a `world` is given, a Ground, a world file or its tables.

        `adaptive`: the robot's own method chooses, and actions are ignored; to compare a policy with it.
        """
        if backend not in (known := ("direct", "lockstep", "daemon")):
            raise ValueError(f"backend = {backend!r}: must be one of {', '.join(known)}")
        if socket is not None and (backend != "daemon" or world is not None):
            raise ValueError(f"socket = {str(socket)!r}: needs backend = 'daemon', and a robot there has its own world")
        if (socket is not None) is not operated:
            raise ValueError(f"operated = {operated}: must be True with a socket, and an operator by the robot")
        self.render_mode = render_mode
        self.action_space = Box(-1.0, 1.0, (len(ACTION),), np.float32)
        self.observation_space = Box(-LARGEST, LARGEST, (len(OBSERVATION),), np.float32)
        self._backend, self._episode_s, self._adaptive = backend, duration_s, adaptive
        self._world = None if world is None else ground_of(world).tables
        self._socket = None if socket is None else Path(socket)
        self._geometry = simulated_configuration().geometry
        self._walk: SimulatedWalk | DaemonWalk | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Put a simulated robot on a new ground, arm it, and walk the first stride: at 2 cm, unless it is adaptive."""
        super().reset(seed=seed)
        self.close()
        world, number = self._world or self._random_world(), int(self.np_random.integers(1, 2**31))
        depth_m = None if self._adaptive else FIRST_DEPTH_M
        if self._backend == "daemon":
            self._walk = DaemonWalk(world, number, depth_m, self._socket)
        else:
            self._walk = SimulatedWalk(Direct if self._backend == "direct" else Lockstep, world, number, depth_m)
        self._walked_s, self._ended = 0.0, False
        stride = self._walk.walk_stride()
        return _observation(stride), _parts(stride)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Walk the next stride as ordered, up to the swing in which its estimates are known.

        Raises ResetNeeded before `reset` and after the end of an episode.
        """
        walk = self._walk
        if walk is None or self._ended:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        if not self.action_space.contains(np.asarray(action, np.float32)):
            raise ValueError(f"action {action}: must be {len(ACTION)} numbers from -1 to 1, for {', '.join(ACTION)}")
        ordered = {
            name: low + (high - low) * (float(part) + 1.0) / 2.0
            for (name, (low, high)), part in zip(ACTION.items(), action, strict=True)
        }
        depth_m = min(ordered.pop("depth_m"), self._geometry.deepest_m(ordered["sweep_angle_deg"]))
        if not self._adaptive:
            walk.order(depth_m, ordered)
        stride = walk.walk_stride()
        self._walked_s += stride.duration_s
        parts, over = _parts(stride), self._walked_s >= self._episode_s
        if over or stride.fault:
            self._ended = True
            walk.end()
        reward = CM_PER_M * parts["advance_m"] - PER_JOULE * parts["energy_j"]
        reward -= STUCK * parts["stuck"] + FAULT * bool(parts["fault"])
        return _observation(stride), reward, bool(parts["fault"]), over, parts

    def render(self) -> NDArray[np.uint8]:
        """Return the side view as an image of 640 by 240 pixels."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to import, and seldom wanted
        from matplotlib.figure import Figure

        from experiments.pictures.robot_sketch import draw_view, prepare

        if self._walk is None:
            raise gymnasium.error.ResetNeeded("call reset() before render()")
        sweep_rad, adduction_rad, body_m = self._walk.view()
        figure = Figure(figsize=(6.4, 2.4), dpi=100)
        panel = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        prepare(panel, body_m - 0.2, body_m + 0.28, deepest_m=0.06, highest_m=0.12)
        draw_view(panel, view_from_side(self._geometry, sweep_rad, adduction_rad, body_m), FLIPPERS[0])
        canvas = FigureCanvasAgg(figure)
        canvas.draw()  # type: ignore[no-untyped-call]
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        walk, self._walk = self._walk, None
        if walk:
            walk.close()

    def _random_world(self) -> Tables:
        """Draw the tables of a world file."""
        random = self.np_random
        friction_nm = float(random.uniform(*FRICTION_NM))
        disturbances = replace(LAB, sweep_friction_nm=friction_nm, adduction_friction_nm=friction_nm)
        ends_m = np.cumsum(random.uniform(*PATCH_M, PATCHES))
        segments, start_m = [], 0.0
        for end_m in map(float, ends_m):
            strength_pa = float(np.exp(random.uniform(log(STRENGTH_PA[0]), log(STRENGTH_PA[1]))))
            segments.append({"start_m": start_m, "end_m": end_m, "strength_pa": strength_pa, "layer": self._layers()})
            start_m = end_m
        return {
            "segment": segments,
            "disturbances": asdict(disturbances),
            "drives": {"torque_constant_error": float(random.normal(0.0, TORQUE_ERROR))},
        }

    def _layers(self) -> list[Tables]:
        top_m, factor = self.np_random.uniform(*LAYER_TOP_M), self.np_random.uniform(*LAYER_FACTOR)
        layer = {"top_m": float(top_m), "bottom_m": 1.0, "factor": float(factor)}
        return [layer] if self.np_random.random() < LAYERED else []


def _parts(stride: Stride) -> dict[str, Any]:
    parts = stride._asdict()
    return parts | {"stuck": any(not each["released"] for each in parts.pop("reports"))}


def _observation(stride: Stride) -> Array:
    flippers = []
    for each in stride.reports:
        known = [each[name] if each[name]["valid"] and each[name]["value"] else None for name in COEFFICIENTS]
        felt = [1e-6 * k["value"] if k else None for k in known]
        felt += [k["std_error"] / k["value"] if k else None for k in known]
        felt += [each[f"{phase}_force_n"] for phase in ("insertion", "stance", "extraction")]
        flippers.append([*felt, each["depth_m"], each["step_m"], not each["released"]])
    means = np.ma.masked_invalid(np.array(flippers or [NOTHING_FELT], float)).mean(axis=0)
    observed: Array = np.clip(means.filled(NOTHING_FELT) * SCALES, -LARGEST, LARGEST).astype(np.float32)
    return observed


gymnasium.register("mudskipper/MudWalk-v0", entry_point="mudskipper.gym:MudWalk")
