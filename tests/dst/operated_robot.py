"""A robot in lockstep with the daemon's surroundings: its operator socket, its log, its shutdown and its last resort.

After each tick of the loop the socket serves its clients, as in the daemon. The clients are real connections; the peer
that the kernel would report for each is chosen here.
"""

import socket
from collections import deque
from contextlib import AbstractContextManager, ExitStack, redirect_stderr, suppress
from io import StringIO
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import msgpack

from control.records import JOINTS
from drivers.fault_injection.failure_table import SCHEDULED, FailureMode
from drivers.mit.parameters import MitParameters
from firmware_host.configuration.socket_paths import operators_path
from firmware_host.daemon import Shutdown, end_safely
from firmware_host.fault_injection.failure_calls import with_failures
from firmware_host.operator.operator_calls import Method, OperatorCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.rpc import REQUEST, RefusedError
from firmware_host.sockets.status_socket import StatusSocket
from simulation.harness.joint_energy import JointEnergy
from tests.dst.scenario import HARMING, Call, Drift, Event, Failure, HangUp, Restart, Send, Suspend, Terminate
from tests.dst.suspension import Suspension
from tests.firmware_host.sockets.served_socket import RIGHTS
from verification.faults.failing_robot import FailingRobot
from verification.faults.injection import inject

INTRUDERS = 12  # connections of one operator who wants all of them
PEERS = {
    "pilot": Peer(500, 1000, frozenset({1000, 71})),
    "second": Peer(501, 1001, frozenset({1001, 71})),
    "steward": Peer(504, 1001, frozenset({1001, 71})),
    "viewer": Peer(502, 1002, frozenset({1002, 70})),
    "guest": Peer(503, 1003, frozenset({1003})),
    **{f"intruder{number}": Peer(600 + number, 1001, frozenset({1001, 71})) for number in range(INTRUDERS)},
}
LEASED = ("arm", "walk", "move", "lease", "release")  # refused to others than the holder of the lease
OWN = ("fail", "reset_timing")  # refused to other users than that of the holder
WARNINGS: list[str] = []


class Executed(NamedTuple):
    """A call that the daemon has executed or refused."""

    method: str
    refused: bool
    against_lease: bool = False  # another program holds the lease, which the call did not ask to take over


class ActiveFailure(NamedTuple):
    """A failure that lasts, of those that the daemon does not cause itself."""

    mode: FailureMode | None  # of the table; None: a drift or a restart
    joint: str
    until_s: float
    injection: AbstractContextManager[None]


class ActiveDrift:
    """Owns the changes of one drive while its parameters drift."""

    def __init__(self, lockstep: FailingRobot, drift: Drift, begun_s: float) -> None:
        self._lockstep, self._drift, self._begun_s = lockstep, drift, begun_s
        sound = lockstep.drive(drift.joint).parameters
        self._from = {name: getattr(sound, name) for name in drift.values}
        self._changed = ExitStack()
        self.moves = True
        self.update(begun_s)

    def update(self, now_s: float) -> None:
        """Apply the values of this time, until the last ones are reached."""
        drift = self._drift
        done = (now_s - self._begun_s) / drift.over_s if drift.over_s else 1.0
        self.moves = done < 1.0
        values = {
            name: start + done * (drift.values[name] - start) if self.moves else drift.values[name]
            for name, start in self._from.items()
        }
        self._changed.close()
        self._changed.enter_context(self._lockstep.drive_changed(drift.joint, **values))

    def __enter__(self) -> None:
        """Do nothing: it has begun."""

    def __exit__(self, *problem: object) -> None:
        self.moves = False
        self._changed.close()


