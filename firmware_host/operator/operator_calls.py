"""What a person can ask of the running daemon: the methods of the status socket.

Who asks for something to be done is named in the log, where it changes anything. What sets the robot in motion is for
the lease's holder, where somebody holds it; what ends a motion is for everybody.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

from control.controller import WalkOrder
from control.faults import Blocks, Fault
from control.modes import Mode, Request
from control.records import JOINTS
from firmware_host.log.recorder import Recording
from firmware_host.loop import Loop
from firmware_host.operator.arming_checks import arming_checks
from firmware_host.operator.connection import Caller
from firmware_host.operator.fault_texts import fault_message, what_to_do
from firmware_host.operator.lease import LONGEST_S, SHORTEST_S
from firmware_host.operator.reports import known, map_report, mud_estimate_report, stride_report
from firmware_host.operator.status_socket import Methods, RefusedError
from firmware_host.software_version import software_version
from firmware_host.ticker import PERIOD_S

MOST_STRIDES = 100000  # that a walk may be ordered
STRIDES_PER_ANSWER = 20  # an answer is made between two ticks
LARGEST_NUMBER = 2**63 - 1
AS_HOLDER = ("take_over", "lease_s")  # of whatever sets the robot in motion

Method = Callable[[dict[str, Any], Caller], str]


class OperatorCalls:
    def __init__(self, loop: Loop, recorder: Recording, warnings: list[str], clock: Callable[[], float]) -> None:
        self._loop = loop
        self._lease = loop.lease
        self._recorder = recorder
        self._warnings = warnings
        self._clock = clock
        self._version = software_version()

    @property
    def methods(self) -> Methods:
        return {
            "hello": lambda params, caller: self.hello(params),
            "status": lambda params, caller: self.status(params),
            "strides": lambda params, caller: self.strides(params),
            "map": lambda params, caller: self.map(params),
            "check": lambda params, caller: self.check(params),
            "arm": lambda params, caller: self._as_holder(self.arm, params, caller),
            "walk": lambda params, caller: self._as_holder(self.walk, params, caller),
            "move": lambda params, caller: self._as_holder(self.move, params, caller),
            "stop": lambda params, caller: self._request(caller, Request.STOP),
            "disarm": lambda params, caller: self._request(caller, Request.DISARM),
            "clear": lambda params, caller: self._request(caller, Request.CLEAR),
            "lease": self.lease,
            "release": self.release,
            "reset_timing": lambda params, caller: self.reset_timing(params),
        }

    def hello(self, params: dict[str, Any]) -> dict[str, Any]:
        return {"name": self._loop.configuration.robot.name, "version": self._version}

    def status(self, params: dict[str, Any]) -> dict[str, Any]:
        loop = self._loop
        return {
            "schema": "status/1",
            "robot": loop.configuration.robot.name,
            "version": self._version,
            "now_s": self._clock(),  # as the log's stamps
            "mode": loop.mode.name.lower(),
            "moving": loop.controller.moving,
            "fault": _fault(loop),
            "faults": [_fault_report(loop, fault) for fault in loop.faults.standing],
            "forced": loop.forced,
            "notice": loop.events.notice,
            "untold_requests": loop.events.requests.untold,
            "lease": str(loop.lease.holder) if loop.lease.held else None,
            "phase": loop.target_before.phase.name.lower(),
            "stride": loop.target_before.stride,
            "depth_m": loop.controller.gait.commanded_depth_m,
            "body_x_m": known(loop.body.x_m),
            "pose": loop.pose.report()._asdict(),
            "drives": [self._drive(place) for place in range(len(JOINTS))],
            "strides_closed": loop.learning.strides_closed,
            "mud": mud_estimate_report(loop.learning.estimator.mud_estimate),
            "loop": loop.timing.summary(),
            "warnings": self._warnings,
            "bus": self._bus(),
            "log": self._log(),
        }

    def _log(self) -> dict[str, Any]:
        report = self._recorder.report()
        return {
            "path": str(self._recorder.path) if self._recorder.path else None,
            "dropped": report.dropped,
            "writer_alive": report.alive,
            "problem": report.problem,
            "free_share": known(report.free_fraction),
            "slowest_write_s": known(report.slowest_write_s),
        }

    def _drive(self, place: int) -> dict[str, Any]:
        state, health, now_s = self._loop.states[place], self._loop.drives.health[place], self._clock()
        return {
            "joint": JOINTS[place],
            "angle_rad": known(state.angle_rad),
            "velocity_rad_s": known(state.velocity_rad_s),
            "current_a": known(state.current_a),
            "torque_command_nm": self._loop.sent.torques_nm[place],
            "closed_loop": state.closed_loop,
            "errors": health.active_errors,
            "temperature_c": known(state.temperature_c),
            "bus_voltage_v": known(state.bus_voltage_v),
            "firmware": health.firmware or None,
            "hardware": health.hardware or None,
            "watchdog_s": known(health.watchdog_s),
            "winding_c": round(self._loop.temperatures_c[place], 1),
            "angle_age_s": known(now_s - state.angle_stamp_s),
            "current_age_s": known(now_s - state.current_stamp_s),
            "heartbeat_age_s": known(now_s - state.heartbeat_stamp_s),
        }

    def _bus(self) -> dict[str, Any]:
        drives = self._loop.drives
        return {
            "unknown_frames": drives.unknown_frames,
            "garbled_frames": drives.garbled_frames,
            "refused_commands": drives.refused_commands,
            "state": {name: port.state.name.lower() for name, port in drives.ports.items()},
            "last_error": {name: port.last_error for name, port in drives.ports.items() if port.last_error},
            "error_frames": sum(port.error_frames for port in drives.ports.values()),
            "failed_sends": sum(port.failed_sends for port in drives.ports.values()),
            "lost_frames": sum(port.lost_frames for port in drives.ports.values()),
        }

    def strides(self, params: dict[str, Any]) -> list[dict[str, Any]]:
        """The first STRIDES_PER_ANSWER closed from number `since` on, as far back as they are kept."""
        since = _integer(params, "since", 0, LARGEST_NUMBER)
        wanted = [closed for closed in self._loop.learning.strides if closed.number >= since]
        return [
            stride_report(closed.estimate) | {"number": closed.number, "chosen_depth_m": closed.chosen_depth_m}
            for closed in wanted[:STRIDES_PER_ANSWER]
        ]

    def map(self, params: dict[str, Any]) -> list[dict[str, Any]]:
        """The mud along the way, since the walk began."""
        return map_report(self._loop.learning.estimator.map.rows())

    def arm(self, params: dict[str, Any], caller: Caller) -> str:
        """`force` overrules what is not mandatory."""
        return self._request(caller, Request.ARM, forced=_flag(params, "force"))

    def walk(self, params: dict[str, Any], caller: Caller) -> str:
        """`depth_m` for a fixed depth, else adaptive from the configured start; `strides`, 0 without end."""
        configuration = self._loop.configuration
        strides = _integer(params, "strides", 0, MOST_STRIDES)
        depth_m = params.get("depth_m")
        if depth_m is None:
            order = WalkOrder(configuration.adaptation.initial_depth_m, True, strides)
            return self._request(caller, Request.WALK, order)
        if isinstance(depth_m, bool) or not isinstance(depth_m, int | float) or not isfinite(depth_m):
            raise RefusedError(f"depth_m = {depth_m!r}: must be a number")
        deepest_m = configuration.adaptation.max_depth_m
        if not 0.0 < depth_m <= deepest_m:
            raise RefusedError(f"depth_m = {depth_m}: must be more than 0 and at most {deepest_m}")
        return self._request(caller, Request.WALK, WalkOrder(float(depth_m), False, strides))

    def move(self, params: dict[str, Any], caller: Caller) -> str:
        """Joints to angles, slowly, while the robot holds its pose: `left_sweep_rad` and so on, one or several."""
        angles_rad = _joint_angles(params)
        loop = self._loop
        if loop.mode is not Mode.HOLD:
            raise RefusedError(f"cannot move joints in mode {loop.mode.name.lower()}: only in hold, so arm first")
        ranges = dict(zip(JOINTS, loop.configuration.joint_ranges, strict=True))
        for joint, angle_rad in angles_rad.items():
            if not ranges[joint].min_rad <= angle_rad <= ranges[joint].max_rad:
                low, high = ranges[joint]
                raise RefusedError(f"{joint}_rad = {angle_rad:g}: must be from {low:.3f} to {high:.3f}")
        self._accept(_against_moving(loop))
        way = ", ".join(f"{joint} to {angle_rad:.4f} rad" for joint, angle_rad in angles_rad.items())
        loop.events.report(self._clock(), f"move {way} by {caller}")
        loop.events.notice = ""
        loop.controller.move([angles_rad.get(joint) for joint in JOINTS])
        return "accepted"

    def lease(self, params: dict[str, Any], caller: Caller) -> str:
        """Promise to renew it within `for_s`, or to be stopped. Until then nobody else moves the robot."""
        self._promise(caller, _lease_time(params, "for_s"))
        return "accepted"

    def _promise(self, caller: Caller, for_s: float) -> None:
        begins, now_s = self._lease.holder != caller, self._clock()
        self._accept(self._lease.renew(caller, now_s, for_s))
        if begins:
            self._loop.events.report(now_s, f"lease taken by {caller}")

    def release(self, params: dict[str, Any], caller: Caller) -> str:
        """End one's own lease, or whoever's was lost."""
        begun = self._lease.holder is not None
        self._accept(self._lease.release(caller))
        if begun:
            self._loop.events.report(self._clock(), f"lease released by {caller}")
        return "accepted"

    def _as_holder(self, method: Method, params: dict[str, Any], caller: Caller) -> str:
        """Only who holds the lease, where somebody does.

        Once the order is accepted `take_over` ends the lease of another, and `lease_s` promises as `lease` does.
        """
        self._accept(self._lease.refusal(caller, self._clock(), _flag(params, "take_over")))
        for_s = _lease_time(params, "lease_s") if "lease_s" in params else None
        answer = method({name: value for name, value in params.items() if name not in AS_HOLDER}, caller)
        if self._lease.held and self._lease.holder != caller:
            self._loop.events.report(self._clock(), f"lease of {self._lease.holder} taken over by {caller}")
            self._lease.oust(caller)
        if for_s is not None:
            self._promise(caller, for_s)
        return answer

    def _request(self, caller: Caller, request: Request, order: WalkOrder | None = None, forced: bool = False) -> str:
        self._accept(self._loop.request(request, self._clock(), order, forced, str(caller)))
        return "accepted"

    def _accept(self, refused: str | None) -> None:
        if refused:
            raise RefusedError(refused)

    def reset_timing(self, params: dict[str, Any]) -> str:
        """Start the loop's statistics anew."""
        self._loop.timing.reset()
        return "accepted"

    def check(self, params: dict[str, Any]) -> list[dict[str, Any]]:
        """What stands between this robot and torque, item by item."""
        return arming_checks(self._loop, str(self._recorder.path or "off"), self._warnings)


