"""A robot as an experiment operates it: the daemon's calls, time that passes, and what the log holds of it.

The calls are those of the status socket. Behind them is the daemon on a robot, or the daemon's own loop in step with a
simulated one; an experiment cannot tell which. Everything that it knows of the robot comes from answers and log.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

from experiments.robot.bench_errors import BenchError as BenchError  # for whoever operates one
from experiments.robot.bench_errors import DaemonLostError, EndedError, RobotInUseError
from experiments.robot.prompt import Operator
from firmware_host.configuration.configuration import Configuration
from firmware_host.log_reading.log_reader import Log
from firmware_host.operator.counted_nouns import counted
from firmware_host.operator.status_client import CallRefusedError

POLL_S = 0.05
ARMING_S = 10.0
MOVING_S = 20.0
RAISING_S = 10.0
STRIDE_S = 60.0  # longest, with pauses and recoveries
GONE_S = 1.5  # in which a fault is over whose cause has gone or was cleared
MOST_CLEARS = 3  # of a fault that comes back
MOST_WISHES = 3  # to be armed: what takes one away is over in a blink, or stands
CLEAR, LEAVE = "c", ""  # what a person says of a fault: Enter, pressed in haste, clears nothing
UNDER_WAY = ("walking", "stopping", "damping")
ENERGISED = ("arming", "hold", *UNDER_WAY)
ALONE = (
    "the robot cannot be told to rest: it stops by itself, and its torque goes off within seconds; look before you"
    " reach for it"
)


class BenchRobot(Protocol):
    @property
    def configuration(self) -> Configuration: ...

    def call(self, method: str, **params: Any) -> Any:
        """The daemon's answer. Raises CallRefusedError with its sentence, BenchError where none comes."""

    def wait(self, duration_s: float) -> None:
        """Time passes for the robot, attended: it stops by itself where this program no longer is."""

    def record(self, from_s: float, to_s: float) -> Log:
        """What the log holds of a time by the robot's clock (`now_s` of its status). Raises BenchError."""

    def copy_logs(self, folder: Path) -> list[Path]:
        """The logs of what was done, in a folder; none where nothing was. Raises BenchError."""

    def close(self) -> None:
        """Torque off, connection closed. Never raises what `call` may raise."""


class CompletedWalk(NamedTuple):
    """A walk that ended with all its strides, and when it was, by the robot's clock."""

    strides: list[dict[str, Any]]  # as the status socket tells them, of both flippers
    from_s: float
    to_s: float


Status = dict[str, Any]
End = TypeVar("End")
Evaluator = Callable[[Status], End | None]  # None while a walk is to go on; then how it ends


def wait_until(robot: BenchRobot, done: Callable[[Status], bool], longest_s: float, what: str) -> Status:
    """The status that `done` accepts. Raises BenchError with `what` it was that did not happen."""
    status: Status = robot.call("status")
    begun_s = status["now_s"]
    while not done(status):
        if status["now_s"] - begun_s > longest_s:
            raise BenchError(f"{what} did not happen within {longest_s:g} s: the robot is in {status['mode']}")
        robot.wait(POLL_S)
        status = robot.call("status")
    return status


def ask_to_clear_faults(robot: BenchRobot, operator: Operator) -> None:
    """What keeps the torque off is told, and cleared where a person says so; nothing where nothing does.

    Someone has to have looked: the drive that a fault stopped may be wet, or a finger be in the flipper. Nobody on a
    terminal is an error of its own, so the fault stands then. AutomaticOperator clears: behind it is a simulated robot.

    Raises EndedError where it is to stand, BenchError where it comes back.
    """
    for _ in range(MOST_CLEARS):
        if not (faults := _faults_reported(_status_at_rest(robot))):
            return
        question = f"{faults}\nTorque stays off until this is cleared."
        if (
            operator.ask(question, {CLEAR: "clear it and go on", LEAVE: "stop here"}, lambda: robot.wait(POLL_S))
            != CLEAR
        ):
            raise EndedError(
                "the fault stands; when its cause is gone, 'mudskipper clear', then the same command again"
            )
        robot.call("clear")
    if faults := _faults_reported(_status_at_rest(robot)):
        raise BenchError(f"the fault comes back: {faults}")


