"""Sends an operator's commands to the running daemon.

It imports the standard library and msgpack only, so these commands start fast.
"""

import argparse
import time
from collections.abc import Callable
from math import degrees, radians
from typing import Any

from command_line import exit_codes
from command_line.drive_state import torque_state
from command_line.json_output import print_value
from command_line.operation.attended_walk import MILD, attend
from command_line.operation.mode_output import print_mode
from command_line.screen import BOLD, GREEN, RED, YELLOW, coloured, complain
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import number, table
from operator_client.status_client import (
    CallRefusedError,
    DroppedError,
    NoDaemonError,
    NotPermittedError,
    StatusClient,
)

Options = argparse.Namespace
ARMING_S = 5.0
CLEARING_S = 1.5
POLL_S = 0.05
SIMULATE = "Without a robot, 'mudskipper simulate' makes one."
MODE_COLOURS = {"fault": RED, "damping": RED, "walking": GREEN, "hold": GREEN, "stopping": YELLOW, "arming": YELLOW}


def with_daemon(options: Options, act: Callable[[StatusClient], int]) -> int:
    """Calls `act` with a client; prints why that failed and returns the exit status."""
    try:
        client = StatusClient(options.socket)
        try:
            return act(client)
        finally:
            client.close()
    except DroppedError as problem:
        complain(str(problem))
        return exit_codes.NO_DAEMON
    except NoDaemonError as problem:
        complain(f"{problem}. Start it with 'systemctl start mudskipper', or name its socket with --socket. {SIMULATE}")
        return exit_codes.NO_DAEMON
    except NotPermittedError as problem:
        complain(str(problem))
        return exit_codes.NOT_PERMITTED
    except CallRefusedError as problem:
        complain(str(problem))
        return exit_codes.REFUSED


def status(options: Options) -> int:
    def show(client: StatusClient) -> int:
        report = client.call("status")
        if options.json:
            print_value(report)
        else:
            print(status_text(report))
        return exit_codes.UNHEALTHY if report["mode"] in ("fault", "damping") else exit_codes.OK

    return with_daemon(options, show)


def arm(options: Options) -> int:
    params = {"force": options.force, "take_over": options.take_over}
    return with_daemon(options, lambda client: _request(client, options, "hold", ARMING_S, params))


def walk(options: Options) -> int:
    params: dict[str, Any] = {"strides": options.strides, "take_over": options.take_over}
    if options.depth is not None:
        params["depth_m"] = options.depth / 100.0
    if options.attended:
        return with_daemon(options, lambda client: attend(client, options, params))
    return with_daemon(options, lambda client: _request(client, options, "walking", ARMING_S, params))


def move(options: Options) -> int:
    """Waits until the joints have arrived; Ctrl-C stops them."""
    joints = [joint for joint, _ in options.angles]
    if twice := next((joint for joint in joints if joints.count(joint) > 1), None):
        complain(f"{twice} is named twice")
        return exit_codes.USAGE

    def act(client: StatusClient) -> int:
        try:
            angles_rad = {f"{joint}_rad": radians(angle_deg) for joint, angle_deg in options.angles}
            client.call("move", take_over=options.take_over, **angles_rad)
            while (report := client.call("status"))["moving"]:
                time.sleep(POLL_S)
        except KeyboardInterrupt:
            client.call("stop")
            raise
        arrived = report["mode"] == "hold" and not report["notice"]
        print_mode(options, report["mode"], reached=arrived)
        if arrived:
            return exit_codes.OK
        complain(report["notice"] or f"the robot is in {report['mode']}")
        return exit_codes.REFUSED

    return with_daemon(options, act)


def clear(options: Options) -> int:
    def act(client: StatusClient) -> int:
        client.call("clear")
        report = _poll(
            client, lambda status: status["mode"] in ("idle", "boot") and not stopping_faults(status), CLEARING_S
        )
        messages = [fault["message"] for fault in stopping_faults(report)]
        if report["mode"] in ("idle", "boot") and not messages:
            print_mode(options, report["mode"])
            return exit_codes.OK
        complain(f"the cause is still there: {' '.join(messages) or report['mode']}")
        return exit_codes.REFUSED

    return with_daemon(options, act)


def stopping_faults(report: dict[str, Any]) -> list[dict[str, Any]]:
    """Returns the active faults that are more than a warning."""
    return [fault for fault in report["faults"] if fault["reaction"] not in MILD]


def _request(client: StatusClient, options: Options, mode: str, longest_s: float, params: dict[str, Any]) -> int:
    """Sends the command and waits until the robot is in the mode that it asks for."""
    client.call(options.command, **params)
    report = _poll(client, lambda status: status["mode"] in (mode, "fault"), longest_s)
    if report["mode"] == mode:
        print_mode(options, mode, report["notice"])
        return exit_codes.OK
    if report["mode"] == "fault":
        complain(report["fault"]["message"] if report["fault"] else report["notice"])
        return exit_codes.REFUSED
    complain(f"still {report['mode']} after {longest_s:g} s")
    return exit_codes.TIMED_OUT


def _poll(client: StatusClient, done: Callable[[dict[str, Any]], bool], longest_s: float) -> dict[str, Any]:
    """Returns the first status that is `done`, or the last one after `longest_s`."""
    deadline_s = time.monotonic() + longest_s
    while not done(report := client.call("status")) and time.monotonic() < deadline_s:
        time.sleep(POLL_S)
    return dict(report)


