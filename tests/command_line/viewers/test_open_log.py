"""`log open` starts an installed viewer with the layout, or names what is missing."""

import subprocess
from fcntl import LOCK_EX, flock
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.viewers import open_log
from tests.command_line.command_lines import failure, output, run
from tests.folders import ROOT

LOG = str(ROOT / "tests/fixtures/walk_0_1.mcap")


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Return the list of commands that would start viewers; none of them runs."""
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: commands.append(command))
    return commands


def install(monkeypatch: pytest.MonkeyPatch, *programs: str) -> None:
    monkeypatch.setattr(open_log, "which", lambda name: f"/opt/{name}" if name in programs else None)


def test_an_installed_viewer_gets_log_and_layout(monkeypatch: pytest.MonkeyPatch, started: list[list[str]]) -> None:
    install(monkeypatch, "plotjuggler", "lichtblick", "rerun")
    for viewer in ("foxglove", "plotjuggler", "rerun"):
        output("log", "open", LOG, "--with", viewer)
    lichtblick, juggler, rerun = started
    assert juggler[0] == "/opt/plotjuggler" and LOG in juggler and Path(juggler[-1]).is_file()
    assert (lichtblick, rerun) == (["/opt/lichtblick", LOG], ["/opt/rerun", LOG])


@pytest.mark.parametrize("viewer", ("foxglove", "plotjuggler", "rerun"))
def test_a_missing_viewer_is_named(viewer: str, monkeypatch: pytest.MonkeyPatch, started: list[list[str]]) -> None:
    install(monkeypatch)
    ended = run("log", "open", LOG, "--with", viewer)
    assert ended.returncode == exit_codes.UNHEALTHY and "install" in ended.stderr and not started


def test_a_log_that_is_being_written_needs_no_repair(tmp_path: Path) -> None:
    path = tmp_path / "now.mcap"
    path.write_bytes(Path(LOG).read_bytes()[:-1000])
    with path.open("rb") as writer:
        flock(writer.fileno(), LOCK_EX)
        message = failure("log", "open", str(path), "--with", "plotjuggler")
    assert "still being written" in message and "recover" not in message
