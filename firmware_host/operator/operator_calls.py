"""The methods of the status socket: what each one does to the running loop, and what it answers.

The table in socket_methods.py says who may use a method and with which parameters. The
log names the sender of every request that changes something. Methods that set the robot in motion are reserved for
the holder of the lease, if there is one; methods that end a motion are not.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import degrees, inf, isfinite
from typing import Any

from control.controller import WalkOrder
from control.fault_causes import AgedFault, group_by_cause
from control.faults import Blocks, Fault
from control.gait.stride_table import crutching_parameters, full_step_m
from control.modes import Mode, Request
from control.monitors.joint_monitor import REST_S, STILL_RAD
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath
from control.records import JOINTS
from estimation.ground_law import law_of_strides
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_checks import depth_problem, gait_problems
from firmware_host.configuration.gait_file import read_gait
from firmware_host.lease import ALWAYS_ALLOWED
from firmware_host.loop import Loop
from firmware_host.operator.arming_checks import arming_checks
from firmware_host.operator.reports import (
    cause_report,
    known,
    law_report,
    load_report,
    map_report,
    mud_estimate_report,
    stride_report,
)
from firmware_host.operator.trial_calls import TrialCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rpc import RefusedError
from firmware_host.sockets.socket_methods import (
    FAULTS_PER_ANSWER,
    GAIT_UNITS,
    METHODS,
    PIECES_PER_ANSWER,
    STRIDES_PER_ANSWER,
)
from firmware_host.sockets.status_socket import Methods
from firmware_host.software_version import is_compiled, software_version

NO_TRIAL: Mapping[str, str] = {}
Method = Callable[[dict[str, Any], Caller], Any]
RESTING_RAD_S = STILL_RAD / REST_S
MEASURED = ("angle_rad", "velocity_rad_s", "current_a", "temperature_c", "bus_voltage_v", "bus_current_a")  # by a drive
LAW_STRIDES = 5  # of each flipper, from which the law of the ground is found
PORT_COUNTERS = ("error_frames", "failed_sends", "lost_frames")


def validated(name: str, method: Method) -> Method:
    """Wrap the method in the validation of its parameters, which raises RefusedError."""
    return lambda params, caller: method(METHODS[name].read(params), caller)


class OperatorCalls:
    def __init__(
        self,
        loop: Loop,
        warnings: list[str],
        clock: Callable[[], float],
        wall_clock: Callable[[], float] = time.time,
        trial_defaults: Mapping[str, str] = NO_TRIAL,
    ) -> None:
        self._loop = loop
        self._trials = TrialCalls(loop.events, clock, wall_clock, trial_defaults)
        self._lease = loop.lease
        self._warnings = warnings
        self._clock = clock
        self._version = software_version()
        self._compiled = is_compiled()
        self._rig = loop.configuration.rig
        self._bus_of = loop.configuration.bus_of

    @property
    def methods(self) -> Methods:
        methods: dict[str, Method] = {
            "hello": lambda params, caller: {"name": self._loop.configuration.robot.name, "version": self._version},
            "status": self.status,
            "strides": self.strides,
            "map": self.map,
            "check": lambda params, caller: arming_checks(self._loop, self._warnings),
            "arm": self._as_holder(lambda params, caller: self._request(caller, Request.ARM, forced=params["force"])),
            "walk": self._as_holder(self.walk),
            "depth": self._as_holder(self.change_strides),
            "stride": self._as_holder(self.change_strides),
            "move": self._as_holder(self.move),
            "stop": self.stop,
            "disarm": lambda params, caller: self._request(caller, Request.DISARM),
            "clear": self.clear,
            "lease": lambda params, caller: self._renew_lease(caller, params["for_s"]),
            "release": self.release,
            "trial": self._trials.trial,
            "trial_set": self._trials.trial_set,
            "note": self._trials.note,
            "mark": self._trials.mark,
            "reset_timing": self.reset_timing,
        }
        return {name: validated(name, method) for name, method in methods.items()}

    def status(self, params: dict[str, Any], caller: Caller) -> dict[str, Any]:
        loop, learning, now_s = self._loop, self._loop.learning, self._clock()
        lease = loop.lease
        return {
            "schema": "status/2",
            "robot": loop.configuration.robot.name,
            "version": self._version,
            "compiled": self._compiled,
            "now_s": now_s,  # as the log's stamps
            "mode": loop.mode.name.lower(),
            "moving": loop.controller.moving,
            **self._fault_reports(),
            "forced": bool(loop.forced),
            "power_cut": loop.fault_monitor.power_cut or None,
            "notice": loop.events.notice,
            "notice_age_s": known(now_s - loop.events.notice_s),
            "unlogged_requests": loop.events.requests.unlogged,
            "lease": str(lease.holder) if lease.held else None,
            "lease_left_s": known(lease.until_s - now_s) if lease.held else None,
            **_walk_report(loop),
            "pose": loop.pose.report()._asdict(),
            "drives": [_drive_report(loop, index, joint, now_s) for index, joint in enumerate(self._rig.joints)],
            "strides_closed": learning.strides_closed,
            "stride_supply_min_v": self._stride_supply_v(),
            "mud": mud_estimate_report(learning.estimator.mud_estimate, self._rig) | {"law": self._law_report()},
            "loads": dict(zip(self._rig.flippers, map(load_report, learning.loads), strict=True)),
            "loop": loop.timing.summary(),
            "trial": self._trials.present,
            "warnings": [*loop.configuration.warnings, *self._warnings],
            "bus": _bus_report(loop),
            "log": _log_report(loop, now_s),
        }

    def _law_report(self) -> dict[str, Any] | None:
        strides = self._loop.learning.strides[-LAW_STRIDES * len(self._rig.flippers) :]
        geometry = self._loop.configuration.geometry
        return law_report(law_of_strides(geometry, [closed.estimate for closed in strides]))

    def _fault_reports(self) -> dict[str, Any]:
        """Return the fault to show first, and the gravest ones by their causes: what stopped the robot is the first."""
        present = self._loop.aged_faults
        shown = self._loop.fault or next(iter(self._loop.faults.blocking()), None)
        gravest = _gravest(present, shown)
        faults = {each.fault: _fault_report(*each) for each in gravest}
        lasting = [each for each in gravest if not self._loop.events.is_settling(each.fault)]
        causes, stop = group_by_cause(lasting, self._bus_of), self._loop.events.stop_fault
        if stop:
            causes.sort(key=lambda cause: not cause.includes(stop))
        return {
            "fault": faults[shown] if shown else None,
            "faults": list(faults.values()),
            "faults_left_out": len(present) - len(faults),
            "causes": [cause_report(cause) for cause in causes],
        }

    def _stride_supply_v(self) -> float | None:
        """Return the lowest voltage of any drive in the last stride."""
        last = self._loop.learning.strides[-len(self._rig.flippers) :]
        reported_v = (closed.supply_min_v for closed in last if isfinite(closed.supply_min_v))
        return min(reported_v, default=None)

    def strides(self, params: dict[str, Any], caller: Caller) -> list[dict[str, Any]]:
        """Return the first STRIDES_PER_ANSWER strides from number `since` on, as far back as they are stored."""
        wanted = [closed for closed in self._loop.learning.strides if closed.number >= params["since"]]
        return [
            stride_report(closed.estimate)
            | {"number": closed.number, "chosen_depth_m": closed.chosen_depth_m}
            | {"supply_min_v": known(closed.supply_min_v)}
            for closed in wanted[:STRIDES_PER_ANSWER]
        ]

    def map(self, params: dict[str, Any], caller: Caller) -> list[dict[str, Any]]:
        """Return the first PIECES_PER_ANSWER pieces of the mud's map beyond `after_m`."""
        after_m = -inf if params["after_m"] is None else params["after_m"]
        return map_report(self._loop.learning.estimator.map.rows(after_m, PIECES_PER_ANSWER))

    def walk(self, params: dict[str, Any], caller: Caller) -> str:
        depth_m, in_turn_m = params["depth_m"], params["depths_m"] or ()
        trial = self._trials.planned(params)
        if in_turn_m and depth_m is not None:
            raise RefusedError("give either depth_m or depths_m")
        depths_m = in_turn_m or (() if depth_m is None else (depth_m,))
        path = self._gait(params["gait"]) if params["gait"] and self._loop.mode is Mode.HOLD else None  # else refused
        source = f"{path.name}: depths_m: " if path and not depths_m else ""
        depths_m = depths_m or (path.depths_m if path else ())
        for each_m in depths_m:
            self._require_depth(each_m, source)
        gait = self._checked(path, depths_m) if path else None
        order = WalkOrder(
            depth_m=float(depths_m[0]) if depths_m else self._loop.configuration.adaptation.initial_depth_m,
            adaptive=not depths_m,
            strides=params["strides"],
            depths_m=tuple(map(float, depths_m)) if len(depths_m) > 1 else (),
            gait=gait,
        )
        answer = self._request(caller, Request.WALK, order)
        if path:
            self._loop.events.report(self._clock(), f"gait by {caller}: {params['gait']}")
        self._trials.begin(trial, caller)
        return answer

    def _gait(self, text: str) -> GaitPath:
        """Return the gait of a file's tables as JSON. Raises RefusedError."""
        try:
            document = json.loads(text)
            return read_gait(document if isinstance(document, dict) else {})
        except (ValueError, RecursionError):
            raise RefusedError("gait: must be the tables of a gait file as JSON") from None
        except ConfigurationError as problem:
            raise RefusedError(problem.problems[0]) from None

    def _checked(self, path: GaitPath, depths_m: Sequence[float]) -> GaitParameters | GaitPath:
        """Return the gait that the loop walks, the parameters of a crutching one. Raises RefusedError."""
        configuration, mud = self._loop.configuration, self._loop.learning.estimator.mud_estimate
        if problem := next(gait_problems(path, configuration, depths_m, mud), ""):
            raise RefusedError(problem)
        return crutching_parameters(path) or path

    def _require_depth(self, depth_m: float, source: str = "") -> None:
        """Raise RefusedError, with the source before it, for a depth beyond the configured ones."""
        if problem := depth_problem(self._loop.configuration, depth_m):
            raise RefusedError(f"{source}{problem}")

    def change_strides(self, params: dict[str, Any], caller: Caller) -> str:
        """Set the depth of the present walk, and its gait where that is given."""
        self._require_depth(params["depth_m"])
        if self._loop.mode is not Mode.WALKING:
            raise RefusedError(
                f"cannot change the depth in mode {self._loop.mode.name.lower()}: the robot does not walk"
            )
        given = {key: params[key] for key in GAIT_UNITS if params.get(key) is not None}
        if path := self._loop.controller.gait.path:
            if given:
                raise RefusedError(f"{min(given)}: must be left out while the robot walks {path.name}")
            self._checked(path, [params["depth_m"]])
        gait = replace(self._loop.controller.gait.next_parameters, **given)
        configuration, sweep_deg = self._loop.configuration, gait.sweep_angle_deg
        widest_deg = configuration.limits.widest_sweep_deg
        if sweep_deg > widest_deg:
            raise RefusedError(f"sweep_angle_deg = {sweep_deg:g}: must be at most {widest_deg:g}, the joint's range")
        deepest_m = configuration.geometry.deepest_m(sweep_deg)
        if params["depth_m"] > deepest_m:
            reach = f"must be at most {deepest_m:.4f} for a sweep of ±{sweep_deg:g} degrees"
            raise RefusedError(f"depth_m = {params['depth_m']:g}: {reach}")
        self._loop.change_strides(params["depth_m"], gait if given else None, self._clock(), str(caller))
        return "accepted"

    def move(self, params: dict[str, Any], caller: Caller) -> str:
        loop = self._loop
        joints = self._rig.joints
        angles_rad = {joint: params[f"{joint}_rad"] for joint in JOINTS if params[f"{joint}_rad"] is not None}
        if not angles_rad:
            raise RefusedError(f"no joint is named: at least one of {', '.join(f'{joint}_rad' for joint in joints)}")
        for joint in angles_rad.keys() - set(joints):
            raise RefusedError(f"this robot has no {joint}: its joints are {', '.join(joints)}")
        if loop.mode is not Mode.HOLD:
            raise RefusedError(f"cannot move joints in mode {loop.mode.name.lower()}: only in hold, so arm first")
        ranges = dict(zip(joints, loop.configuration.joint_ranges, strict=True))
        for joint, angle_rad in angles_rad.items():
            if not ranges[joint].min_rad <= angle_rad <= ranges[joint].max_rad:
                low_deg, high_deg = degrees(ranges[joint].min_rad), degrees(ranges[joint].max_rad)
                raise RefusedError(
                    f"{joint} = {degrees(angle_rad):.1f} degrees: must be from {low_deg:.1f} to {high_deg:.1f} degrees"
                )
        if loop.controller.cut_short:
            raise RefusedError("the flippers may be in the mud: 'mudskipper stop' raises them first")
        if loop.fault:
            raise RefusedError(loop.fault.message)
        loop.move(angles_rad, params["speed_rad_s"], self._clock(), str(caller))
        return "accepted"

    def _renew_lease(self, caller: Caller, for_s: float) -> str:
        is_new, now_s = self._lease.holder != caller, self._clock()
        answer = _accepted(self._lease.renew(caller, now_s, for_s))
        if is_new:
            self._loop.events.report(now_s, f"lease taken by {caller}")
        return answer

    def release(self, params: dict[str, Any], caller: Caller) -> str:
        was_held = self._lease.holder is not None
        answer = _accepted(self._lease.release(caller))
        if was_held:
            self._loop.events.report(self._clock(), f"lease released by {caller}")
        return answer

    def _as_holder(self, method: Method) -> Method:
        """Return the method, refused to every caller but the holder of the lease if there is one.

        Once the order is accepted, `take_over` ends the lease of another program and `lease_s` renews the caller's.
        """

        def call(params: dict[str, Any], caller: Caller) -> str:
            _accepted(self._lease.refusal(caller, self._clock(), params["take_over"]))
            answer: str = method(params, caller)
            self._oust(caller)
            if params["lease_s"] is not None:
                self._renew_lease(caller, params["lease_s"])
            return answer

        return call

    def _request(self, caller: Caller, request: Request, order: WalkOrder | None = None, forced: str = "") -> str:
        return _accepted(self._loop.request(request, self._clock(), order, forced, str(caller)))

    def stop(self, params: dict[str, Any], caller: Caller) -> str:
        """End a walk or a move; in hold another program that holds the lease loses it, or it might move on at once."""
        if self._loop.mode is Mode.HOLD:
            self._oust(caller)
        return self._request(caller, Request.STOP)

    def _oust(self, caller: Caller) -> None:
        """End the lease of another program, if one holds it."""
        if self._lease.held and self._lease.holder != caller:
            self._loop.events.report(self._clock(), f"lease of {self._lease.holder} taken over by {caller}")
            self._lease.oust(caller)

    def clear(self, params: dict[str, Any], caller: Caller) -> str:
        """Clear faults; with `zero`, also accept the angles of joints whose zero may have shifted."""
        loop = self._loop
        if params["zero"]:
            self.require_own_robot(caller)
            for joint, state in zip(self._rig.joints, loop.states, strict=True):
                if not abs(state.velocity_rad_s) <= RESTING_RAD_S:
                    raise RefusedError(
                        f"{joint} turns at {state.velocity_rad_s:.2f} rad/s: must be at most {RESTING_RAD_S:g} rad/s"
                        " while zeros are confirmed"
                    )
        answer = self._request(caller, Request.CLEAR)
        for zero in loop.fault_monitor.zeros if params["zero"] else ():
            if shift_rad := zero.confirm():
                loop.events.report(
                    self._clock(), f"zero of {zero.joint} confirmed by {caller} after {degrees(shift_rad):.1f} degrees"
                )
        return answer

    def require_own_robot(self, caller: Caller) -> None:
        """Raise RefusedError while a program of another user holds the lease."""
        holder = self._lease.holder
        if self._lease.held and isinstance(holder, Caller) and holder.peer.uid != caller.peer.uid:
            raise RefusedError(f"{holder} operates the robot: wait until that program has ended; {ALWAYS_ALLOWED}")

    def reset_timing(self, params: dict[str, Any], caller: Caller) -> str:
        self.require_own_robot(caller)
        self._loop.timing.reset()
        return "accepted"


