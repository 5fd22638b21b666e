"""Operates a robot through the daemon's socket."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from control.modes import ENERGISED, PREVENTED, Mode
from mudskipper.ground_and_gait import Gait
from operator_client.default_paths import default_socket
from operator_client.status_client import StatusClient

POLL_S = 0.05
RESTING = tuple(mode.name.lower() for mode in Mode if mode not in ENERGISED)
Report = dict[str, Any]


class Client:
    """Owns a connection to the daemon; use it in a `with` statement.

    With `lease_s`, the orders that move the robot take a lease of so many seconds: the robot stops by itself when the
    lease ends, and no other program moves the robot meanwhile. `wait_for` renews the lease, and leaving the `with`
    statement releases it. All methods raise NoDaemonError where no daemon answers, CallRefusedError with the daemon's
    reason where it refuses an order, and NotPermittedError. Where the daemon has restarted, the call after that error
    connects again.
    """

    def __init__(self, socket: str | Path | None = None, lease_s: float = 0.0) -> None:
        """Without `socket` it is $MUDSKIPPER_SOCKET, else that of the service or of the simulated robot."""
        self._client = StatusClient(Path(socket or default_socket()))
        self._lease = {"lease_s": lease_s} if lease_s else {}
        self._leased = False
        self._has_torque = False  # after an order of this client that moves it

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Without a release, the end of the connection stops a robot that this client moves."""
        try:
            if self._leased and kind is None:
                self.release()
        finally:
            self.close()

    def close(self) -> None:
        self._client.close()

    def status(self) -> Report:
        """Return mode, faults, joints, mud and log of the robot (docs/reference/socket.md)."""
        return dict(self._client.call("status"))

    def check(self) -> list[Report]:
        """Return every condition of arming with `ok`, `text` and `fix`."""
        return list(self._client.call("check"))

    def strides(self, since: int = 0) -> list[Report]:
        """Return the first 20 strides from that number on; ask again from the next number."""
        return list(self._client.call("strides", since=since))

    def map(self) -> list[Report]:
        """Return the mud along the track since the walk began."""
        return self._client.read_map()

    def arm(self, force: str = "") -> None:
        """Energise the joints; `force` names the kind of fault to overrule, such as uncalibrated."""
        self._move("arm", force=force)

    def walk(
        self,
        strides: int = 0,
        depth_m: float | Iterable[float] | None = None,
        gait: Gait | str | Path | None = None,
        **trial: object,
    ) -> None:
        """Walk so many strides (0: without end), at a fixed depth, at several in turn, or at depths that adapt.

        `gait` is a Gait, a gait file, or the name of one that ships; without it the robot walks its own.
        `trial` describes the walk in its log, a new one: mud, water, trial, operator, tags and note.
        """
        depth = {"depths_m": list(depth_m)} if isinstance(depth_m, Iterable) else {"depth_m": depth_m}
        if gait is not None:
            trial["gait"] = (gait if isinstance(gait, Gait) else Gait(gait)).text
        self._move("walk", strides=strides, **depth, **_texts(trial))

    def stride(self, depth_m: float, **gait: float) -> None:
        """Fix the depth of the present walk, and any of sweep_angle_deg and the speeds of its phases in m/s."""
        self._client.call("stride", depth_m=depth_m, **gait)

    def trial(self, **defaults: object) -> Report:
        """Return `defaults` and the `present` description of walks; keywords change defaults, None removes one."""
        return dict(self._client.call("trial_set", **_texts(defaults)) if defaults else self._client.call("trial"))

    def note(self, text: str) -> Report:
        """Write a note into the log, and return its `time` and its `stamp_s`."""
        return dict(self._client.call("note", text=text))

    def mark(self, text: str = "") -> Report:
        """Mark this moment in the log, such as a clap that a camera records; return its `time` and its `stamp_s`."""
        return dict(self._client.call("mark", text=text))

    def move(self, **angles_rad: float) -> None:
        """Move joints slowly while the robot holds: `move(left_sweep_rad=0.1, right_sweep_rad=0.1)`."""
        self._move("move", **angles_rad)

    def _move(self, method: str, **params: Any) -> None:
        self._client.call(method, **params, **self._lease)
        self._leased, self._has_torque = bool(self._lease), method != "arm"

    def stop(self) -> None:
        """End the walk with raised flippers; no lease is needed."""
        self._client.call("stop")

    def disarm(self) -> None:
        """Switch the torque off; no lease is needed."""
        self._client.call("disarm")

    def clear(self) -> None:
        """Clear faults whose cause has ended."""
        self._client.call("clear")

    def renew(self) -> None:
        """Renew the lease, where this client has one."""
        if self._leased:
            self._client.call("lease", for_s=self._lease["lease_s"])

    def release(self) -> None:
        """End the lease."""
        self._client.call("release")
        self._leased = False

    def wait_for(self, mode: str, timeout_s: float = 30.0) -> Report:
        """Return the status once the robot is in a mode such as "hold"; renew the lease meanwhile.

        Raises TimeoutError, and at once a RuntimeError with the cause where a fault or a disarm took the torque away,
        or where a fault that came just after `arm` or `walk` prevents it.
        """
        deadline_s, had_torque, self._has_torque = time.monotonic() + timeout_s, self._has_torque, False
        while (report := self.status())["mode"] != mode:
            if problem := _why_without_torque(report, had_torque) if mode not in RESTING else "":
                raise RuntimeError(problem)
            had_torque = report["mode"] not in RESTING
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"the robot is in mode {report['mode']} after {timeout_s:g} s, not in {mode}")
            self.renew()
            time.sleep(POLL_S)
        self._has_torque = mode == "walking"
        return report


def _why_without_torque(report: Report, had_torque: bool) -> str:
    """Return what took the torque away or prevents it, or an empty text: a robot that has yet to arm had none."""
    if report["mode"] == "fault" and report["fault"]:
        return "{name}: {message}".format(**report["fault"])
    if report["notice"].startswith((f"arm {PREVENTED}", f"walk {PREVENTED}")):
        return str(report["notice"])
    was_lost = had_torque and report["mode"] in RESTING
    return (report["notice"] or f"the torque was switched off: the robot is {report['mode']}") if was_lost else ""


def _texts(trial: Mapping[str, object]) -> dict[str, str]:
    """Return the values of a description as the daemon takes them."""
    joined = {
        key: ",".join(map(str, value)) if isinstance(value, list | tuple) else value for key, value in trial.items()
    }
    return {key: "" if value is None else str(value) for key, value in joined.items()}
