"""A walk that somebody stays with ends with them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from command_line import exit_codes
from command_line.operation import attended_walk
from firmware_host.operator.status_client import StatusClient
from tests.waiting import LONGEST_S


@contextmanager
def attended(bench: Any, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "command_line.main", "walk", "--attended", *arguments]
    environment = os.environ | {"MUDSKIPPER_SOCKET": str(bench.socket)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as attendant:
        try:
            bench.wait_for(lambda report: report["mode"] == "walking")
            yield attendant
        finally:
            attendant.kill()


class EndingWalk(StatusClient):
    """To a robot whose walk ends as `reports` tell, one look after the other."""

    def __init__(self, *reports: dict[str, Any]) -> None:
        self.reports = list(reports)

    def call(self, method: str, **params: Any) -> Any:
        return self.reports.pop(0) if method == "status" else "accepted"


def report(mode: str, message: str = "", notice: str = "", reaction: str = "hold") -> dict[str, Any]:
    fault = {"message": message, "reaction": reaction} if message else None
    return {"mode": mode, "fault": fault, "notice": notice, "stride": 0, "phase": "swing", "depth_m": 0, "body_x_m": 0}


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
        ([report("idle")], exit_codes.REFUSED, "the torque was switched off"),
        ([report("hold", "No current.")], exit_codes.REFUSED, "No current."),
        ([report("walking"), report("hold", "The disk is full.", reaction="warn")], exit_codes.OK, ""),
    ],
    ids=["done", "held by a fault", "damped, then a fault", "a fault that is over", "fault without notice", "disarmed",
         "a fault in the tick of the order", "done, with a warning"],
)  # fmt: skip
def test_a_walk_that_a_fault_has_ended_is_no_success_and_its_cause_is_told(
    reports: list[dict[str, Any]], status: int, complaint: str, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(attended_walk, "RENEWAL_S", 0.0)
    assert attended_walk.attend(EndingWalk(*reports), {}) == status
    said = capsys.readouterr()
    assert said.out.splitlines()[-1] == reports[-1]["mode"]
    assert said.err == (f"mudskipper: {complaint}\n" if complaint else "")


def test_it_arms_nothing(bench: Any) -> None:
    ended = bench.run("walk", "--attended")
    assert ended.returncode == exit_codes.REFUSED and "'mudskipper arm' first" in ended.stderr


def test_a_walk_that_is_refused_leaves_no_lease_behind(bench: Any) -> None:
    bench.run("arm")
    refused = bench.run("walk", "--attended", "--depth", "6")
    assert refused.returncode == exit_codes.REFUSED and "depth_m = 0.06" in refused.stderr
    client = StatusClient(bench.socket)
    assert client.call("lease", for_s=1.0) == client.call("release") == "accepted"
    client.close()


def test_it_ends_with_its_walk_and_says_so(bench: Any) -> None:
    bench.run("arm")
    ended = bench.run("walk", "--attended", "--strides", "2")
    assert (ended.returncode, ended.stderr) == (exit_codes.OK, "")
    lines = ended.stdout.splitlines()
    assert lines[0].startswith("walking, stride") and lines[-1] == "hold"
    assert bench.run("walk", "--strides", "1").returncode == exit_codes.OK  # nothing was lost


def test_ctrl_c_stops_the_robot_and_waits_for_it(bench: Any) -> None:
    bench.run("arm")
    with attended(bench) as attendant:
        bench.wait_for(lambda report: report["phase"] == "stance")
        attendant.send_signal(signal.SIGINT)
        said, complained = attendant.communicate(timeout=LONGEST_S)
    assert attendant.returncode == exit_codes.INTERRUPTED
    assert said.splitlines()[-1] == "hold" and "Traceback" not in complained
    assert bench.wait_for(lambda report: True)["mode"] == "hold"


def test_a_stop_from_elsewhere_ends_it(bench: Any) -> None:
    bench.run("arm")
    with attended(bench) as attendant:
        assert bench.run("stop").stdout == "hold\n"
        said, _ = attendant.communicate(timeout=LONGEST_S)
    assert attendant.returncode == exit_codes.OK and said.splitlines()[-1] == "hold"


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_robot_whose_attendant_dies_or_hangs_stops(bench: Any, number: signal.Signals) -> None:
    bench.run("arm")
    with attended(bench) as attendant:
        attendant.send_signal(number)
        bench.wait_for(lambda report: report["mode"] not in ("walking", "stopping"))


def test_a_second_attendant_is_told_of_the_first(bench: Any) -> None:
    bench.run("arm")
    with attended(bench) as first:
        second = bench.run("walk", "--attended")
        assert second.returncode == exit_codes.REFUSED
        assert f"(process {first.pid}) operates the robot" in second.stderr
        assert bench.wait_for(lambda report: True)["mode"] == "walking"


def test_an_attended_walk_that_is_refused_ousts_nobody(bench: Any) -> None:
    holder = StatusClient(bench.socket)
    holder.call("lease", for_s=10.0)
    for arguments, why in (((), "'mudskipper arm' first"), (("--depth", "6"), "depth_m = 0.06")):
        refused = bench.run("walk", "--attended", "--take-over", *arguments)
        assert refused.returncode == exit_codes.REFUSED and why in refused.stderr
    assert holder.call("lease", for_s=10.0) == "accepted"
    holder.close()