def _accepted(refused: str | None) -> str:
    """Raise RefusedError with the reason, if there is one."""
    if refused:
        raise RefusedError(refused)
    return "accepted"


def _gravest(present: Sequence[AgedFault], shown: Fault | None) -> Sequence[AgedFault]:
    """Return as many as an answer has room for, the shown one first."""
    if len(present) <= FAULTS_PER_ANSWER:
        return present
    return sorted(present, key=lambda each: (each.fault != shown, -each.fault.kind.reaction))[:FAULTS_PER_ANSWER]


def _fault_report(fault: Fault, age_s: float) -> dict[str, Any]:
    return {
        "name": fault.name,
        "subject": fault.subject,
        "message": fault.message,
        "what_to_do": fault.kind.what_to_do,
        "age_s": age_s,
        "reaction": fault.kind.reaction.name.lower(),
        "blocks_arming": fault.kind.blocks is not Blocks.NO,
    }


def _drive_report(loop: Loop, index: int, joint: str, now_s: float) -> dict[str, Any]:
    state, health, drive = loop.states[index], loop.drives.health[index], loop.configuration.drive[joint]
    return {
        "joint": joint,
        **{name: known(getattr(state, name)) for name in MEASURED},
        "torque_command_nm": loop.sent.torques_nm[index],
        "closed_loop": state.closed_loop,
        "errors": health.active_errors,
        "firmware": health.firmware or None,
        "hardware": health.hardware or None,
        "watchdog_s": known(health.watchdog_s),
        "winding_c": round(loop.fault_monitor.joints[index].winding.temperature_c, 1),  # measured or estimated
        "angle_age_s": known(now_s - state.angle_stamp_s),
        "current_age_s": known(now_s - state.current_stamp_s),
        "heartbeat_age_s": known(now_s - state.heartbeat_stamp_s),
        "bus": drive.bus,
        "current_limit_a": drive.current_limit_a,
    }