class Client:
    """Owns one connection to the socket. It reads its answers, so that it is not dropped, and ignores them."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._socket.setblocking(False)

    def send(self, data: bytes) -> None:
        with suppress(OSError):  # the daemon has closed the connection, or reads none of it
            self._socket.send(data)

    def read(self) -> None:
        with suppress(OSError):
            self._socket.recv(1 << 20)

    def close(self) -> None:
        self._socket.close()


class OperatedRobot:
    """Owns the robot, the socket and its clients. `calls` are those that the daemon executed in the last tick."""

    def __init__(self, lockstep: FailingRobot, folder: Path) -> None:
        self.lockstep = lockstep
        self.loop = lockstep.loop
        self.active: list[ActiveFailure] = []
        self._drifts: list[ActiveDrift] = []
        self._suspension = Suspension(lockstep)
        self.work = JointEnergy(lockstep.robot, self.loop.configuration.joint_ranges)
        self.harmed = False  # something has failed since the start
        self.calls: list[Executed] = []
        self.bug = ""  # the exception that ended the loop, or a report of one in the socket
        self.ended = False  # whether the daemon has ended
        self.heard_s = lockstep.now_s  # when the loop last may have sent a command
        self._clients: dict[str, Client] = {}
        self._coming: deque[Peer] = deque()
        self._shutdown = Shutdown()
        calls = OperatorCalls(self.loop, WARNINGS, self._clock)
        methods = with_failures(
            calls.methods, lockstep.failures, self.loop.events.report, self._clock, calls.require_own_robot
        )
        noted = {name: self._noted(name, method) for name, method in methods.items()}
        self._status = StatusSocket(folder / "s", noted, RIGHTS, lambda _: self._coming.popleft(), self._clock)
        self._status.on_hang_up = self.loop.lease.hang_up
        self._status.is_protected = lambda caller: caller == self.loop.lease.holder
        self._status.report_bug = self._report_bug

    @property
    def now_s(self) -> float:
        return self.lockstep.now_s

    def _clock(self) -> float:
        return self.lockstep.now_s

    def apply(self, event: Event) -> None:
        """Let an event happen before the next tick."""
        self.harmed = self.harmed or isinstance(event, HARMING)
        match event:
            case Call(client=client, method=method, params=params):
                self.call(client, method, **params)
            case HangUp(client=client) if client in self._clients:
                self._clients.pop(client).close()
            case Failure():
                self._begin(event)
            case Drift(joint=joint, for_s=for_s):
                self._drifts.append(ActiveDrift(self.lockstep, event, self.now_s))
                self.active.append(ActiveFailure(None, joint, self.now_s + for_s, self._drifts[-1]))
            case Restart():
                self._restart(event)
            case Suspend() if not self.ended:
                self._suspension.begin(event)
            case Send(client=client, data=data):
                self._client(client).send(data)
            case Terminate():
                self._shutdown.request(0, None)

    def _begin(self, failure: Failure) -> None:
        joint = next((each for each in JOINTS if failure.component.startswith(each)), "")
        mode = SCHEDULED.get((failure.component.replace(joint, "JOINT") if joint else failure.component, failure.kind))
        if mode is None:
            self.lockstep.fail(failure.component, failure.kind, failure.for_s)
            return
        joint = joint or JOINTS[0]
        injection = inject(self.lockstep, mode, joint)
        injection.__enter__()
        self.active.append(ActiveFailure(mode, joint, self.now_s + failure.for_s, injection))

    def _restart(self, event: Restart) -> None:
        drive = self.lockstep.drive(event.joint)
        vars(drive)["boot_s"] = event.boot_s
        drive.restart(self.lockstep.robot.now_s)
        if event.shift_rad:
            shifted = self.lockstep.drive_changed(
                event.joint, encoder_offset_rad=drive.parameters.encoder_offset_rad + event.shift_rad
            )
            shifted.__enter__()
            self.active.append(ActiveFailure(None, event.joint, inf, shifted))

    def end_failures(self, until_s: float = inf) -> None:
        """End the failures that last no longer than this."""
        for each in [each for each in self.active if each.until_s <= until_s]:
            self.active.remove(each)
            each.injection.__exit__(None, None, None)
        self._drifts = [drift for drift in self._drifts if drift.moves]

    def repair(self) -> None:
        """End every failure, and put back what has slipped; the zeros remain to be confirmed."""
        self.lockstep.failures.end_all()
        self.end_failures()
        for drive in self.lockstep.robot.drives:
            drive.slipped_rad = 0.0

    def power_cycle_failed_drives(self) -> None:
        """Do what the operator of a CubeMars does whose error outlasts its cause: no command clears it."""
        for joint, drive in zip(JOINTS, self.lockstep.robot.drives, strict=True):
            parameters = self.loop.configuration.drive[joint]
            if drive.failed and isinstance(parameters, MitParameters) and not parameters.ranges.has_registers:
                drive.restart(self.lockstep.robot.now_s)

    def call(self, client: str, method: str, **params: Any) -> None:
        self._client(client).send(msgpack.packb([REQUEST, 1, method, params]))

    def _client(self, client: str) -> Client:
        if client not in self._clients:
            self._coming.append(PEERS[client])
            path = self._status.path
            self._clients[client] = Client(
                operators_path(path) if RIGHTS.operators.gid in PEERS[client].groups else path
            )
        return self._clients[client]

    def begin_tick(self) -> None:
        """End the failures that are over, before the next tick."""
        self.end_failures(self.now_s)
        for drift in self._drifts:
            drift.update(self.now_s)
        self.calls.clear()

    def step(self) -> None:
        """Run one tick of the robot and of the daemon."""
        if self.ended:
            self.lockstep.tick_number += 1
            self.lockstep.robot.advance(self.now_s)
            return
        try:
            self.ended = self._shutdown.step(self.loop, self.now_s)
            if not self.ended:
                self._suspension.step()
                self.heard_s = max(self.now_s, self.lockstep.robot.now_s)  # a stopped tick sends its rest at its end
                self._status.serve(self.now_s)
        except Exception as problem:  # noqa: BLE001 - as in the daemon
            self._report_bug(f"{type(problem).__name__}: {problem}")
            self.ended = True
            with redirect_stderr(StringIO()):
                end_safely(self.loop, problem)
        for client in self._clients.values():
            client.read()

    def _noted(self, name: str, method: Method) -> Method:
        """Return the method, which also notes its calls."""

        def call(params: dict[str, Any], caller: Caller) -> Any:
            against_lease = name in (*LEASED, *OWN) and self._is_against_lease(name, params, caller)
            try:
                answer = method(params, caller)
            except RefusedError:
                self.calls.append(Executed(name, refused=True))
                raise
            self.harmed = self.harmed or name == "fail"
            self.calls.append(Executed(name, refused=False, against_lease=against_lease))
            return answer

        return call

    def _is_against_lease(self, name: str, params: dict[str, Any], caller: Caller) -> bool:
        lease, holder = self.loop.lease, self.loop.lease.holder
        if name in OWN:
            return lease.held and isinstance(holder, Caller) and holder.peer.uid != caller.peer.uid
        return lease.held and caller != holder and not params.get("take_over")

    def accepted(self, *methods: str) -> bool:
        """Return whether one of the methods was accepted in the last tick."""
        return any(call.method in methods and not call.refused for call in self.calls)

    def _report_bug(self, message: str) -> None:
        self.bug = self.bug or message

    def close(self) -> None:
        for client in self._clients.values():
            client.close()
        self._status.close()
