"""The weighing of a real robot has a daemon of its own, in real time."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.calibration.robots import running_daemon
from firmware_host.configuration.loading import parse_configuration
from operator_client.status_client import StatusClient
from simulation.harness.local_setup import write_local_setup
from tests.waiting import wait_until


def test_the_daemon_of_the_weights_ends_where_the_program_is_killed(short_folder: Path, tmp_path: Path) -> None:
    path = write_local_setup(short_folder, tmp_path)
    program = f"""
from pathlib import Path
from signal import pause
from experiments.calibration.robots import running_daemon
from firmware_host.configuration.loading import load_configuration
with running_daemon(load_configuration(Path({str(path)!r})), Path({str(short_folder)!r})) as socket:
    print(socket, flush=True)
    pause()
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as killed:
        assert killed.stdout
        socket = Path(killed.stdout.readline().strip())
        assert socket.exists()
        killed.kill()
    wait_until(lambda: not socket.exists())


def test_two_robots_of_one_user_have_a_daemon_each_which_ends_with_its_weights_and_each_continues(
    short_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The readings of a joint belong to the configuration of its daemon, with all paths."""
    robots = []
    for name in ("first", "second"):
        (short_folder / name).mkdir()
        text = write_local_setup(short_folder / name, tmp_path).read_text(encoding="utf-8")
        robots.append(parse_configuration(text.replace('name = "simulated"', f'name = "{name}"')))
    with running_daemon(robots[0], short_folder / "first") as first:
        monkeypatch.setattr(os, "getpid", lambda: 0)  # as of another program
        with running_daemon(robots[1], short_folder / "second") as socket, StatusClient(socket) as client:
            assert client.call("status")["robot"] == "second"
        assert first.exists() and not socket.exists()
    with running_daemon(robots[0], short_folder / "first") as again:
        assert again == first