def _fault(loop: Loop) -> dict[str, Any] | None:
    """The worst that stands, or what stands against arming."""
    fault = loop.fault or next(iter(loop.faults.blocking()), None)
    return _fault_report(loop, fault) if fault else None


def _fault_report(loop: Loop, fault: Fault) -> dict[str, Any]:
    kind = fault.kind
    return {
        "name": fault.name,
        "subject": fault.subject,
        "sentence": fault_message(fault),
        "what_to_do": what_to_do(fault),
        "for_s": loop.faults.age_ticks(fault) * PERIOD_S,
        "reaction": kind.reaction.name.lower(),
        "blocks_arming": kind.blocks is not Blocks.NO,
    }


def _against_moving(loop: Loop) -> str | None:
    """Why joints that are held should stay where they are, or None."""
    if loop.controller.cut_short:
        return "the flippers may be in the mud: 'mudskipper stop' raises them first"
    return fault_message(loop.fault) if loop.fault else None


def _joint_angles(params: dict[str, Any]) -> dict[str, float]:
    """By the names of joints. Raises RefusedError for what are no angles."""
    names = {f"{joint}_rad": joint for joint in JOINTS}
    if not params:
        raise RefusedError(f"no joint is named: at least one of {', '.join(names)}")
    for name, angle_rad in params.items():
        if name not in names:
            raise RefusedError(f"{name!r} is no joint's angle: it must be one of {', '.join(names)}")
        if isinstance(angle_rad, bool) or not isinstance(angle_rad, int | float) or not isfinite(angle_rad):
            raise RefusedError(f"{name} = {angle_rad!r}: must be a number")
    return {names[name]: angle_rad for name, angle_rad in params.items()}


def _flag(params: dict[str, Any], name: str) -> bool:
    value = params.get(name, False)
    if not isinstance(value, bool):
        raise RefusedError(f"{name} = {value!r}: must be true or false")
    return value


def _lease_time(params: dict[str, Any], name: str) -> float:
    for_s = params.get(name)
    if isinstance(for_s, bool) or not isinstance(for_s, int | float) or not SHORTEST_S <= for_s <= LONGEST_S:
        raise RefusedError(f"{name} = {for_s!r}: must be a number from {SHORTEST_S:g} to {LONGEST_S:g}")
    return for_s


def _integer(params: dict[str, Any], name: str, low: int, high: int) -> int:
    value = params.get(name, low)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise RefusedError(f"{name} = {value!r}: must be a whole number from {low} to {high}")
    return value
