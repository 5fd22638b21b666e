"""An attended walk ends when the command that attends it ends."""

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from command_line import exit_codes
from command_line.operation import attended_walk
from tests.command_line.command_lines import start_process
from tests.command_line.fake_client import FakeClient, next_of
from tests.running_bench import Bench
from tests.waiting import LONGEST_S


@contextmanager
def attended(bench: Bench) -> Iterator[subprocess.Popen[str]]:
    with start_process("walk", "--attended", MUDSKIPPER_SOCKET=str(bench.socket)) as walk:
        try:
            bench.wait_for(lambda report: report["mode"] == "walking")
            yield walk
        finally:
            walk.kill()


def report(mode: str, message: str = "", notice: str = "", reaction: str = "hold") -> dict[str, Any]:
    fault = {"message": message, "reaction": reaction} if message else None
    state = {"mode": mode, "power_cut": None, "fault": fault, "notice": notice}
    return state | {"stride": 0, "phase": "swing", "depth_m": 0, "body_x_m": 0}


@pytest.fixture(autouse=True)
def no_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no time pass between two looks at a fake client."""
    monkeypatch.setattr(attended_walk, "RENEWAL_S", 0.0)


STOPPED = "stopped by drive_silent: The left_sweep drive is silent. Check it."


@pytest.mark.parametrize(
    ("reports", "status", "complaint"),
    [
        ([report("walking"), report("hold")], exit_codes.OK, ""),
        ([report("hold", "No current.", STOPPED)], exit_codes.REFUSED, STOPPED),
        ([report("walking"), report("damping", "It is silent."), report("fault", "It is silent.", STOPPED)],
         exit_codes.REFUSED, STOPPED),
        ([report("stopping"), report("idle", notice=STOPPED)], exit_codes.REFUSED, STOPPED),
        ([report("fault", "It is silent.")], exit_codes.REFUSED, "It is silent."),
        ([report("idle", "It moves.", reaction="none")], exit_codes.REFUSED, "the torque was switched off"),
        ([report("hold", "No current.")], exit_codes.REFUSED, "No current."),
        ([report("walking"), report("hold", "The disk is full.", reaction="warn")], exit_codes.OK, ""),
    ],
    ids=["done", "held by a fault", "damped, then a fault", "a fault that is over", "fault without notice", "disarmed",
         "a fault in the tick of the order", "done, with a warning"],
)  # fmt: skip
def test_a_walk_that_a_fault_ended_is_refused_with_its_cause(
    reports: list[dict[str, Any]], status: int, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert attended_walk.attend(FakeClient(next_of(*reports)), False, {}).print(as_json=False) == status
    printed = capsys.readouterr()
    assert printed.out.splitlines()[-1] == reports[-1]["mode"]
    assert printed.err == (f"mudskipper: {complaint}\n" if complaint else "")


def test_programs_read_one_object_at_the_end_of_an_attended_walk(capsys: pytest.CaptureFixture[str]) -> None:
    done = '{"schema": "operation/1", "command": "walk", "mode": "hold", "notice": ""}\n'
    for mode, printed in (("hold", done), ("fault", "")):
        client = FakeClient(next_of(report("walking"), report(mode)))
        attended_walk.attend(client, True, {}).print(as_json=True)
        assert capsys.readouterr().out == printed


def test_the_command_ends_when_its_walk_ends(bench: Bench) -> None:
    bench.run("arm")
    ended = bench.run("walk", "--attended", "--strides", "2")
    assert (ended.returncode, ended.stderr) == (exit_codes.OK, "")
    lines = ended.stdout.splitlines()
    assert lines[0].startswith("walking") and lines[-1] == "hold"
    assert bench.run("walk", "--strides", "1").returncode == exit_codes.OK  # no fault remains


def test_ctrl_c_stops_the_robot_and_waits_for_it(bench: Bench) -> None:
    bench.run("arm")
    with attended(bench) as walk:
        bench.wait_for(lambda report: report["phase"] == "stance")
        walk.send_signal(signal.SIGINT)
        printed, complaints = walk.communicate(timeout=LONGEST_S)
    assert walk.returncode == exit_codes.INTERRUPTED
    assert printed.splitlines()[-1] == "hold" and "Traceback" not in complaints
    assert bench.wait_for(lambda report: True)["mode"] == "hold"


def test_a_second_ctrl_c_does_not_wait_and_says_what_becomes_of_the_robot(capsys: pytest.CaptureFixture[str]) -> None:
    client = FakeClient(next_of(report("walking"), KeyboardInterrupt(), report("stopping"), KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        attended_walk.attend(client, True, {})
    assert client.calls.count("stop") == 1 and "torque goes off" in capsys.readouterr().err


def test_a_reader_that_closes_the_output_stops_the_robot(bench: Bench) -> None:
    bench.run("arm")
    with attended(bench) as walk:
        assert walk.stdout and walk.stderr
        walk.stdout.close()
        assert walk.wait(LONGEST_S) == exit_codes.INTERRUPTED
        assert "closed it" in walk.stderr.read()
    report = bench.wait_for(lambda report: True)
    assert (report["mode"], report["fault"], report["lease"]) == ("hold", None, None)


def test_another_terminal_gets_no_second_attended_walk_and_ends_the_first_by_a_stop(bench: Bench) -> None:
    bench.run("arm")
    with attended(bench) as walk:
        second = bench.run("walk", "--attended")
        assert second.returncode == exit_codes.REFUSED
        assert f"(process {walk.pid}) operates the robot" in second.stderr
        assert bench.wait_for(lambda report: True)["mode"] == "walking"
        assert bench.run("stop").stdout == "hold\n"
        printed, _ = walk.communicate(timeout=LONGEST_S)
    assert walk.returncode == exit_codes.OK and printed.splitlines()[-1] == "hold"


def test_the_robot_stops_when_the_command_hangs(bench: Bench) -> None:
    bench.run("arm")
    with attended(bench) as walk:
        walk.send_signal(signal.SIGSTOP)
        bench.wait_for(lambda report: report["mode"] not in ("walking", "stopping"))
