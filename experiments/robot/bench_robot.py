"""A robot as an experiment operates it: the daemon's calls, waiting, and the log of its motion.

The calls are those of the status socket. They reach the daemon of a robot, or the daemon's own loop in step with a
simulated robot; an experiment cannot distinguish the two. It sees nothing of the robot but answers and log.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

from experiments.reports.counted_nouns import counted
from experiments.robot.bench_errors import BenchError, DaemonLostError, EndedError, RobotInUseError
from experiments.study.prompt import Operator
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import Log
from operator_client.status_client import CallRefusedError

POLL_S = 0.05
# The longest that each may take, in s:
ARMING_S = 10.0
MOVING_S = 20.0
RAISING_S = 10.0
STRIDE_S = 60.0  # with pauses and recoveries
CLEARING_S = 1.5  # until a transient fault is over
MOST_CLEARS = 3  # requests to clear a fault that comes back
MOST_ARMING_REQUESTS = 3  # a transient fault may cancel one
CLEAR, LEAVE = "c", ""  # answers to a fault: Enter, pressed in haste, clears nothing
UNDER_WAY = ("walking", "stopping", "damping")
ENERGISED = ("arming", "hold", *UNDER_WAY)
ALONE = (
    "the robot does not answer: it stops by itself, and its torque goes off within seconds; check before you reach"
    " for it"
)


class BenchRobot(Protocol):
    @property
    def configuration(self) -> Configuration: ...

    def call(self, method: str, **params: Any) -> Any:
        """Return the daemon's answer. Raises CallRefusedError with its message, BenchError without an answer."""

    def wait(self, duration_s: float) -> None:
        """Let time pass with the robot attended: it stops by itself when this program dies."""

    def record(self, from_s: float, to_s: float) -> Log:
        """Return the log between two times by the robot's clock (`now_s` of its status). Raises BenchError."""

    def copy_logs(self, folder: Path) -> list[Path]:
        """Copy the logs of all motion to a folder. Raises BenchError."""

    def close(self) -> None:
        """Switch torque off and disconnect. Never raises."""


class CompletedWalk(NamedTuple):
    """A walk that ended with all its strides."""

    strides: list[dict[str, Any]]  # reports of the status socket, of both flippers
    from_s: float
    to_s: float


Status = dict[str, Any]
End = TypeVar("End")
Arrived = Callable[[Status], bool]
WalkMonitor = Callable[[Status], End | None]  # None while the walk continues, then how it ends


def wait_until(robot: BenchRobot, done: Callable[[Status], bool], longest_s: float, what: str) -> Status:
    """Return the first status that `done` accepts. Raises BenchError, which names `what` did not happen in time."""
    status: Status = robot.call("status")
    start_s = status["now_s"]
    while not done(status):
        if status["now_s"] - start_s > longest_s:
            raise BenchError(f"{what} did not happen within {longest_s:g} s: the robot is in {status['mode']}")
        robot.wait(POLL_S)
        status = robot.call("status")
    return status


def ask_to_clear_faults(robot: BenchRobot, operator: Operator) -> None:
    """Show the faults that keep the torque off, and clear them where the operator agrees.

    The operator must look at the robot first: the drive may be wet, or a finger be in the flipper. Without an operator
    at the terminal the faults stay. The automatic operator clears them, since its robot is simulated.

    Raises EndedError where the operator leaves a fault, BenchError where it comes back.
    """
    answers = {CLEAR: "clear it and go on", LEAVE: "stop here"}
    for _ in range(MOST_CLEARS):
        if not (faults := _describe_faults(_status_at_rest(robot))):
            return
        question = f"{faults}\nTorque stays off until this is cleared."
        if operator.ask(question, answers, lambda: robot.wait(POLL_S)) != CLEAR:
            raise EndedError("the fault remains; remove its cause, then 'mudskipper clear' and the same command again")
        robot.call("clear")
    if faults := _describe_faults(_status_at_rest(robot)):
        raise BenchError(f"the fault comes back: {faults}")


