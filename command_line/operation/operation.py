"""Sends an operator's commands to the running daemon."""

import argparse
import time
from collections.abc import Callable
from contextlib import suppress
from math import isfinite, radians
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from command_line import exit_codes
from command_line.errors import CommandError, usage_error
from command_line.json_output import Answer
from command_line.operation.attended_walk import attend
from command_line.operation.mode_output import mode_answer
from command_line.robot_text import MILD, Report
from command_line.screen import MARKS, coloured, complain
from command_line.shared_options import Json, Socket
from control.computing.suggestion import suggestion
from control.modes import PREVENTED
from control.records import JOINTS
from drivers.can.run_folder import find_run_folder
from experiments.study.option import Option
from firmware_host.sockets.rpc import LONGEST_ARRAY
from operator_client.default_paths import SIMULATED
from operator_client.status_client import CallRefusedError, DroppedError, NoDaemonError, StatusClient

ARMING_S = 5.0
CLEARING_S = 1.5
WAITING_S = 30.0
BEYOND_RANGE = "joint_position"  # a fault
LEAST_DEPTH_CM = 0.5  # that the daemon accepts
POLL_S = 0.05
OVERRULE = "; or overrule it with 'mudskipper arm --force CHECK'"

TakeOver: TypeAlias = Annotated[bool, Option("take the lease from a program that holds it")]


def arm(
    *,
    socket: Socket,
    force: Annotated[str, Option("overrule this check, such as uncalibrated (or A,B)", metavar="CHECK")] = "",
    wait: Annotated[bool, Option("wait up to 30 s for what ends by itself, such as a joint that moves")] = False,
    take_over: TakeOver = False,
) -> Answer:
    params = {"force": force, "take_over": take_over}
    return _change_mode("arm", "hold", socket, params, WAITING_S if wait else 0.0)


Depths = Annotated[  # the daemon knows the robot's limit
    tuple[float, ...],
    Option(
        "insertion depth of every stride, or of the strides in turn",
        unit="cm",
        low=LEAST_DEPTH_CM,
        high=20.0,
        alternative="depth",
    ),
]
Adaptive = Annotated[bool, Option("choose the depth from the mud once a stride (default)", alternative="depth")]
Water = Annotated[float | None, Option("water content of the mud", low=0.0, high=100.0, unit="%", metavar="W")]


def walk(
    *,
    socket: Socket,
    json: Json = False,
    depth: Depths = (),
    adaptive: Adaptive = False,
    gait: Annotated[str, Option("walk the gait of this file, or of one that ships", metavar="FILE")] = "",
    strides: Annotated[int, Option("stop after N (default: go on)", low=1, high=100000)] = 0,
    mud: Annotated[str | None, Option("name of the mud, for the log", metavar="NAME")] = None,
    water: Water = None,
    trial: Annotated[str | None, Option("number or name of the trial", metavar="NAME")] = None,
    operator: Annotated[str | None, Option("who operates the robot", metavar="NAME")] = None,
    tag: Annotated[tuple[str, ...], Option("word that finds this walk again", metavar="WORD")] = (),
    note: Annotated[str | None, Option("what to know about this walk", metavar="TEXT")] = None,
    attended: Annotated[bool, Option("stay connected; the robot stops when this command ends")] = False,
    take_over: TakeOver = False,
) -> Answer:
    """Walk at `depth`, or adapt to the mud without one.

    Depths in turn, such as `--depth 2 --depth 3.5 --depth 5`, measure how the coefficients change with depth.

    Without `depth` or `adaptive` a gait of a file has its own depths. 'mudskipper gait check FILE' needs no robot.

    A walk with a description is a trial, and begins a new log; `mudskipper trial set` gives defaults, and `--mud ""` or
    another empty text leaves one out.
    """
    if len(depth) > LONGEST_ARRAY:
        raise usage_error(f"--depth is given {len(depth)} times; at most {LONGEST_ARRAY} depths take turns")
    params: dict[str, Any] = {"strides": strides, "take_over": take_over}
    described = {"mud": mud, "trial": trial, "operator": operator, "tags": ",".join(tag) if tag else None, "note": note}
    described["water"] = None if water is None else f"{water:g}"
    params |= {key: value for key, value in described.items() if value is not None}
    if gait:
        from firmware_host.configuration.gait_file import as_json, gait_document  # slow to import

        params["gait"] = as_json(gait_document(gait, adaptive=adaptive))
    if depth:
        params |= {"depths_m": [each / 100.0 for each in depth]} if len(depth) > 1 else {"depth_m": depth[0] / 100.0}
    if attended:
        with StatusClient(socket) as client:
            return attend(client, json, params)
    return _change_mode("walk", "walking", socket, params)


def joint_angle(text: str) -> tuple[str, float]:
    """Parse a joint and its angle in degrees."""
    joint, _, angle_deg = text.partition("=")
    if joint and joint not in JOINTS:
        raise argparse.ArgumentTypeError(f"{text}: there is no joint {joint!r}; {suggestion(joint, JOINTS)}")
    with suppress(ValueError):
        if joint and isfinite(float(angle_deg)):
            return joint, float(angle_deg)
    raise argparse.ArgumentTypeError(f"{text}: must be a joint and its angle in degrees, such as left_sweep=10")


