"""The Gymnasium environment keeps to Gymnasium's rules, and one step of it is one stride of the robot."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from mudskipper.gym import ACTION, MudWalk
from simulation.mud.clay import Clay
from simulation.mud.track import Track

ENV = "mudskipper.gym:mudskipper/MudWalk-v0"


@pytest.mark.filterwarnings("error")
def test_gymnasium_s_own_checker_finds_nothing() -> None:
    check_env(gymnasium.make(ENV, render_mode="rgb_array", duration_s=4.0).unwrapped)


def test_a_stride_has_the_ordered_depth_and_sweep_and_advances_the_body() -> None:
    with gymnasium.make(ENV, duration_s=4.0, track=Track([(10.0, Clay("mud", 2000.0))])).unwrapped as walk:
        assert isinstance(walk, MudWalk)
        _, info = walk.reset(seed=1)
        begun_m, advanced_m = info["body_m"], 0.0
        for action in ([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]):
            felt, reward, fault, over, info = walk.step(np.array(action, np.float32))
            advanced_m += info["advance_m"]
            assert reward == pytest.approx(100.0 * info["advance_m"] - 0.1 * info["energy_j"])
            assert walk._lockstep is not None
            sweep_deg = walk._lockstep.loop.controller.gait.next_parameters.sweep_angle_deg
            assert sweep_deg == pytest.approx(ACTION["sweep_angle_deg"][int(action[1] > 0.0)])
        assert over and not fault
        assert felt[9] == pytest.approx(2.75, abs=0.5)  # cm of depth: the middle of its range
        assert advanced_m == pytest.approx(info["body_m"] - begun_m) and advanced_m > 0.08


def test_the_same_seed_gives_the_same_walk_and_another_seed_another_ground() -> None:
    def walked(seed: int) -> list[Any]:
        walk = gymnasium.make(ENV, duration_s=3.0)
        first, _ = walk.reset(seed=seed)
        return [first.tolist(), *(walk.step(np.zeros(3, np.float32))[0].tolist() for _ in range(2))]

    assert walked(5) == walked(5) != walked(6)


def test_the_robot_s_own_method_walks_where_actions_are_ignored() -> None:
    with gymnasium.make(ENV, duration_s=1.0, adaptive=True, track=Track([(10.0, Clay("mud", 300.0))])) as walk:
        walk.reset(seed=1)
        felt, *_ = walk.step(np.full(3, -1.0, np.float32))
    assert felt[9] > 1.5  # cm, where the action says 1


@pytest.mark.parametrize("action", [[0.0, 0.0, np.nan], [0.0, 0.0, 2.0], [0.0, 0.0]])
def test_an_action_out_of_its_space_is_refused(action: list[float]) -> None:
    walk = MudWalk(duration_s=3.0)
    with pytest.raises(gymnasium.error.ResetNeeded):
        walk.step(np.zeros(3, np.float32))
    walk.reset(seed=1)
    with pytest.raises(ValueError, match="depth_m"):
        walk.step(np.array(action, np.float32))
