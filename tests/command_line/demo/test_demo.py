"""The demo walks over a short world to its end, and every signal shuts it down cleanly."""

import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from command_line import exit_codes
from logs.files.log_reader import read_log
from tests.command_line.command_lines import start_process
from tests.waiting import LONGEST_S

WORLD = """\
[[segment]]
start_m = 0.0
end_m = 0.1
water_percent = 48.5
[[segment]]
start_m = 0.1
end_m = 0.2
strength_pa = 1500
[[segment]]
start_m = 0.2
end_m = 0.3
water_percent = 48.5
"""


def interrupt(demo: subprocess.Popen[str], number: signal.Signals, line: str) -> tuple[str, str]:
    """Send the signal after a line that begins with `line`; returns standard output and standard error."""
    assert demo.stdout is not None
    shown = ""
    for text in demo.stdout:
        shown += text
        if text.startswith(line):
            break
    demo.send_signal(number)
    printed, complaints = demo.communicate(timeout=LONGEST_S)
    assert demo.returncode == exit_codes.INTERRUPTED and "Traceback" not in complaints
    return shown + printed, complaints


def children_of(out: Path) -> list[str]:
    """Return the command lines of processes that still use the demo's files."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                line = (entry / "cmdline").read_bytes().decode(errors="replace")
            except OSError:
                continue
            if str(out) in line and "pytest" not in line:
                found.append(line)
    return found


def test_the_demo_walks_a_described_ground_and_summarises_it(tmp_path: Path) -> None:
    """The first mud appears twice; the summary distinguishes the two segments by position."""
    world = tmp_path / "world.toml"
    world.write_text(WORLD, encoding="utf-8")
    with start_process("demo", "--out", str(tmp_path / "out"), "--world", str(world), "--json") as demo:
        answer, printed = demo.communicate(timeout=LONGEST_S)
    assert demo.returncode == exit_codes.OK
    assert "Walking 0.30 m over mud with 48.5 %, 1500 Pa, 48.5 % water." in printed
    summary = json.loads(answer)
    assert summary["schema"] == "demo/1"
    assert set(summary) >= {
        "ticks", "rate_hz", "missed_ticks", "wake_late_us", "tick_us", "strides", "speed_cm_s", "log", "plot"
    }  # fmt: skip
    assert set(summary["wake_late_us"]) == set(summary["tick_us"]) == {"p50", "p99", "max"}
    assert {stride["flipper"] for stride in summary["strides"]} == {"left", "right"}
    assert set(summary["speed_cm_s"]) == {"48.5", "1500 Pa", "48.5 at 0.20 m"}
    assert summary["log"] in printed and summary["plot"] in printed
    assert Path(summary["plot"]).read_bytes().startswith(b"\x89PNG")
    log = read_log(Path(summary["log"]))
    assert log.complete and len(log.strides) == len(summary["strides"])


def test_ctrl_c_in_a_walk_over_the_three_muds_stops_the_robot_and_closes_the_log(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with start_process("demo", "--out", str(out)) as demo:
        printed, complaints = interrupt(demo, signal.SIGINT, "left ")
    assert "torque is off" in complaints
    (path,) = (out / "done").glob("*.mcap")
    assert str(path) in printed
    log = read_log(path)
    modes = [event["text"] for event in log.events if event["text"].startswith("mode ")]
    assert log.complete and modes[-1] == "mode hold to idle"
    assert children_of(out) == []


def test_a_daemon_that_stood_still_ends_the_demo_with_the_missed_ticks_and_the_log(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with start_process("demo", "--out", str(out)) as demo:
        assert demo.stdout is not None
        shown = next(line for line in demo.stdout if line.startswith("left "))
        children = Path(f"/proc/{demo.pid}/task/{demo.pid}/children").read_text(encoding="ascii").split()
        lines = {int(pid): Path(f"/proc/{pid}/cmdline").read_bytes() for pid in children}
        (daemon,) = (pid for pid, line in lines.items() if b"firmware_host.daemon" in line)
        os.kill(daemon, signal.SIGSTOP)
        time.sleep(1.0)  # the watchdogs of the drives expire
        os.kill(daemon, signal.SIGCONT)
        printed, complaints = demo.communicate(timeout=LONGEST_S)
    assert demo.returncode == exit_codes.UNHEALTHY
    (path,) = (out / "done").glob("*.mcap")
    assert str(path) in shown + printed
    missed = re.search(r"missed (\d+) ticks", complaints)
    assert missed and int(missed[1]) >= 300


@pytest.mark.parametrize(("number", "line"), [(signal.SIGINT, ""), (signal.SIGTERM, "Arming")])
def test_a_signal_before_the_walk_leaves_no_process(tmp_path: Path, number: signal.Signals, line: str) -> None:
    with start_process("demo", "--out", str(tmp_path / "out")) as demo:
        _, complaints = interrupt(demo, number, line)
    assert "stopped" in complaints
    assert children_of(tmp_path / "out") == []
