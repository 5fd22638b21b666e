"""The loop gets the permitted real-time settings of the operating system, and a sentence for each refused one.

These settings change a process permanently, so every test uses a child process.
"""

import json
import os
import subprocess
import sys
from typing import Any

import pytest

from tests.folders import ROOT
from tests.waiting import LONGEST_S

IMPORTS = (
    "import ctypes, gc, json, os, resource, subprocess, sys; from firmware_host.computer.realtime import prepare_loop\n"
)
# The child may neither raise its priority nor lock memory, even if root runs the tests.
DROP_RIGHTS = """
for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_MEMLOCK):
    resource.setrlimit(limit, (0, 0))
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
"""


def in_child(code: str) -> Any:
    """Run `code` in a child process and return the variable `answer`."""
    program = f"{IMPORTS}{code}\nprint(json.dumps(answer))"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=LONGEST_S)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def needs(permitted: str, warnings: list[str]) -> None:
    refused = [warning for warning in warnings if permitted in warning]
    if refused:
        pytest.skip(f"not permitted here: {refused[0]}")


def test_what_is_not_permitted_becomes_one_sentence_each_and_never_an_exception() -> None:
    memory, priority = in_child(f"{DROP_RIGHTS}\nanswer = prepare_loop(45, -1, True)")
    assert memory.startswith("memory not locked: ")
    assert memory.endswith("; raise the memlock limit")
    assert priority.startswith("no real-time priority 45: ")
    assert priority.endswith("; raise the rtprio limit")


def test_settings_that_cannot_be_applied_are_warnings() -> None:
    processor, priority = in_child("answer = prepare_loop(0, 1023, False)")
    assert "processor 1023" in processor and "loop.priority is 0" in priority


def test_garbage_is_frozen_and_no_longer_collected() -> None:
    heap = "heap = [[number] for number in range(200_000)]"
    enabled, left = in_child(f"{heap}; prepare_loop(0, -1, False); answer = [gc.isenabled(), len(gc.get_objects())]")
    assert not enabled and left < 1000  # a full collection would examine the objects that are left


def test_the_loop_runs_on_its_processor_alone() -> None:
    cpu = max(os.sched_getaffinity(0))
    assert in_child(f"prepare_loop(0, {cpu}, False); answer = sorted(os.sched_getaffinity(0))") == [cpu]


def test_memory_is_locked_where_that_is_permitted() -> None:
    code = "answer = [prepare_loop(0, -1, True), open('/proc/self/status').read()]"
    warnings, status = in_child(code)
    needs("memory not locked", warnings)
    locked_kb = int(status.split("VmLck:")[1].split()[0])
    assert locked_kb > 1000


def test_children_of_the_loop_are_ordinary_processes() -> None:
    code = """
warnings = prepare_loop(1, -1, False)
ask = [sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"]
child = subprocess.run(ask, capture_output=True, text=True, check=True)
answer = [warnings, os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, int(child.stdout)]
"""
    warnings, loop, priority, child = in_child(code)
    needs("no real-time priority", warnings)
    assert loop == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    assert priority == 1
    assert child == os.SCHED_OTHER