def _status_at_rest(robot: BenchRobot) -> Status:
    """Return the status once transient faults are over."""
    status: Status = robot.call("status")
    start_s = status["now_s"]
    while _describe_faults(status) and status["now_s"] - start_s < CLEARING_S:
        robot.wait(POLL_S)
        status = robot.call("status")
    return status


def _describe_faults(status: Status) -> str:
    """Describe the faults of a robot whose torque is off; empty where none keeps it off."""
    if status["mode"] not in ("idle", "fault"):
        return ""
    faults = _blocking(status)
    if status["mode"] == "fault" and not faults and status["fault"]:
        faults = [status["fault"]]
    lines = []
    for fault in faults:
        age_s = fault["age_s"]
        age = f"{age_s:.0f} s" if age_s < 100.0 else f"{age_s / 60.0:.0f} min"
        lines.append(f"  {fault['message']} (for {age})\n    -> {fault['what_to_do']}")
    if status["mode"] == "fault":
        return "\n".join(["The robot is in FAULT:", *(lines or [f"  {status['notice']}"])])
    return "\n".join(["A fault keeps the torque off:", *lines]) if lines else ""


def arm(robot: BenchRobot, operator: Operator | None = None) -> None:
    """Bring the robot to holding its pose. Raises BenchError with the reason. A fault needs the operator's consent."""
    status = robot.call("status")
    if status["mode"] in ("arming", *UNDER_WAY):
        status = wait_until(robot, lambda now: now["mode"] in ("hold", "idle", "fault"), ARMING_S, "coming to rest")
    if status["mode"] == "hold":
        return
    if operator is not None:
        ask_to_clear_faults(robot, operator)
    elif status["mode"] == "fault":
        raise BenchError(f"{_describe_faults(status)}\nremove its cause, then 'mudskipper clear'")
    try:
        _ask_for_torque(robot)
    except (BenchError, CallRefusedError) as problem:
        raise BenchError(_why_not_armed(robot, str(problem))) from problem


def _ask_for_torque(robot: BenchRobot) -> None:
    """Request torque, again where a transient fault cancelled the request, such as a flipper that sinks.

    Raises BenchError, CallRefusedError.
    """
    for _ in range(MOST_ARMING_REQUESTS):
        wait_until(robot, lambda now: now["mode"] == "idle" and not _blocking(now), ARMING_S, "being ready to arm")
        robot.call("arm")
        robot.wait(POLL_S)  # longer than a tick: an idle robot then has lost the request
        status = wait_until(robot, lambda now: now["mode"] != "arming", ARMING_S, "arming")
        if status["mode"] != "idle" or not _blocking(status):
            break
    if status["mode"] != "hold":
        raise BenchError(mode_reason(status))


def _blocking(status: Status) -> list[dict[str, Any]]:
    """Return the faults that keep the torque off."""
    return [fault for fault in status["faults"] if fault["blocks_arming"]]


def _why_not_armed(robot: BenchRobot, problem: str) -> str:
    blocking = _blocking(robot.call("status"))
    faults = [f"{fault['message'].rstrip('.')} ({fault['what_to_do']})" for fault in blocking]
    return f"the robot is not armed: {'; '.join(faults) or problem}. See 'mudskipper check'"


def disarm(robot: BenchRobot) -> None:
    robot.call("disarm")
    wait_until(robot, lambda now: now["mode"] not in ENERGISED, ARMING_S, "switching torque off")


def move(
    robot: BenchRobot, angles_rad: Mapping[str, float], arrived: Arrived = lambda now: False, **speed: float
) -> None:
    """Move joints of a robot that holds its pose, until they are there or a status has `arrived`. Raises BenchError."""
    require_hold(robot.call("status"))
    robot.call("move", **{f"{joint}_rad": angle_rad for joint, angle_rad in angles_rad.items()}, **speed)
    after = wait_until(robot, lambda now: not now["moving"] or arrived(now), MOVING_S, "moving the joints")
    require_hold(after)
    if after["notice"]:
        raise BenchError(after["notice"])


def require_hold(status: Status) -> None:
    """Raises BenchError with the daemon's own message where the robot does not hold its pose."""
    if status["mode"] != "hold":
        raise BenchError(f"the robot no longer holds its pose: {mode_reason(status)}")


