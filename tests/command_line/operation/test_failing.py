"""`mudskipper fail` against a real daemon with a simulated robot."""

from __future__ import annotations

import json
import signal
from typing import Any

from command_line import exit_codes
from drivers.fault_injection.failures import Failures
from firmware_host.log_reading.log_reader import read_log
from tests.waiting import LONGEST_S


def test_a_failing_drive_is_shown_stops_the_robot_and_stands_in_the_log(bench: Any) -> None:
    listed = json.loads(bench.run("fail", "--list", "--json").stdout)
    table = [(row["component"], row["kind"], row["does"]) for row in listed["table"]]
    assert table == list(Failures(("left", "right")).table()) and listed["failing"] == []
    shown = bench.run("fail", "--list").stdout.splitlines()
    assert len([line for line in shown if line.startswith(("JOINT", "bus.NAME", "pose", "log", "loop", "clock"))]) == 14
    assert len(shown) < 20 and any(line.split()[:2] == ["JOINT.command", "off,"] for line in shown)
    assert "JOINT: left_sweep, left_adduction, right_sweep, right_adduction" in shown and "NAME: left, right" in shown
    bench.run("arm")
    done = bench.run("fail", "left_sweep", "off", "--for", "5")
    assert done.returncode == exit_codes.OK and "left_sweep  off" in done.stdout
    report = bench.wait_for(lambda report: report["mode"] == "fault")
    assert "left_sweep" in report["fault"]["message"]
    assert "failing on purpose: left_sweep off" in bench.run("status").stdout
    assert bench.run("fail", "all", "ok").stdout == "nothing fails on purpose\n"
    bench.wait_for(lambda report: report["failing"] == [] and report["drives"][0]["angle_age_s"] < 0.1)
    bench.daemon.send_signal(signal.SIGTERM)
    assert bench.daemon.wait(LONGEST_S) == 0
    (path,) = bench.logs.glob("**/*.mcap")
    texts = [event["text"] for event in read_log(path).events]
    (begin,) = [text for text in texts if text.startswith("failing on purpose")]
    assert begin.startswith("failing on purpose: left_sweep off for 5 s, asked by ")
    assert "end of failing on purpose: left_sweep off" in texts


def test_what_cannot_fail_is_refused_and_half_a_wish_is_misuse(bench: Any) -> None:
    refused = bench.run("fail", "left_sweep.command", "garbage")
    assert refused.returncode == exit_codes.REFUSED and "it can be off, slow, intermittent" in refused.stderr
    assert bench.run("fail", "left_sweep", "off", "--for", "61").returncode == exit_codes.REFUSED
    for odd in (
        ("left_sweep", "off", "--list"),
        *(("left_sweep", "off", "--for", text) for text in ("nan", "inf", "x")),
    ):
        assert bench.run("fail", *odd).returncode == exit_codes.USAGE, odd
    half = bench.run("fail", "left_sweep")
    assert half.returncode == exit_codes.USAGE and "--list" in half.stderr


def test_a_robot_that_may_not_fail_says_which_key_would_allow_it(bench: Any) -> None:
    text = bench.configuration.read_text(encoding="utf-8")
    bench.configuration.write_text(text.replace("allowed = true", "allowed = false"), encoding="utf-8")
    bench.daemon.send_signal(signal.SIGTERM)
    bench.daemon.wait(LONGEST_S)
    bench.daemon.stderr.close()
    bench.daemon = bench.start("firmware_host.daemon")
    bench.wait_until_ready()
    refused = bench.run("fail", "pose", "off")
    assert refused.returncode == exit_codes.REFUSED and "failures.allowed = true" in refused.stderr
    assert "nothing may fail on purpose" in bench.run("fail", "--list").stdout