def _status_at_rest(robot: BenchRobot) -> Status:
    """When what was about to be over by itself is."""
    status: Status = robot.call("status")
    begun_s = status["now_s"]
    while _faults_reported(status) and status["now_s"] - begun_s < GONE_S:
        robot.wait(POLL_S)
        status = robot.call("status")
    return status


def _faults_reported(status: Status) -> str:
    """Of a robot whose torque is off; empty where nothing keeps it off."""
    if status["mode"] not in ("idle", "fault"):
        return ""
    faults = [fault for fault in status["faults"] if fault["blocks_arming"]]
    if status["mode"] == "fault" and not faults:
        faults = [status["fault"]] if status["fault"] else []
    reported = [f"  {fault['message']} ({_for(fault['age_s'])})\n    -> {fault['what_to_do']}" for fault in faults]
    if status["mode"] == "fault":
        return "\n".join(["The robot is in FAULT:", *(reported or [f"  {status['notice']}"])])
    return "\n".join(["A fault stands:", *reported]) if reported else ""


def _for(duration_s: float) -> str:
    return f"for {duration_s:.0f} s" if duration_s < 100.0 else f"for {duration_s / 60.0:.0f} min"


def arm(robot: BenchRobot, operator: Operator | None = None) -> None:
    """From whatever it does to holding its pose. Raises BenchError with what stands against it.

    A fault is for `person` to judge; where nobody is there it stands.
    """
    status = robot.call("status")
    if status["mode"] in ("arming", *UNDER_WAY):
        status = wait_until(robot, lambda now: now["mode"] in ("hold", "idle", "fault"), ARMING_S, "coming to rest")
    if status["mode"] == "hold":
        return
    if operator is not None:
        ask_to_clear_faults(robot, operator)
    elif status["mode"] == "fault":
        raise BenchError(f"{_faults_reported(status)}\n'mudskipper clear' when its cause is gone")
    try:
        _ask_for_torque(robot)
    except (BenchError, CallRefusedError) as problem:
        raise BenchError(_why_not_armed(robot, str(problem))) from problem


def _ask_for_torque(robot: BenchRobot) -> None:
    """Again only where a fault of the wish's own tick took it away, as of a flipper that sinks; not where somebody did.

    Raises BenchError, CallRefusedError.
    """
    for _ in range(MOST_WISHES):
        wait_until(robot, lambda now: now["mode"] == "idle" and not _blocked(now), ARMING_S, "being ready to arm")
        robot.call("arm")
        robot.wait(POLL_S)  # longer than a tick: what is idle then has lost the wish
        status = wait_until(robot, lambda now: now["mode"] != "arming", ARMING_S, "arming")
        if status["mode"] != "idle" or not _blocked(status):
            break
    if status["mode"] != "hold":
        raise BenchError(reported_by(status))


def _blocked(status: Status) -> bool:
    return any(fault["blocks_arming"] for fault in status["faults"])


def _why_not_armed(robot: BenchRobot, problem: str) -> str:
    blocking = [fault for fault in robot.call("status")["faults"] if fault["blocks_arming"]]
    faults = [f"{fault['message'].rstrip('.')} ({fault['what_to_do']})" for fault in blocking]
    return f"the robot is not armed: {'; '.join(faults) or problem}. 'mudskipper check' tells more"


def disarm(robot: BenchRobot) -> None:
    robot.call("disarm")
    wait_until(robot, lambda now: now["mode"] not in ENERGISED, ARMING_S, "switching torque off")


def move(robot: BenchRobot, angles_rad: Mapping[str, float]) -> None:
    """Joints of a robot that holds its pose, until they are there. Raises BenchError."""
    require_hold(robot.call("status"))
    robot.call("move", **{f"{joint}_rad": angle_rad for joint, angle_rad in angles_rad.items()})
    after = wait_until(robot, lambda now: not now["moving"], MOVING_S, "moving the joints")
    require_hold(after)
    if after["notice"]:
        raise BenchError(after["notice"])


def require_hold(status: Status) -> None:
    """Raises BenchError with the daemon's own sentence where the robot does not hold its pose."""
    if status["mode"] != "hold":
        raise BenchError(f"the robot no longer holds its pose: {reported_by(status)}")