def check(options: Options) -> int:
    """Asks the daemon; where none runs, checks what it would need."""
    try:
        StatusClient(options.socket).close()
    except NoDaemonError as problem:
        from command_line.doctor.doctor import check_without_daemon  # imports too much for `status`

        return _show_items(options, check_without_daemon(options.config, str(problem)))
    except NotPermittedError:
        pass  # with_daemon reports it
    return with_daemon(options, lambda client: _show_items(options, client.call("check")))


def _show_items(options: Options, items: list[dict[str, Any]]) -> int:
    if options.json:
        print_value(items)
    else:
        for item in items:
            if not item.get("cause"):
                print(_check_text(item, [each["id"] for each in items if each.get("cause") == item["id"]]))
    return exit_codes.OK if all(item["ok"] for item in items) else exit_codes.UNHEALTHY


def _check_text(item: dict[str, Any], following: list[str]) -> str:
    """Formats one item, and names those that follow from it."""
    mark = coloured("ok  ", GREEN) if item["ok"] else coloured("FAIL", RED)
    lines = [f"{mark} {item['id']:24} {item['text']}"]
    if following:
        lines.append(f"       and from the same cause: {', '.join(following)}")
    if item["fix"] and not item["ok"]:
        overruled = "" if item.get("mandatory", True) else "; or overrule it with 'mudskipper arm --force'"
        lines.append(f"       -> {item['fix']}{overruled}")
    return "\n".join(lines)


def status_text(report: dict[str, Any]) -> str:
    mode = coloured(report["mode"], MODE_COLOURS.get(report["mode"], BOLD))
    stride = "no stride" if report["stride"] < 0 else f"stride {report['stride']}"
    lines = [f"{report['robot']}: {mode}, {stride}, {report['phase']}"]
    lines[0] += f", depth {100 * report['depth_m']:.1f} cm, body {number(report['body_x_m'])} m"
    if report["mode"] == "boot":
        lines.append(_boot_line(report["drives"]))
    lines += [_cause_text(cause) for cause in report["causes"]]
    if report["lease"]:
        lines.append(f"the lease is held by {report['lease']} for {number(report['lease_left_s'], 1)} s more")
    notices = [report["notice"]] if report["notice"] else []
    if report["forced"]:
        notices.append("armed by 'mudskipper arm --force' against failed checks: see 'mudskipper check'")
    if report["pose"]["trouble"]:
        notices.append(f"{report['pose']['trouble']} 'mudskipper check' says what to do")
    lines += [coloured(f"warning: {warning}", YELLOW) for warning in notices + report["warnings"]]
    lines += ["", _drives_table(report["drives"]), "", _loop_text(report)]
    return "\n".join(lines)


def _boot_line(drives: list[dict[str, Any]]) -> str:
    signals = ("angle_age_s", "current_age_s", "heartbeat_age_s")
    unheard = [drive["joint"] for drive in drives if any(drive[signal] is None for signal in signals)]
    return coloured(f"not heard yet: {', '.join(unheard) or 'none'}; 'mudskipper check' says what to do", YELLOW)


def _cause_text(cause: dict[str, Any]) -> str:
    colour = YELLOW if cause["reaction"] in MILD else RED
    against = ", prevents arming" if cause["blocks_arming"] else ""
    lines = [f"{cause['name']} ({cause['reaction'].replace('_', ' ')}{against}): {cause['message']}"]
    if cause["consequences"]:
        lines.append(f"    and {counted(len(cause['consequences']), 'fault')} as its consequence")
    return coloured("\n".join([*lines, f"    -> {cause['what_to_do']}"]), colour)


def _drives_table(drives: list[dict[str, Any]]) -> str:
    rows = [
        ("joint", "angle (°)", "current (A)", "torque (N·m)", "motor (°C)", "bus (V)", "age (ms)", "torque", "errors")
    ]
    for drive in drives:
        angle_rad, age_s = drive["angle_rad"], drive["angle_age_s"]
        rows.append(
            (
                drive["joint"],
                number(None if angle_rad is None else degrees(angle_rad), 1),
                number(drive["current_a"], 2),
                number(drive["torque_command_nm"], 3),
                number(drive["temperature_c"], 0),
                number(drive["bus_voltage_v"], 1),
                number(None if age_s is None else 1e3 * age_s, 1),
                torque_state(drive),
                drive["errors"] or "-",
            )
        )
    return table(rows)


def _loop_text(report: dict[str, Any]) -> str:
    loop, bus, log = report["loop"], report["bus"], report["log"]
    late, tick, pose = loop["wake_late_us"], loop["tick_us"], report["pose"]
    poses = f"{pose['source']}: {pose['poses']} poses, {pose['malformed']} malformed, {pose['lost']} without the body"
    return "\n".join(
        (
            f"loop   {loop['rate_hz']:.2f} Hz, {loop['ticks']} ticks, {loop['missed_ticks']} missed",
            f"late   {late['p50']:.0f} us median, {late['p99']:.0f} p99, {late['max']:.0f} worst",
            f"tick   {tick['p50']:.0f} us median, {tick['p99']:.0f} p99, {tick['max']:.0f} worst,"
            f" {'compiled' if report.get('compiled') else 'interpreted'}",
            f"bus    {bus['unknown_frames']} unknown, {bus['malformed_frames']} malformed,"
            f" {bus['error_frames']} error frames, {bus['failed_sends']} failed sends"
            + (f", {bus['lost_frames']} frames lost" if bus["lost_frames"] else "")
            + (f", {bus['refused_commands']} commands refused" if bus["refused_commands"] else ""),
            f"pose   {poses if pose['source'] else 'none'}",
            f"log    {log['path'] or 'off'}, {counted(log['dropped'], 'row')} dropped",
        )
    )