def mode_reason(status: Status) -> str:
    """Return why a robot is in its mode."""
    if status["notice"]:
        return str(status["notice"])
    if status["mode"] == "idle":  # a fault would leave a notice
        return "its torque was switched off"
    if status["fault"]:
        return str(status["fault"]["message"])
    return "it was stopped" if status["mode"] == "stopping" else f"it is in {status['mode']}"


def walk(robot: BenchRobot, depth_m: float | None, strides: int) -> CompletedWalk:
    """Walk from hold to hold, at a fixed depth, or at chosen ones for None. Raises BenchError where a fault ends it."""
    before = robot.call("status")
    robot.call("walk", strides=strides, **({} if depth_m is None else {"depth_m": depth_m}))
    wait_until(robot, lambda now: now["mode"] != "hold", ARMING_S, "beginning to walk")  # a request waits for its tick
    after = wait_until(robot, lambda now: now["mode"] not in ("walking", "stopping"), strides * STRIDE_S, "the walk")
    if after["mode"] != "hold" or after["notice"]:
        raise BenchError(f"the walk ended early: {mode_reason(after)}")
    closed = fetch_strides(robot, before["strides_closed"])
    if (number := count_strides(closed)) < strides:
        raise BenchError(f"the walk ended early, after {number} of {counted(strides, 'stride')}: it was stopped")
    return CompletedWalk(closed, before["now_s"], after["now_s"])


def count_strides(closed: Sequence[Mapping[str, Any]]) -> int:
    """Count strides of both flippers once."""
    return len({stride["index"] for stride in closed})


def follow_walk(robot: BenchRobot, make_monitor: Callable[[float], WalkMonitor[End]]) -> tuple[End | None, Status]:
    """Follow a walk that was just ordered; return how its monitor ended it, or None, and the last status.

    `make_monitor` takes the time at which the walk begins, by the robot's clock.
    """
    status = wait_until(robot, lambda now: now["mode"] != "hold", ARMING_S, "beginning to walk")
    monitor = make_monitor(status["now_s"])
    while status["mode"] == "walking":
        end = monitor(status)
        if end is not None:
            robot.call("stop")
            return end, status
        robot.wait(POLL_S)
        status = robot.call("status")
    return None, status


def fetch_strides(robot: BenchRobot, number: int) -> list[dict[str, Any]]:
    """Return all strides from a number on. Raises BenchError where the daemon discarded the first of them."""
    found: list[dict[str, Any]] = []
    while fetched := robot.call("strides", since=number + len(found)):
        if fetched[0]["number"] > number + len(found):
            raise BenchError("the walk had more strides than the daemon stores: use fewer strides")
        found += fetched
    return found


def rest(robot: BenchRobot) -> None:
    """Raise the flippers out of the mud if possible, then switch torque off. Raises BenchError without an answer.

    A robot that holds its pose is stopped as well: a fault may have held it in the middle of a stroke.
    """
    if robot.call("status")["mode"] in ("hold", *UNDER_WAY):
        robot.call("stop")
        robot.wait(POLL_S)  # a request waits for its tick
        wait_until(robot, lambda status: status["mode"] not in UNDER_WAY, RAISING_S, "raising the flippers")
    disarm(robot)


def leave(robot: BenchRobot, operator: Operator, folder: Path) -> list[Path]:
    """Switch torque off, copy all logs and disconnect; report what fails. Return the folder's logs."""
    try:
        for step in (partial(_report_rest, robot, operator), partial(robot.copy_logs, folder)):
            try:
                step()
            except (BenchError, CallRefusedError) as problem:
                operator.report(str(problem))
    finally:
        robot.close()
    return sorted(folder.glob("*.mcap"))


def _report_rest(robot: BenchRobot, operator: Operator) -> None:
    """Report what a lost connection means for the robot."""
    try:
        if robot.call("status")["mode"] == "walking":
            operator.report("the flippers are raised, then torque goes off")
        rest(robot)
    except RobotInUseError:
        operator.report("another program operates the robot now: it is left as it is")
    except DaemonLostError:
        operator.report(ALONE)