def _walk_report(loop: Loop) -> dict[str, Any]:
    gait = loop.controller.gait
    return {
        "phase": loop.target.phase.name.lower(),
        "stride": loop.target.stride,
        "depth_m": loop.stride_depth_m,
        "next_depth_m": gait.next_depth_m or loop.configuration.adaptation.initial_depth_m,  # before the first walk
        "depth_reason": loop.learning.depth_reason,
        "full_step_m": 0.0 if gait.path else full_step_m(gait.next_parameters, loop.configuration.geometry),
        "body_x_m": known(loop.body.x_m),
    }


def _log_report(loop: Loop, now_s: float) -> dict[str, Any]:
    log, path = loop.recorder.report(), loop.recorder.path
    return {
        "path": str(path) if path else None,
        "dropped": log.dropped,
        "writer_alive": log.alive,
        "problem": log.problem,
        "free_fraction": known(log.free_fraction),
        "slowest_write_s": known(log.slowest_write_s),
        "durable_age_s": known(now_s - log.durable_stamp_s),
        "repairing": log.repairing,
        "quota_bytes": loop.configuration.log.quota_bytes,
        "min_free_fraction": loop.configuration.log.min_free_fraction,
    }


def _bus_report(loop: Loop) -> dict[str, Any]:
    drives, ports = loop.drives, loop.drives.ports
    return {
        "unknown_frames": drives.unknown_frames,
        "malformed_frames": drives.malformed_frames,
        "refused_commands": drives.refused_commands,
        "state": {name: port.state.name.lower() for name, port in ports.items()},
        "last_error": {name: port.last_error for name, port in ports.items() if port.last_error},
        **{name: sum(getattr(port, name) for port in ports.values()) for name in PORT_COUNTERS},
    }