def move(
    angles: Annotated[
        tuple[tuple[str, float], ...],
        Option("left_sweep=10 ...", metavar="JOINT=DEG", parse=joint_angle, keyed=True, offers="{joint}="),
    ],
    *,
    socket: Socket,
    take_over: TakeOver = False,
) -> Answer:
    """Wait until the joints have arrived; Ctrl-C stops them."""
    with StatusClient(socket) as client:
        try:
            angles_rad = {f"{joint}_rad": radians(angle_deg) for joint, angle_deg in angles}
            client.call("move", take_over=take_over, **angles_rad)
            while (report := client.call("status"))["moving"]:
                time.sleep(POLL_S)
        except KeyboardInterrupt:
            client.call("stop")
            raise
    arrived = report["mode"] == "hold" and not report["notice"]
    if not arrived:
        complain(report["notice"] or f"the robot is in {report['mode']}")
    return mode_answer("move", report["mode"], status=exit_codes.OK if arrived else exit_codes.REFUSED)


def clear(
    *,
    socket: Socket,
    zero: Annotated[bool, Option("also confirm the angles of joints whose zero may have shifted")] = False,
) -> Answer:
    with StatusClient(socket) as client:
        client.call("clear", **({"zero": True} if zero else {}))
        report = _poll(client, lambda status: _is_at_rest(status) and not _stopping_causes(status), CLEARING_S)
    if causes := _stopping_causes(report):
        texts = [f"{cause['message']} {_advice(cause, Path(socket))}." for cause in causes]
        raise _refusal(f"the cause is still there: {' '.join(texts)}")
    if not _is_at_rest(report):
        raise _refusal(f"the robot is {report['mode']}: 'mudskipper status' says why")
    return mode_answer("clear", report["mode"])


def _advice(cause: Report, socket: Path) -> str:
    """Return what to do about a cause; the simulation that this socket belongs to moves a joint back."""
    advice: str = cause["what_to_do"]
    if cause["name"] != BEYOND_RANGE or socket.parent.parent != find_run_folder():
        return f"{advice[0].upper()}{advice[1:]}"
    named = "" if socket.parent.name == SIMULATED else f" --bus {socket.parent.name}"
    return f"'mudskipper simulate --reset{named}' moves it back, then 'mudskipper clear'"


def _is_at_rest(report: Report) -> bool:
    return report["mode"] in ("idle", "boot")


def _refusal(message: str) -> CommandError:
    return CommandError(message, status=exit_codes.REFUSED)


def _stopping_causes(report: Report) -> list[Report]:
    """Return the causes of faults that are more than a warning."""
    return [cause for cause in report["causes"] if cause["reaction"] not in MILD]


def _change_mode(command: str, mode: str, socket: Socket, params: dict[str, Any], waiting_s: float = 0.0) -> Answer:
    """Send the command, again for so long as it is refused, and wait for the mode that it asks for."""
    deadline_s, prevented = time.monotonic() + waiting_s, f"{command} {PREVENTED}"
    with StatusClient(socket) as client:
        _call_patiently(client, command, params, waiting_s)
        report = _poll(
            client, lambda status: status["mode"] in (mode, "fault") or status["notice"].startswith(prevented), ARMING_S
        )
    if report["mode"] == "fault":
        raise _refusal(report["fault"]["message"] if report["fault"] else report["notice"])
    if report["notice"].startswith(prevented):
        if (left_s := deadline_s - time.monotonic()) > 0.0:
            return _change_mode(command, mode, socket, params, left_s)
        raise _refusal(report["notice"])
    if report["mode"] != mode:
        raise CommandError(f"still {report['mode']} after {ARMING_S:g} s", status=exit_codes.TIMED_OUT)
    return mode_answer(command, mode, report["notice"])


def _call_patiently(client: StatusClient, command: str, params: dict[str, Any], waiting_s: float) -> None:
    """Call until it is accepted. Raises CallRefusedError after `waiting_s`, and at once where no wait would help."""
    deadline_s, reported = time.monotonic() + waiting_s, False
    while True:
        try:
            client.call(command, **params)
            return
        except CallRefusedError as problem:
            is_wrong = any(str(problem).startswith(f"{name} = ") for name in params)
            waits = time.monotonic() < deadline_s and client.call("status")["mode"] in ("boot", "idle")
            if is_wrong or not waits:
                raise
            complain(*[f"{problem} Waiting for that to end; Ctrl-C gives up"] * (not reported))
            reported = True
            time.sleep(POLL_S)


def _poll(client: StatusClient, done: Callable[[Report], bool], longest_s: float) -> Report:
    """Return the first status that is `done`, or the last one after `longest_s`."""
    deadline_s = time.monotonic() + longest_s
    while not done(report := client.call("status")) and time.monotonic() < deadline_s:
        time.sleep(POLL_S)
    return dict(report)


def check(
    *,
    socket: Socket,
    config: Annotated[Path | None, Option("used without a daemon (default: that of the service)")] = None,
) -> Answer:
    """Ask the daemon; where none runs, check what it would need."""
    try:
        with StatusClient(socket) as client:
            items = client.call("check")
    except DroppedError:
        raise
    except NoDaemonError as problem:
        from command_line.doctor.doctor import check_without_daemon  # slow to import

        items = check_without_daemon(config, str(problem))
    texts = [
        _check_text(item, [each["id"] for each in items if each.get("cause") == item["id"]])
        for item in items
        if not item.get("cause")
    ]
    is_ready = all(item["ok"] for item in items)
    return Answer(items, "\n".join(texts), exit_codes.OK if is_ready else exit_codes.UNHEALTHY)


def _check_text(item: Report, following: list[str]) -> str:
    """Format one item, and name those that follow from it."""
    level = "fail" if not item["ok"] else "warn" if item["warning"] else "ok"
    lines = [f"{coloured(*MARKS[level])} {item['id']:24} {item['text']}"]
    if following:
        lines.append(f"       and from the same cause: {', '.join(following)}")
    if item["fix"]:
        stays = item["ok"] or item.get("mandatory", True)
        lines.append(f"       -> {item['fix']}{'' if stays else OVERRULE}")
    return "\n".join(lines)
