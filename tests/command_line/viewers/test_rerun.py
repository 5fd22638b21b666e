"""Rerun, where it is installed, shows the joints of an export by their names."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from command_line.viewers.rerun_blueprint import write_recording
from control.records import JOINTS
from tests.command_line.command_lines import run
from tests.folders import ROOT
from tests.waiting import LONGEST_S

pytest.importorskip("rerun", reason="rerun-sdk, a viewer of 100 MB, is not installed: pip install rerun-sdk")


def test_rerun_names_the_joints_of_an_export(tmp_path: Path) -> None:
    export, recording = tmp_path / "walk-ros.mcap", tmp_path / "walk.rrd"
    assert run("log", "export", "--ros", str(ROOT / "tests/fixtures/walk_0_1.mcap"), "--out", str(export)).stdout == ""
    write_recording(export, recording)
    command = [sys.executable, "-m", "rerun", "rrd", "print", "-vvv", str(recording)]
    printed = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=True).stdout
    for field in ("position", "velocity", "effort"):
        assert f"entity_path: /joint_states/{field}" in printed
    rows = re.findall(r"\[[-0-9., e]+\]\s+┆ \[(left_sweep, .*)\]?", printed)  # four numbers next to their names
    assert rows and all(JOINTS[1] in row for row in rows)