def reported_by(status: Status) -> str:
    """Why a robot is in the mode that it is in."""
    if status["notice"]:
        return str(status["notice"])
    if status["mode"] == "idle":  # unasked it leaves a notice; and a flipper that falls then is a fault as well
        return "its torque was switched off"
    if status["fault"]:
        return str(status["fault"]["message"])
    return "it was told to stop" if status["mode"] == "stopping" else f"it is in {status['mode']}"


def walk(robot: BenchRobot, depth_m: float | None, strides: int) -> CompletedWalk:
    """From hold to hold, at a fixed depth, or at chosen ones for None. Raises BenchError where a fault ends it."""
    before = robot.call("status")
    robot.call("walk", strides=strides, **({} if depth_m is None else {"depth_m": depth_m}))
    wait_until(robot, lambda now: now["mode"] != "hold", ARMING_S, "beginning to walk")  # a request waits for its tick
    after = wait_until(robot, lambda now: now["mode"] not in ("walking", "stopping"), strides * STRIDE_S, "the walk")
    if after["mode"] != "hold" or after["notice"]:
        raise BenchError(f"the walk ended early: {reported_by(after)}")
    closed = fetch_strides(robot, before["strides_closed"])
    if (number := count_strides(closed)) < strides:
        raise BenchError(f"the walk ended early, after {number} of {counted(strides, 'stride')}: it was told to stop")
    return CompletedWalk(closed, before["now_s"], after["now_s"])


def count_strides(closed: Sequence[Mapping[str, Any]]) -> int:
    """Each by both flippers."""
    return len({stride["index"] for stride in closed})


def follow_walk(robot: BenchRobot, begin: Callable[[float], Evaluator[End]]) -> tuple[End | None, Status]:
    """Of a walk that was just ordered: how its judge ended it, None where it ended by itself; the last status.

    `begin` makes the judge when the walk has begun, by the robot's clock.
    """
    status = wait_until(robot, lambda now: now["mode"] != "hold", ARMING_S, "beginning to walk")
    evaluate = begin(status["now_s"])
    while status["mode"] == "walking":
        end = evaluate(status)
        if end is not None:
            robot.call("stop")
            return end, status
        robot.wait(POLL_S)
        status = robot.call("status")
    return None, status


def fetch_strides(robot: BenchRobot, number: int) -> list[dict[str, Any]]:
    """All that closed from `number` on. Raises BenchError where the daemon no longer keeps the first of them."""
    found: list[dict[str, Any]] = []
    while fetched := robot.call("strides", since=number + len(found)):
        if fetched[0]["number"] > number + len(found):
            raise BenchError("the walk had more strides than the daemon keeps: let the robot walk fewer at once")
        found += fetched
    return found


def rest(robot: BenchRobot) -> None:
    """Flippers out of the mud where they can be, then torque off. Raises BenchError where no answer comes.

    A robot that holds its pose is told to stop as well: a fault may have held it in the middle of a stroke.
    """
    if robot.call("status")["mode"] in ("hold", *UNDER_WAY):
        robot.call("stop")
        robot.wait(POLL_S)  # a request waits for its tick
        wait_until(robot, lambda status: status["mode"] not in UNDER_WAY, RAISING_S, "raising the flippers")
    disarm(robot)


def leave(robot: BenchRobot, operator: Operator, folder: Path) -> list[Path]:
    """Torque off, all logs in the folder, the connection closed; what fails of that is told. The folder's logs."""
    try:
        for step in (partial(_rest_reported, robot, operator), partial(robot.copy_logs, folder)):
            try:
                step()
            except (BenchError, CallRefusedError) as problem:
                operator.report(str(problem))
    finally:
        robot.close()
    return sorted(folder.glob("*.mcap"))


def _rest_reported(robot: BenchRobot, operator: Operator) -> None:
    """Why it does not obey was told to whoever called it last; here, what that means for the robot."""
    try:
        if robot.call("status")["mode"] == "walking":
            operator.report("the flippers are raised, then torque goes off")
        rest(robot)
    except RobotInUseError:
        operator.report("the robot is left as it is to whoever has taken it over")
    except DaemonLostError:
        operator.report(ALONE)
