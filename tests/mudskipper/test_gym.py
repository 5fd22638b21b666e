"""The Gymnasium environment keeps to Gymnasium's rules, and one step of it is one stride of the robot."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from firmware_host.configuration.file_problems import ConfigurationError
from mudskipper.ground_and_gait import Ground
from mudskipper.gym import ACTION, MudWalk, _observation
from mudskipper.stride_walks import DaemonWalk, SimulatedWalk, Stride
from tests.folders import ROOT

ENV = "mudskipper.gym:mudskipper/MudWalk-v0"


def mud(strength_pa: float) -> dict[str, Any]:
    return {"segment": [{"start_m": 0.0, "end_m": 10.0, "strength_pa": strength_pa}]}


def walked_stride(backend: str) -> tuple[float, ...]:
    """Return what a robot felt, covered, spent and earned in an episode of one stride, after which it needs a reset."""
    with gymnasium.make(ENV, backend=backend, duration_s=1.0, world=mud(1500.0)) as walk:
        walk.reset(seed=1)
        felt, reward, fault, over, info = walk.step(np.array([0.2, 0.0, 0.0], np.float32))
        assert over and not fault
        with pytest.raises(gymnasium.error.ResetNeeded):
            walk.step(np.zeros(3, np.float32))
    return *felt[6:11].tolist(), info["advance_m"], info["energy_j"], reward


@pytest.mark.filterwarnings("error", "ignore::ResourceWarning")  # another test may have left a file open
@pytest.mark.parametrize("backend", ["direct", "lockstep"])
def test_gymnasium_s_own_checker_finds_nothing(backend: str) -> None:
    check_env(gymnasium.make(ENV, render_mode="rgb_array", backend=backend, duration_s=2.0).unwrapped)


def test_a_stride_has_the_ordered_depth_and_sweep_and_advances_the_body() -> None:
    with gymnasium.make(ENV, world=mud(2000.0)).unwrapped as walk:
        assert isinstance(walk, MudWalk)
        _, info = walk.reset(seed=1)
        begun_m, advanced_m = info["body_m"], 0.0
        for action in ([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]):
            felt, reward, fault, over, info = walk.step(np.array(action, np.float32))
            advanced_m += info["advance_m"]
            assert reward == pytest.approx(100.0 * info["advance_m"] - 0.1 * info["energy_j"])
            assert isinstance(walk._walk, SimulatedWalk)
            lockstep = walk._walk._lockstep
            sweep_deg = lockstep.loop.controller.gait.next_parameters.sweep_angle_deg
            assert sweep_deg == pytest.approx(ACTION["sweep_angle_deg"][int(action[1] > 0.0)])
        assert not (over or fault)
        assert felt[9] == pytest.approx(3.0, abs=0.5)  # cm of depth: the middle of its range
        assert advanced_m == pytest.approx(info["body_m"] - begun_m) and advanced_m > 0.08
        lockstep.late_ticks = 1000
        _, _, fault, _, info = walk.step(np.zeros(3, np.float32))
        assert fault and info["fault"].startswith("The loop")  # its message, as of a daemon
        with pytest.raises(gymnasium.error.ResetNeeded):
            walk.step(np.zeros(3, np.float32))


def test_a_daemon_s_robot_whose_pose_is_missing_for_a_stride_has_its_advance_in_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """While the program learned, the joint moved by 0.1 rad at 0.5 N·m, however fast it is after it."""
    drive = {"torque_command_nm": 0.5, "velocity_rad_s": 9.0}
    rest = {"mode": "walking", "fault": None}
    walking, *later = (
        rest
        | {"strides_closed": 2 * number, "now_s": float(number), "body_x_m": x_m}
        | {"drives": [drive | {"angle_rad": angle_rad}] * 4}
        for number, (x_m, angle_rad) in enumerate([(1.2, 0.0), (1.3, 0.1), (None, None), (1.5, 0.0)])
    )
    reports = iter([{"mode": "hold"}, *later])
    client = Mock(status=lambda: next(reports), wait_for=lambda mode: walking)
    monkeypatch.setattr("mudskipper.stride_walks.Client", lambda socket, lease_s: client)
    walk = DaemonWalk({}, 1, 0.02, Path())
    strides = [walk.walk_stride() for _ in later]
    assert [stride.advance_m for stride in strides] == pytest.approx([0.1, 0.0, 0.2])
    assert [stride.energy_j for stride in strides] == pytest.approx([4 * 0.05, 0.0, 0.0])


@pytest.mark.filterwarnings("error", "ignore::ResourceWarning")  # another test may have left a file open
def test_a_walk_that_ends_before_its_first_stride_is_observed_as_unknown() -> None:
    felt = _observation(Stride([], 0.0, 1.0, 0.0, "holding", 0.0))
    assert felt.tolist() == [0.0] * 3 + [1.0] * 3 + [0.0] * 6 and MudWalk().observation_space.contains(felt)


def test_a_flipper_that_knows_nothing_is_left_out_of_the_means() -> None:
    known, unknown = ({"valid": valid, "value": 2e5, "std_error": 2e4} for valid in (True, False))
    forces = dict.fromkeys(("insertion_force_n", "stance_force_n", "extraction_force_n"), 2.0)
    report = {"k_p": known, "k_s": unknown, "k_e": unknown, "depth_m": 0.03, "step_m": 0.0, "released": True} | forces
    other = report | {"k_p": unknown, "depth_m": None, "stance_force_n": None, "released": False}
    felt = _observation(Stride([report, other], 0.0, 1.0, 0.0, "", 0.0))
    assert felt.tolist() == pytest.approx([0.2, 0.0, 0.0, 0.1, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 0.0, 0.5])


def test_a_world_is_a_file_its_tables_or_a_ground(tmp_path: Path) -> None:
    path = tmp_path / "world.toml"
    path.write_text("[[segment]]\nstart_m = 0.0\nend_m = 10.0\nstrength_pa = 900.0\n", encoding="utf-8")
    for world in (str(path), path, mud(900.0), Ground(path)):
        assert MudWalk(world=world)._world == mud(900.0)
    with pytest.raises(ConfigurationError, match="strength_pa"):
        MudWalk(world=mud(1.0))


def test_the_same_seed_gives_the_same_walk_and_another_seed_another_ground() -> None:
    def walked(seed: int) -> list[Any]:
        walk = gymnasium.make(ENV, backend="direct", duration_s=1.0)
        return [walk.reset(seed=seed)[0].tolist(), walk.step(np.zeros(3, np.float32))[0].tolist()]

    assert walked(5) == walked(5) != walked(6)


def test_without_buses_it_feels_and_pays_as_lockstep_does() -> None:
    lockstep, direct = (walked_stride(backend) for backend in ("lockstep", "direct"))
    assert direct == pytest.approx(lockstep, rel=0.1)  # it arms at another tick, so the noise is another


def test_the_order_of_hashes_does_not_matter() -> None:
    code = (
        f"import gymnasium, numpy; w = gymnasium.make({ENV!r}, backend='direct', duration_s=1.0); w.reset(seed=3);"
        "print(w.step(numpy.zeros(3, numpy.float32))[0].tolist())"
    )
    walked = {
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            check=True,
        ).stdout
        for hash_seed in ("1", "2")
    }
    assert len(walked) == 1


@pytest.mark.parametrize(
    "options",
    [{"backend": "other"}, {"socket": "s"}, {"socket": "s", "backend": "daemon"}, {"operated": True}],
)
def test_a_robot_behind_a_socket_is_moved_only_with_an_operator(options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="must be|needs"):
        MudWalk(**options)


def test_the_robot_s_own_method_walks_where_actions_are_ignored() -> None:
    with gymnasium.make(ENV, duration_s=1.0, adaptive=True, world=mud(300.0)) as walk:
        walk.reset(seed=1)
        felt, *_ = walk.step(np.full(3, -1.0, np.float32))
    assert felt[9] > 1.5  # cm, where the action says 1


@pytest.mark.parametrize("action", [[0.0, 0.0, np.nan], [0.0, 0.0, 2.0], [0.0, 0.0]])
def test_an_action_out_of_its_space_is_refused(action: list[float]) -> None:
    walk = MudWalk(backend="direct")
    with pytest.raises(gymnasium.error.ResetNeeded):
        walk.step(np.zeros(3, np.float32))
    walk.reset(seed=1)
    with pytest.raises(ValueError, match="depth_m"):
        walk.step(np.array(action, np.float32))
