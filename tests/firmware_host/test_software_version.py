"""Every log contains the version and the commit that wrote it."""

import re
import subprocess
from pathlib import Path

import pytest

from firmware_host import software_version
from firmware_host.configuration.configuration import Configuration
from logs.files.log_reader import read_log
from logs.files.log_summary import log_summary
from simulation.harness.file_recorder import FileRecorder
from tests.folders import ROOT


def test_a_log_carries_version_and_commit(
    tmp_path: Path, configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(software_version, "software_commit", lambda: "0123abc")
    recorder = FileRecorder(tmp_path / "run.mcap", configuration)
    recorder.close()
    summary = log_summary(read_log(tmp_path / "run.mcap"))
    assert (summary["version"], summary["commit"]) == (software_version.software_version(), "0123abc")


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
@pytest.mark.parametrize("packed", [False, True])
def test_the_commit_is_that_of_git(tmp_path: Path, packed: bool) -> None:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    git("init", "--initial-branch", "trunk")
    git("commit", "--allow-empty", "-m", "first")
    if packed:
        git("pack-refs", "--all")
    tree = tmp_path / "tree"
    git("worktree", "add", str(tree))
    expected = git("rev-parse", "HEAD")
    assert software_version._checkout_commit(tmp_path / ".git") == expected
    assert software_version._checkout_commit(tree / ".git") == expected
    git("checkout", "--detach")
    assert software_version._checkout_commit(tmp_path / ".git") == expected
    assert re.fullmatch("[0-9a-f]{40}", software_version.software_commit())


def test_without_a_checkout_the_commit_is_empty_or_that_of_the_installation(tmp_path: Path) -> None:
    assert software_version._checkout_commit(tmp_path / ".git") == ""
    assert software_version._installed_commit() == ""
