"""What a person can ask of the running daemon: the methods of the status socket."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from math import isfinite
from typing import Any

from control.controller import WalkOrder
from control.faults import silent_signals
from control.modes import Mode, Request
from control.records import JOINTS, DriveState
from drivers.odrive_codec import error_text
from firmware_host.loop import Loop
from firmware_host.recorder import Recording
from firmware_host.reports import belief_report, check_item, known, map_report, stride_report
from firmware_host.status_socket import Methods, RefusedError

MOST_STRIDES = 100000  # that a walk may be ordered
STRIDES_PER_ANSWER = 20  # an answer is made between two ticks
LARGEST_NUMBER = 2**63 - 1


def software_version() -> str:
    try:
        return version("mudskipper")
    except PackageNotFoundError:
        return "not installed"


class OperatorCalls:
    def __init__(
        self,
        loop: Loop,
        recorder: Recording,
        warnings: list[str],
        clock: Callable[[], float],
    ) -> None:
        self._loop = loop
        self._recorder = recorder
        self._warnings = warnings
        self._clock = clock
        self._version = software_version()

    @property
    def methods(self) -> Methods:
        return {
            "hello": self.hello,
            "status": self.status,
            "strides": self.strides,
            "map": self.map,
            "check": self.check,
            "arm": lambda params: self._request(Request.ARM),
            "walk": self.walk,
            "stop": lambda params: self._request(Request.STOP),
            "disarm": lambda params: self._request(Request.DISARM),
            "clear": lambda params: self._request(Request.CLEAR),
            "reset_timing": self.reset_timing,
        }

    def hello(self, params: dict[str, Any]) -> dict[str, Any]:
        return {"name": self._loop.configuration.robot.name, "version": self._version}

    def status(self, params: dict[str, Any]) -> dict[str, Any]:
        loop = self._loop
        return {
            "schema": "status/1",
            "robot": loop.configuration.robot.name,
            "version": self._version,
            "mode": loop.mode.name.lower(),
            "fault": _fault(loop),
            "notice": loop.notice if self._recorder.writer_alive else "the log's writer has died: nothing is recorded",
            "phase": loop.target_before.phase.name.lower(),
            "stride": loop.target_before.stride,
            "depth_m": loop.controller.gait.commanded_depth_m,
            "body_x_m": known(loop.body.x_m),
            "drives": [self._drive(place) for place in range(len(JOINTS))],
            "strides_closed": loop.strides_closed,
            "mud": belief_report(loop.estimator.belief),
            "loop": loop.timing.summary(),
            "warnings": self._warnings,
            "bus": self._bus(),
            "log": {
                "path": str(self._recorder.path) if self._recorder.path else None,
                "dropped": self._recorder.dropped,
                "writer_alive": self._recorder.writer_alive,
            },
        }

    def _drive(self, place: int) -> dict[str, Any]:
        state, axis, now_s = self._loop.states[place], self._loop.drives.axes[place], self._clock()
        return {
            "joint": JOINTS[place],
            "angle_rad": known(state.angle_rad),
            "velocity_rad_s": known(state.velocity_rad_s),
            "current_a": known(state.current_a),
            "torque_command_nm": self._loop.sent.torques_nm[place],
            "closed_loop": state.closed_loop,
            "errors": error_text(state.error_flags),
            "temperature_c": known(state.temperature_c),
            "bus_voltage_v": known(state.bus_voltage_v),
            "firmware": ".".join(map(str, axis.version)) if axis.version else None,
            "angle_age_s": known(now_s - state.angle_stamp_s),
            "current_age_s": known(now_s - state.current_stamp_s),
            "heartbeat_age_s": known(now_s - state.heartbeat_stamp_s),
        }

    def _bus(self) -> dict[str, Any]:
        drives = self._loop.drives
        return {
            "unknown_frames": drives.unknown_frames,
            "garbled_frames": drives.garbled_frames,
            "error_frames": sum(port.error_frames for port in drives.ports.values()),
            "failed_sends": sum(port.failed_sends for port in drives.ports.values()),
        }

    def strides(self, params: dict[str, Any]) -> list[dict[str, Any]]:
        """The first STRIDES_PER_ANSWER closed from number `since` on, as far back as they are kept."""
        since = _integer(params, "since", 0, LARGEST_NUMBER)
        wanted = [closed for closed in self._loop.strides if closed.number >= since]
        return [
            stride_report(closed.estimate) | {"number": closed.number, "chosen_depth_m": closed.chosen_depth_m}
            for closed in wanted[:STRIDES_PER_ANSWER]
        ]

    def map(self, params: dict[str, Any]) -> list[dict[str, Any]]:
        """The mud along the way, since the walk began."""
        return map_report(self._loop.estimator.map.rows())

    def walk(self, params: dict[str, Any]) -> str:
        """`depth_m` for a fixed depth, else adaptive from the configured start; `strides`, 0 without end."""
        configuration = self._loop.configuration
        strides = _integer(params, "strides", 0, MOST_STRIDES)
        depth_m = params.get("depth_m")
        if depth_m is None:
            return self._request(Request.WALK, WalkOrder(configuration.adaptation.initial_depth_m, True, strides))
        if isinstance(depth_m, bool) or not isinstance(depth_m, int | float) or not isfinite(depth_m):
            raise RefusedError(f"depth_m = {depth_m!r}: must be a number")
        deepest_m = configuration.adaptation.max_depth_m
        if not 0.0 < depth_m <= deepest_m:
            raise RefusedError(f"depth_m = {depth_m}: must be more than 0 and at most {deepest_m}")
        return self._request(Request.WALK, WalkOrder(float(depth_m), False, strides))

    def _request(self, request: Request, order: WalkOrder | None = None) -> str:
        refused = self._loop.request(request, self._clock(), order)
        if refused:
            raise RefusedError(refused)
        return "accepted"

    def reset_timing(self, params: dict[str, Any]) -> str:
        """Start the loop's statistics anew."""
        self._loop.timing.reset()
        return "accepted"

    def check(self, params: dict[str, Any]) -> list[dict[str, Any]]:
        """What stands between this robot and a walk, item by item."""
        items = [check_item("configuration", True, f"accepted for {self._loop.configuration.robot.name}", "")]
        items += [self._check_drive(joint, state) for joint, state in zip(JOINTS, self._loop.states, strict=True)]
        items.append(self._check_bus())
        items.append(self._check_arming())
        alive = self._recorder.writer_alive
        items.append(check_item("log", alive, "rows are written" if alive else "its writer has died", "restart"))
        for warning in self._warnings:
            items.append(check_item("realtime", True, f"warning: {warning}", ""))
        return items

    def _check_drive(self, joint: str, state: DriveState) -> dict[str, Any]:
        silence_s = self._loop.configuration.loop.silence_s
        missing = [signal for signal, _ in silent_signals(state, silence_s, self._clock())]
        if missing:
            fix = "check its power, wiring, node id and cyclic message periods (README, 'Setting up the drives')"
            return check_item(f"drive.{joint}", False, f"no {', '.join(missing)}", fix)
        if state.error_flags:
            fix = "mend the cause, then 'mudskipper clear'"
            return check_item(f"drive.{joint}", False, error_text(state.error_flags), fix)
        unwatched = "" if isfinite(state.temperature_stamp_s) else ", but never its temperature: no limit guards it"
        return check_item(f"drive.{joint}", True, f"heard{unwatched}", "")

    def _check_bus(self) -> dict[str, Any]:
        counts = self._bus()
        trouble = counts["error_frames"] + counts["failed_sends"]
        text = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.items())
        fix = "check wiring, termination and bit rate; 'ip -s -d link show' tells more"
        return check_item("bus", trouble == 0, text, fix)

    def _check_arming(self) -> dict[str, Any]:
        loop = self._loop
        if loop.mode is Mode.BOOT:
            return check_item("arming", False, "not every drive was heard yet", "see the drives above")
        fault = loop.fault or loop.health.fault
        if fault is not None:
            return check_item("arming", False, fault.sentence, "mend the cause, then 'mudskipper clear'")
        return check_item("arming", True, f"nothing against it; the mode is {loop.mode.name.lower()}", "")


def _fault(loop: Loop) -> dict[str, str] | None:
    """The latched one, or what stands against arming now."""
    fault = loop.fault or (loop.health.fault if loop.mode is not Mode.BOOT else None)
    return {"name": fault.name, "sentence": fault.sentence} if fault else None


def _integer(params: dict[str, Any], name: str, low: int, high: int) -> int:
    value = params.get(name, low)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise RefusedError(f"{name} = {value!r}: must be a whole number from {low} to {high}")
    return value
