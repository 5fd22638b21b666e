"""The robot that is calibrated: a real one, or a simulated one that was built with errors to be found.

Hands and tiny torques use the buses in this process, as the bench does. Weights hang for minutes on a motor that must
not let go while a disk or a terminal stalls, so they use a daemon, which this program starts on the same buses.
"""

import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any
from zlib import crc32

from experiments.actuator.bench import attended, weigh_on_robot, weigh_simulated
from experiments.actuator.file_change import Changes, changed_text
from experiments.actuator.plan import WeighingPlan
from experiments.actuator.report import Readings
from experiments.actuator.simulation import BuiltRobot
from experiments.bench.operator import BenchOperator, Hand
from experiments.bench.rig import HardwareRig, Rig, SimulatedRig
from experiments.bench.simulated_hand import SimulatedHand
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import BenchError
from experiments.robot.daemon_robot import DaemonRobot
from experiments.study.session import Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from operator_client.status_client import NoDaemonError, StatusClient
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness.blocks import on_blocks
from simulation.harness.local_setup import named_folder
from simulation.harness.parent_process import end_with_parent

STARTING_S, ENDING_S, POLL_S = 30.0, 20.0, 0.1
FILE = "mudskipper.toml"  # of the daemon that holds the weights


@dataclass(frozen=True)
class CalibratedRobot:
    """A real robot, or where it was `built` otherwise than configured a simulated one."""

    session: Session
    built: BuiltRobot | None = None
    seed: int = 1
    practises: bool = False  # a person answers the prompts, and the simulated hands do what they ask for

    @contextmanager
    def open(self, configuration: Configuration) -> Iterator[TestRig]:
        """Open the robot's buses, with a loop that believes in a configuration. Raises BenchError."""
        rig: Rig
        if self.built is None:
            rig, hand = HardwareRig(configuration), Hand()
        else:
            rig = SimulatedRig(configuration, self.built.configuration, _drives_of(self.built), self.seed)
            hand = SimulatedHand(rig)
        with TestRig(rig, BenchOperator(self.session.operator, hand)) as test_rig:
            for warning in rig.warnings:
                self.session.operator.report(f"warning: {warning}")
            yield test_rig

    def weigh(self, configuration: Configuration, plan: WeighingPlan) -> tuple[Readings, list[Path]]:
        """Return the readings of the weights, and the logs."""
        if self.built is not None:
            return weigh_simulated(configuration, plan, self.session, self.seed, self.built, self.practises)
        with running_daemon(configuration, self.session.folder) as socket:
            robot = DaemonRobot(socket)
            with attended(robot, self.session) as logs:
                readings = weigh_on_robot(robot, plan, self.session)
        return readings, logs


@contextmanager
def running_daemon(configuration: Configuration, folder: Path) -> Iterator[Path]:
    """Run a daemon with this configuration, and yield its socket. Raises BenchError where it does not start."""
    name = f"{crc32(bytes(folder.absolute())):08x}.sock"  # of this calibration alone, and the same when it continues
    socket = named_folder("calibration") / name
    paths: Changes = {("status", "socket"): str(socket), ("log", "directory"): str((folder / "logs").absolute())}
    path, messages = folder / FILE, folder / "mudskipperd.txt"
    path.write_text(changed_text(configuration.text, paths), encoding="utf-8")
    command = [sys.executable, "-m", "firmware_host.daemon", "--config", str(path)]
    with messages.open("wb") as log:  # Ctrl-C is for this program: the daemon's weight is taken off first
        daemon = subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True, preexec_fn=end_with_parent)  # noqa: PLW1509
    try:
        _wait_for(daemon, socket, messages)
        yield socket
    finally:
        daemon.terminate()
        daemon.wait(ENDING_S)


def _wait_for(daemon: subprocess.Popen[bytes], socket: Path, messages: Path) -> None:
    for _ in range(round(STARTING_S / POLL_S)):
        if daemon.poll() is not None:
            break
        with suppress(NoDaemonError):
            StatusClient(socket).close()
            return
        time.sleep(POLL_S)
    reported = messages.read_text(encoding="utf-8", errors="replace").strip().splitlines() or ["it reports nothing"]
    raise BenchError(f"the daemon that holds the weights did not start: {reported[-1]}")


def _drives_of(built: BuiltRobot) -> Mapping[str, SimulatedDriveParameters]:
    """Return the simulated drives on blocks, with the motors' own torque constant."""
    return {
        joint: replace(drive, torque_constant_error=built.constant_nm_a / drive.torque_constant_nm_a - 1.0)
        for joint, drive in on_blocks(built.configuration).drives(built.configuration).items()
    }


def build_with_errors(configuration: Configuration, seed: int) -> BuiltRobot:
    """Return a robot with one joint's sign, another's zero, and all torque constants other than configured."""
    random = Random(f"built {seed}")
    signed, shifted = random.sample(configuration.rig.joints, 2)
    off_turn = random.choice((-1, 1)) * random.uniform(0.03, 0.1)
    changes: dict[tuple[str, ...], Any] = {
        ("drive", signed, "sign"): -configuration.drive[signed].sign,
        ("drive", shifted, "zero_turn"): round(configuration.drive[shifted].zero_turn + off_turn, 3),
    }
    return BuiltRobot(parse_configuration(changed_text(configuration.text, changes)))
