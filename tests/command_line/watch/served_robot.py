"""A simulated robot with a status socket, both in this process: it answers like the daemon, in simulated time."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from control.controller import WalkOrder
from control.modes import Mode
from drivers.fault_injection.failures import Failures
from firmware_host.configuration.configuration import Configuration, StatusParameters
from firmware_host.log.recorder import NullRecorder
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.socket_methods import Level
from firmware_host.sockets.status_socket import StatusSocket
from firmware_host.sockets.user_groups import load_rights
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

NOBODY = Caller(0, Peer(1, 1, frozenset()), Level.DRIVE)
SLEEP_S = 0.002


def resting_robot(configuration: Configuration, failures: Failures | None = None) -> Lockstep:
    track = Track([(0.35, MUDS["48.5"]), (5.0, MUDS["53.1"])])
    return Lockstep(configuration, track, failures=failures, recorder=NullRecorder())


def walking_robot(configuration: Configuration, failures: Failures | None = None) -> Lockstep:
    robot = resting_robot(configuration, failures)
    robot.arm()
    robot.walk(WalkOrder(0.03, adaptive=True))
    robot.run_for(7.0)
    return robot


class ServedRobot:
    """Owns the robot and its methods. Ticks pass while it is served, and when a test asks for them."""

    def __init__(self, robot: Lockstep) -> None:
        self.robot = robot
        calls = OperatorCalls(self.robot.loop, [], lambda: self.robot.now_s)
        self.methods: dict[str, Callable[[dict[str, Any], Caller], Any]] = dict(calls.methods)

    def ask(self, method: str, **params: Any) -> Any:
        return self.methods[method](params, NOBODY)

    def calls_of(self, method: str) -> list[dict[str, Any]]:
        """Return the list that the parameters of each later call of this method go into."""
        calls: list[dict[str, Any]] = []
        answer = self.methods[method]

        def noted(params: dict[str, Any], caller: Caller) -> Any:
            calls.append(params)
            return answer(params, caller)

        self.methods[method] = noted
        return calls

    @property
    def mode(self) -> Mode:
        return self.robot.loop.mode

    @contextmanager
    def served(self, path: Path) -> Iterator[None]:
        """Serve the status socket in a thread, and let a tick pass every few milliseconds."""
        status, ending = StatusSocket(path, self.methods, load_rights(StatusParameters())), threading.Event()

        def serve() -> None:
            while not ending.is_set():
                self.robot.step()
                status.serve(time.monotonic())
                time.sleep(SLEEP_S)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            ending.set()
            thread.join()
            status.close()
