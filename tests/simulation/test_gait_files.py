"""Gaits from files on the simulated robot: they advance, stop and come out of firm mud, and no coefficient is false."""

import json
from math import copysign
from typing import Any

import pytest

from control.modes import Mode
from control.records import Phase
from experiments.robot.lockstep_robot import CALLER, simulated_configuration
from firmware_host.configuration.gait_file import as_json, gait_document
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.rpc import RefusedError
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS, Clay
from simulation.mud.track import Track
from tests.recorded_events import EventRecorder

FIRM = Clay("firm", 6000.0)


class GaitWalk:
    """A robot that walks a gait through one mud."""

    def __init__(self, clay: Clay) -> None:
        self.log = EventRecorder()
        self.lockstep = Lockstep(simulated_configuration(), Track([(10.0, clay)]), recorder=self.log)
        self.lockstep.arm()
        self.loop = self.lockstep.loop
        self._calls = OperatorCalls(self.loop, [], lambda: self.lockstep.now_s)

    def call(self, method: str, **params: Any) -> None:
        self._calls.methods[method](params, CALLER)

    def walk(self, gait: str, **params: Any) -> None:
        self.call("walk", gait=as_json(gait_document(gait)), **params)

    def finish(self) -> float:
        """Walk to the end and return the advance."""
        from_m = self.loop.body.x_m
        self.lockstep.run_until(lambda: self.loop.mode is Mode.WALKING, 1.0)
        assert self.lockstep.run_until(lambda: self.loop.mode is Mode.HOLD, 60.0)
        assert not self.loop.fault
        return self.loop.body.x_m - from_m


@pytest.fixture
def medium() -> GaitWalk:
    return GaitWalk(MUDS["48.5"])


@pytest.mark.parametrize(("gait", "least_m"), [("ellipse", 0.08), ("backward", -0.08), ("alternating", 0.003)])
def test_a_gait_advances_in_its_direction(medium: GaitWalk, gait: str, least_m: float) -> None:
    medium.walk(gait, strides=1)
    advance_m = medium.finish()
    assert copysign(1.0, advance_m) == copysign(1.0, least_m)
    assert abs(advance_m) > abs(least_m)
    assert any("phase" in text and gait in text for text in medium.log.texts)  # the log has the whole gait


def test_flippers_that_stick_come_out_by_a_recovery_in_the_direction_of_the_gait() -> None:
    walk = GaitWalk(FIRM)
    walk.walk("backward", depth_m=0.045, strides=1)
    assert walk.lockstep.run_until(lambda: walk.loop.target.phase is Phase.RECOVERY, 10.0)
    assert walk.finish() < -0.08


def test_one_stuck_flipper_of_an_alternating_gait_leaves_the_other_at_its_work() -> None:
    walk = GaitWalk(FIRM)
    walk.walk("alternating")
    assert walk.lockstep.run_until(lambda: walk.loop.target.phase is Phase.RECOVERY, 10.0)
    left, right = (walk.loop.controller.joint_targets or ())[1::2]
    walk.lockstep.run_for(0.6)
    moved = (walk.loop.controller.joint_targets or ())[1::2]
    assert moved[0].angle_rad > left.angle_rad
    assert moved[1] == right


@pytest.mark.parametrize("gait", ["ellipse", "alternating"])
def test_a_stop_raises_the_flippers_from_any_path(medium: GaitWalk, gait: str) -> None:
    medium.walk(gait)
    medium.lockstep.run_until(lambda: medium.loop.target.stride >= 0, 5.0)
    medium.lockstep.run_for(0.3)  # in the mud
    medium.call("stop")
    medium.lockstep.run_until(lambda: medium.loop.mode is Mode.HOLD, 5.0)
    assert medium.loop.controller.is_up(medium.loop.states)


def test_an_insertion_ends_at_its_force(medium: GaitWalk) -> None:
    medium.walk("slow_insertion", strides=1)
    medium.lockstep.run_until(lambda: medium.loop.target.stride >= 0, 5.0)
    medium.lockstep.run_until(lambda: medium.loop.controller.gait.commanded_depth_m < 0.05, 10.0)
    reached_m = medium.loop.controller.gait.commanded_depth_m
    assert 0.005 < reached_m < 0.045
    forces_n = [load.force_z_n for load in medium.loop.learning.loads]
    assert max(forces_n) == pytest.approx(2.0, abs=0.3)


def test_a_gait_is_refused_while_the_robot_walks_and_where_it_is_wrong(medium: GaitWalk) -> None:
    wrong = json.dumps({"name": "mine", "phase": [], "depths_m": [0.03]})
    for gait in (wrong, "[1]", "{", '{"phases": 1}'):
        with pytest.raises(RefusedError):
            medium.call("walk", gait=gait)
    assert medium.loop.mode is Mode.HOLD
    medium.walk("ellipse")
    medium.lockstep.run_for(3.0)
    with pytest.raises(RefusedError):
        medium.walk("backward")
    with pytest.raises(RefusedError):
        medium.call("stride", depth_m=0.03, sweep_angle_deg=20.0)
    medium.call("depth", depth_m=0.02)
    medium.lockstep.run_for(3.0)
    assert medium.loop.controller.gait.commanded_depth_m == 0.02


@pytest.mark.parametrize("gait", ["ellipse", "alternating", "backward", "measuring"])
def test_a_gait_without_a_depth_goes_deeper_in_soft_mud(gait: str) -> None:
    soft = GaitWalk(MUDS["53.1"])
    soft.call("walk", gait=as_json(gait_document(gait, adaptive=True)), strides=2)
    soft.finish()
    assert soft.loop.learning.depth_reason == "fastest"
    assert soft.loop.controller.gait.next_depth_m > soft.loop.configuration.adaptation.initial_depth_m + 0.01
