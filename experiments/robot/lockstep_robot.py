"""A simulated robot with the daemon's calls, in step with the daemon's own loop, as fast as it computes."""

import os
import shutil
from pathlib import Path
from typing import Any

from control.controller import WalkOrder
from control.records import TWO_FLIPPERS, Rig
from drivers.drive_types import DEFAULT
from experiments.robot.log_copies import cut_log
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.rpc import RefusedError
from firmware_host.sockets.socket_methods import Level
from logs.files.log_reader import Log, read_log
from operator_client.status_client import CallRefusedError
from simulation.harness.direct import Direct
from simulation.harness.drive_presets import with_drive_type
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.local_setup import configuration_template
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import Track

CALLER = Caller(1, Peer(os.getpid(), os.geteuid(), frozenset()), Level.DRIVE)
RESTING_S = 1.0  # until the flippers lie still, as those of every robot do before it is armed


def simulated_configuration(
    sections: str = "", drive: str = "", drive_type: str = DEFAULT, rig: Rig = TWO_FLIPPERS
) -> Configuration:
    """Return the simulated robot's configuration with more sections, and more lines for each drive, as TOML.

    It is parsed from text, so that the log contains it. Raises ConfigurationError.
    """
    text = configuration_template(rig).format(left='"left"', right='"right"', logs='"logs"', status='"s"', pose='""')
    lines = [f"{line}\n{drive}" if drive and line.startswith("[drive.") else line for line in text.splitlines()]
    return parse_configuration(with_drive_type("\n".join([*lines, "", sections]), drive_type))


def start_walk(configuration: Configuration, track: Track, seed: int, order: WalkOrder, **rest: Any) -> Direct:
    """Return a robot that walks, for studies of mud. Raises RuntimeError where it does not start."""
    robot = Direct(configuration, track, seed, **rest)
    robot.run_for(RESTING_S)
    robot.arm()
    robot.walk(order)
    return robot


class LockstepRobot:
    """A BenchRobot. `lockstep` gives access to the simulation, for actions of an operator's hands."""

    def __init__(self, lockstep: Lockstep, recorder: FileRecorder) -> None:
        """`recorder` is the one of the lockstep."""
        self.lockstep = lockstep
        self._recorder = recorder
        self._methods = OperatorCalls(lockstep.loop, [], lambda: lockstep.now_s).methods
        self._log = recorder.path

    @property
    def configuration(self) -> Configuration:
        return self.lockstep.loop.configuration

    def call(self, method: str, **params: Any) -> Any:
        try:
            return self._methods[method](params, CALLER)
        except RefusedError as problem:
            raise CallRefusedError(str(problem)) from problem

    def wait(self, duration_s: float) -> None:
        self.lockstep.run_for(duration_s)

    def record(self, from_s: float, to_s: float) -> Log:
        assert self._log is not None
        if self._recorder.is_open:
            self._recorder.flush()
        return cut_log(read_log(self._log), from_s, to_s)

    def copy_logs(self, folder: Path) -> list[Path]:
        """Also ends the log."""
        self._recorder.close()
        assert self._log is not None
        copy = folder / self._log.name
        if copy.absolute() != self._log.absolute():
            shutil.copyfile(self._log, copy)
        return [copy]

    def close(self) -> None:
        if self._recorder.is_open:
            self._methods["disarm"]({}, CALLER)
            self.lockstep.run_for(0.1)
            self._recorder.close()
