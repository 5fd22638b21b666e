"""The daemon ends on request or because of a bug; the drives are idle in both cases."""

import signal
import subprocess
import sys
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from drivers.can.frames import Frame
from drivers.pose.pose_port import NoPose
from firmware_host.computer.sd_notify import SystemdNotifier
from firmware_host.daemon import (
    EXIT_FAILED,
    NOTIFY_TICKS,
    Shutdown,
    WatchdogFeed,
    end_safely,
    reopen_buses,
    reopen_pose,
    serve,
)
from firmware_host.log.log_folder import DONE
from firmware_host.sockets.status_socket import MOST_OPERATORS
from firmware_host.ticker import Tick
from logs.files.log_reader import read_log
from operator_client.status_client import StatusClient
from simulation.harness.local_setup import write_local_setup
from tests.firmware_host.recorded_robot import RecordedRobot
from tests.firmware_host.sockets.served_socket import Served
from tests.waiting import LONGEST_S, wait_until


def run_shutdown(robot: RecordedRobot, shutdown: Shutdown, longest_s: float = 8.0) -> bool:
    return robot.run_until(lambda: shutdown.step(robot.loop, robot.now_s), longest_s)


@pytest.mark.parametrize("walked_s", [0.01, 1.7, 2.5])
def test_a_signal_in_a_walk_raises_the_flippers_from_the_second_tick_on_and_idles_the_drives(
    robot: RecordedRobot, walked_s: float
) -> None:
    robot.walk(WalkOrder(0.03))
    robot.run_for(walked_s)
    shutdown = Shutdown()
    shutdown.request(signal.SIGTERM, None)
    for _ in range(2):
        assert not shutdown.step(robot.loop, robot.now_s)
        robot.step()
    assert robot.loop.mode is Mode.STOPPING
    assert run_shutdown(robot, shutdown)
    assert robot.energised == [False] * 4
    assert robot.loop.events.notice == ""  # a notice would report flippers in the mud


def test_a_shutdown_waits_for_the_last_drive_to_be_idle(robot: RecordedRobot) -> None:
    robot.fail("left_sweep.command", "off", 0.05)
    shutdown = Shutdown()
    shutdown.request(15, None)
    assert not run_shutdown(robot, shutdown, 0.05) and robot.energised == [True, False, False, False]
    assert run_shutdown(robot, shutdown)
    assert robot.energised == [False] * 4


def test_nothing_is_armed_while_the_daemon_ends(robot: RecordedRobot) -> None:
    shutdown = Shutdown()
    shutdown.request(15, None)
    shutdown.step(robot.loop, robot.now_s)
    robot.step()
    assert robot.loop.request(Request.ARM, robot.now_s) == "the daemon is ending"


def a_bug() -> Exception:
    """Return an exception with a traceback."""
    try:
        raise ZeroDivisionError("somewhere in a tick")
    except ZeroDivisionError as problem:
        return problem


def test_a_bug_idles_all_drives_that_can_be_reached(robot: RecordedRobot, capsys: pytest.CaptureFixture[str]) -> None:
    def broken(frame: Frame) -> None:
        raise OSError("the adapter was unplugged")

    robot.loop.drives.ports["left"].send = broken  # type: ignore[method-assign]
    assert end_safely(robot.loop, a_bug()) == EXIT_FAILED
    robot.robot.advance(robot.now_s + 0.01)
    assert robot.energised[2:] == [False] * 2
    said = capsys.readouterr().err
    assert "ZeroDivisionError: somewhere in a tick (test_daemon.py, line" in said
    assert "Traceback" not in said


def test_a_bug_in_the_log_does_not_prevent_idling_the_drives(robot: RecordedRobot) -> None:
    def broken(number: int, row: bytes) -> bool:
        raise ZeroDivisionError

    robot.loop.recorder.put = broken  # type: ignore[method-assign]
    assert end_safely(robot.loop, a_bug()) == EXIT_FAILED
    robot.robot.advance(robot.now_s + 0.01)
    assert robot.energised == [False] * 4


@pytest.mark.parametrize("mode", Mode)
def test_buses_and_the_pose_source_are_opened_again_only_while_the_torque_is_off(
    robot: RecordedRobot, mode: Mode
) -> None:
    tried: list[float] = []

    class Lost(NoPose):
        def reopen(self, now_s: float) -> bool:
            tried.append(now_s)
            return True

    robot.loop.mode = mode
    reopen_buses(robot.loop, {"left": Lost()}, 1.0)  # type: ignore[dict-item]
    reopen_pose(robot.loop, Lost(), 2.0)
    assert tried == ([] if mode in ENERGISED else [1.0, 2.0])
    assert len(robot.recorder.about("opened again")) == len(tried)


class Notices(SystemdNotifier):
    def __init__(self) -> None:
        super().__init__("")
        self.sent: list[str] = []

    def send(self, *lines: str) -> None:
        self.sent.append(lines[0])


@pytest.mark.parametrize(("missed", "fed"), [(0, True), (1, True), (2, False)])
def test_a_loop_that_misses_most_ticks_does_not_feed_the_watchdog(missed: int, fed: bool) -> None:
    notices = Notices()
    feed = WatchdogFeed(notices)
    for number in range(NOTIFY_TICKS):
        feed.update(Tick(0.0, 0.0, number, missed), Mode.IDLE)
    assert (notices.sent == ["WATCHDOG=1"]) is fed


def test_the_time_in_which_clients_are_served_counts_as_a_part_of_the_tick(
    robot: RecordedRobot, served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firmware_host.daemon.time.monotonic", iter((1.0, 1.002)).__next__)
    serve(robot.loop, served, robot.now_s)
    monkeypatch.undo()
    robot.step()
    assert robot.loop.timing.tick.max_us == pytest.approx(2000.0, abs=1.0)


def test_a_daemon_prints_where_it_is_operated_and_protects_a_lease_until_its_holder_leaves(short_folder: Path) -> None:
    """It does so even if no drive sends anything."""
    setup = write_local_setup(short_folder, short_folder / "logs")
    command = [sys.executable, "-m", "firmware_host.daemon", "--config", str(setup)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as daemon:
        assert daemon.stdout is not None
        line = daemon.stdout.readline()
        try:
            with ExitStack() as others, closing(StatusClient(short_folder / "mudskipper.sock")) as client:
                client.call("lease", for_s=10.0)
                for _ in range(MOST_OPERATORS):  # one of these makes room
                    others.enter_context(StatusClient(short_folder / "mudskipper.sock")).call("hello")
                warnings = client.call("status")["warnings"]
            with closing(StatusClient(short_folder / "mudskipper.sock")) as client:
                wait_until(lambda: client.call("status")["lease"] is None)
        finally:
            daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(LONGEST_S) == 0
    assert warnings[0].startswith("protection is weakened (")
    (log,) = (short_folder / "logs" / DONE).glob("*.mcap")
    stamp_of = {event["text"].partition(" uid")[0]: event["stamp_s"] for event in read_log(log).events}
    assert f"warning: {warnings[0]}" in stamp_of
    assert stamp_of["lease of"] - stamp_of["lease taken by"] < 9.0
    assert "ready" in line and str(short_folder / "mudskipper.sock") in line
