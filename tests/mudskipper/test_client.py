"""A user's own program operates the simulated robot in real time."""

import doctest
from pathlib import Path

import numpy as np
import pytest

import mudskipper
from control.modes import PREVENTED
from mudskipper import simulated_robot
from tests.folders import ROOT
from tests.mudskipper.test_examples import run_example
from tests.running_bench import Bench


def test_the_example_walks_three_strides(bench: Bench) -> None:
    lines = run_example("operate_robot.py", MUDSKIPPER_SOCKET=str(bench.socket)).splitlines()
    assert sum("k_p = " in line for line in lines) == 6


def test_joints_move_under_a_lease(bench: Bench) -> None:
    with mudskipper.Client(bench.socket, lease_s=1.0) as robot:
        robot.arm()
        assert robot.wait_for("hold")["lease"]
        robot.move(left_sweep_rad=0.2)
        with pytest.raises(mudskipper.CallRefusedError), mudskipper.Client(bench.socket) as other:
            other.walk(1)
        assert robot.trial(mud="A", water=49.5, plate=None)["defaults"] == {"mud": "A", "water": "49.5"}
        robot.walk(strides=1, tags=["wet", "warm"], trial=3)
        assert robot.status()["trial"] == {"mud": "A", "water": "49.5", "tags": "wet,warm", "trial": "3"}
        assert robot.trial(mud=None, water=None)["defaults"] == {}
        robot.wait_for("hold")
        robot.disarm()
        robot.wait_for("idle")
    with mudskipper.Client(bench.socket) as robot:
        assert robot.status()["lease"] is None
        with pytest.raises(TimeoutError):
            robot.wait_for("walking", timeout_s=0.1)


@pytest.mark.parametrize(("wanted", "raised"), [("hold", RuntimeError), ("idle", TimeoutError)])
def test_a_wait_for_torque_ends_at_once_with_the_fault_that_took_it_away(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, wanted: str, raised: type[Exception]
) -> None:
    fault = {"name": "overcurrent", "message": "left_sweep draws 30 A.", "what_to_do": "look"}
    monkeypatch.setattr(mudskipper.Client, "status", lambda _: {"mode": "fault", "fault": fault})
    with mudskipper.Client(bench.socket) as robot, pytest.raises(raised, match="fault|overcurrent"):
        robot.wait_for(wanted, timeout_s=0.0)


@pytest.mark.parametrize(
    ("fault", "why"), [({"message": "left_sweep has 24.0 V."}, "left_sweep has 24.0 V"), (None, "it is in mode boot")]
)
def test_a_simulated_robot_that_does_not_become_ready_says_why(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, fault: dict[str, str] | None, why: str
) -> None:
    monkeypatch.setattr(mudskipper.Client, "status", lambda _: {"mode": "boot", "fault": fault})
    monkeypatch.setattr(simulated_robot, "READY_S", 0.0)
    with pytest.raises(TimeoutError, match=f": {why}"), simulated_robot.ready_client(bench):
        pass


def test_a_wait_for_the_hold_ends_at_once_where_another_program_disarms(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    reports = iter([{"mode": mode, "fault": None, "notice": ""} for mode in ("idle", "arming", "idle")])
    monkeypatch.setattr(mudskipper.Client, "status", lambda _: next(reports))
    with mudskipper.Client(bench.socket) as robot, pytest.raises(RuntimeError, match="switched off"):
        robot.wait_for("hold")


def test_a_wait_for_the_hold_ends_at_once_where_a_fault_prevents_arming(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    idle = {"mode": "idle", "fault": None, "notice": f"arm {PREVENTED}left_sweep moves"}
    monkeypatch.setattr(mudskipper.Client, "status", lambda _: idle)
    with mudskipper.Client(bench.socket) as robot, pytest.raises(RuntimeError, match="left_sweep moves"):
        robot.wait_for("hold")


def test_a_wait_after_a_walk_sees_that_the_torque_is_off_already(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    with mudskipper.Client(bench.socket) as robot:
        idle = {"mode": "idle", "fault": None, "notice": ""}
        monkeypatch.setattr(robot._client, "call", lambda method, **params: idle)
        robot.walk()
        with pytest.raises(RuntimeError, match="switched off"):
            robot.wait_for("hold")
        with pytest.raises(TimeoutError):  # an operator may arm it again
            robot.wait_for("hold", timeout_s=0.0)


def test_the_socket_s_path_is_that_of_the_environment(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUDSKIPPER_SOCKET", str(bench.socket))
    with mudskipper.Client() as robot:
        assert robot.map() is not None and robot.check() and Path(robot.status()["log"]["path"]).exists()


def test_a_gait_of_one_s_own_walks_and_is_checked_for_the_robot(bench: Bench) -> None:
    with mudskipper.Client(bench.socket) as robot:
        robot.arm()
        robot.wait_for("hold")
        with pytest.raises(mudskipper.CallRefusedError, match="10"):
            robot.walk(1, gait=mudskipper.Gait("ellipse", depths_m=[0.10]))
        robot.walk(1, gait=mudskipper.Gait("ellipse", depths_m=[0.021]))
        assert robot.wait_for("walking")["depth_m"] == 0.021
        robot.stop()
        robot.wait_for("hold")
        robot.walk(2, depth_m=np.array([0.022, 0.03]))  # an array crosses the socket
        assert robot.wait_for("walking")["depth_m"] == 0.022
        robot.stop()
        robot.wait_for("hold")


def test_the_example_of_simulate_runs_and_its_processes_end() -> None:
    results = doctest.testmod(simulated_robot)
    assert results.attempted and not results.failed


@pytest.mark.parametrize("leaves", [RuntimeError, KeyboardInterrupt])
def test_a_program_that_fails_leaves_no_robot_behind(leaves: type[BaseException]) -> None:
    path = ROOT / "systemd/mudskipper.toml"
    with pytest.raises(leaves), mudskipper.simulate(robot=path) as robot:
        socket = Path(robot.status()["log"]["path"]).parents[2] / "mudskipper.sock"
        assert socket.exists()
        raise leaves
    assert not socket.parent.exists()
    with pytest.raises(mudskipper.NoDaemonError):
        mudskipper.Client(socket)


def test_a_world_that_cannot_be_is_refused_before_anything_starts() -> None:
    with pytest.raises(mudskipper.ConfigurationError, match="segment"), mudskipper.simulate({"segment": []}):
        pass
