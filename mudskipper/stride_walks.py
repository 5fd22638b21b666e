"""Walks of which each stride is ordered: of a robot simulated in this process, and of one that a daemon runs.

Both report a stride with the same keys and units: those of the socket's `strides`, and its advance, time and energy.
"""

import time
from collections.abc import Mapping
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from math import fsum
from pathlib import Path
from typing import Any, NamedTuple

from control.controller import WalkOrder
from control.modes import Mode
from experiments.robot.lockstep_robot import simulated_configuration
from firmware_host.operator.reports import stride_report
from mudskipper.client import Client
from mudskipper.simulated_robot import simulate
from simulation.harness.joint_energy import JointEnergy
from simulation.harness.lockstep import Lockstep
from simulation.harness.world import read_world

LONGEST_STRIDE_S = 20.0  # with all attempts of a recovery
POLL_S = 0.02
LEASE_S = 5.0  # a program that learns for longer between two strides loses the robot, which stops
Tables = dict[str, Any]  # of a world file


class Stride(NamedTuple):
    reports: list[dict[str, Any]]  # of each flipper
    advance_m: float
    duration_s: float
    energy_j: float  # the motors' work, summed over the joints in which it is positive
    fault: str  # that ended the walk
    body_m: float


class SimulatedWalk:
    """Owns a robot that is simulated in step with the daemon's loop: `kind` is Lockstep or Direct."""

    def __init__(self, kind: type[Lockstep], world: Tables, seed: int, depth_m: float | None) -> None:
        """Start a walk at this depth, or at depths that adapt."""
        configuration, ground = simulated_configuration(), read_world(world)
        plant, drives = ground.plant(configuration), ground.drives(configuration)
        self._lockstep = lockstep = kind(configuration, ground.track, seed, plant=plant, drives=drives)
        self._energy = JointEnergy(lockstep.robot, configuration.joint_ranges)
        lockstep.arm()
        initial_m = configuration.adaptation.initial_depth_m
        lockstep.walk(WalkOrder(depth_m or initial_m, adaptive=depth_m is None))

    def order(self, depth_m: float, gait: Mapping[str, float]) -> None:
        loop = self._lockstep.loop
        present = loop.controller.gait.parameters
        loop.change_strides(depth_m, replace(present, **gait), self._lockstep.now_s, "gymnasium")

    def walk_stride(self) -> Stride:
        """Walk until the next stride has closed, or a fault ends the walk."""
        lockstep, loop, plant = self._lockstep, self._lockstep.loop, self._lockstep.robot.plant
        self._energy.begin()
        begun_m, begun_s, closed = plant.body_m, lockstep.now_s, loop.learning.strides_closed
        lockstep.run_until(
            lambda: loop.learning.strides_closed > closed or loop.mode is not Mode.WALKING, LONGEST_STRIDE_S
        )
        flippers = len(loop.configuration.rig.flippers)
        ended = loop.fault.message if loop.fault else loop.mode.name.lower()
        return Stride(
            reports=[stride_report(each.estimate) for each in loop.learning.strides[-flippers:]],
            advance_m=plant.body_m - begun_m,
            duration_s=lockstep.now_s - begun_s,
            energy_j=fsum(max(0.0, joint.work_j) for joint in self._energy.joints),
            fault="" if loop.mode is Mode.WALKING else ended,
            body_m=plant.body_m,
        )

    def view(self) -> tuple[float, float, float]:
        """Return sweep and adduction angle of the left flipper, and the position of the body."""
        plant = self._lockstep.robot.plant
        return plant.arms[0].sweep_rad, plant.arms[0].adduction_rad, plant.body_m

    def end(self) -> None:
        """Does nothing: time stands still."""

    close = end


class DaemonWalk:
    """Owns a connection to a robot in real time: one that it starts in a world, or that of a socket, armed already."""

    def __init__(self, world: Tables, seed: int, depth_m: float | None, socket: Path | None = None) -> None:
        with ExitStack() as begun:
            owned = simulate(world, seed=seed) if socket is None else closing(Client(socket, lease_s=LEASE_S))
            self._client = client = begun.enter_context(owned)
            if socket is None:
                client.arm()
                client.wait_for("hold")
            elif (mode := client.status()["mode"]) != "hold":
                raise RuntimeError(
                    f"the robot is in mode {mode}: before each reset its operator puts it on fresh mud and arms it"
                )
            client.walk(depth_m=depth_m)
            self._before = client.wait_for("walking")
            self._body_m: float | None = self._before["body_x_m"]  # where it was seen last, if ever
            self._connection = begun.pop_all()

    def order(self, depth_m: float, gait: Mapping[str, float]) -> None:
        self._client.stride(depth_m, **gait)

    def walk_stride(self) -> Stride:
        """Wait for the end of the stride; the time since the last one counts too.

        A motor's work is its torque along the path of its joint between two reports. While the program learns, nothing
        is reported: paths there and back cancel each other, so a stride of which little was seen has too little energy.
        A stride that ends without a pose has no advance: the next one with a pose has that of both.
        """
        first = last = self._before
        work_j = [0.0] * len(first["drives"])
        while last["strides_closed"] == first["strides_closed"] and last["mode"] == "walking":
            time.sleep(POLL_S)
            before, last = last, self._client.status()
            self._client.renew()
            for joint, (start, end) in enumerate(zip(before["drives"], last["drives"], strict=True)):
                if start["angle_rad"] is not None and end["angle_rad"] is not None:
                    torque_nm = (start["torque_command_nm"] + end["torque_command_nm"]) / 2.0
                    work_j[joint] += torque_nm * (end["angle_rad"] - start["angle_rad"])
        self._before, begun_m = last, self._body_m
        if last["body_x_m"] is not None:
            self._body_m = last["body_x_m"]
        flippers = len(last["drives"]) // 2
        reports = self._client.strides(since=max(last["strides_closed"] - flippers, 0))
        fault = last["fault"]["message"] if last["fault"] else last["mode"]
        return Stride(
            reports=reports,
            advance_m=0.0 if begun_m is None else (self._body_m or 0.0) - begun_m,
            duration_s=last["now_s"] - first["now_s"],
            energy_j=fsum(max(0.0, each) for each in work_j),
            fault="" if last["mode"] == "walking" else fault,
            body_m=self._body_m or 0.0,
        )

    def view(self) -> tuple[float, float, float]:
        sweep, lift = self._before["drives"][:2]
        return sweep["angle_rad"], lift["angle_rad"], self._body_m or 0.0

    def end(self) -> None:
        """Stop the robot and switch its torque off: only its operator, who arms it, lets it walk again."""
        self._client.stop()
        with suppress(RuntimeError):  # a fault or an operator has switched the torque off already
            self._client.wait_for("hold")
            self._client.disarm()
        self._client.release()

    def close(self) -> None:
        """A robot that still walks stops, since its lease is lost and not released."""
        self._connection.close()
