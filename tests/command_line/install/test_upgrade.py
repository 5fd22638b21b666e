"""`mudskipper upgrade`: what another version changes, and when it is not installed."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.init.key_reference import configuration_keys
from command_line.install import installation
from command_line.install import upgrade as upgrade_module
from command_line.install.service_plan import (
    DEFAULT_PREFIX,
    LIVE_UNIT,
    Outcome,
    load_sources,
    source_folder,
)
from command_line.install.upgrade import key_changes, upgrade
from control.modes import ENERGISED, Mode
from firmware_host.configuration.service_file import CONFIGURATION, UNIT
from operator_client.status_client import DroppedError
from tests.command_line.fake_client import FakeClient, next_of
from tests.folders import ROOT

PREFIX = Path(DEFAULT_PREFIX)


class Computer:
    """A robot's computer with a package of this version, whose files and answers the test changes."""

    def __init__(self, root: Path) -> None:
        self.root, self.commands = root, [""]
        self.keys = [f"{key.section}.{key.name}" for key in configuration_keys()]
        self.refusal, self.is_package = "", True
        for path, text in load_sources(PREFIX).items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")

    def run(self, words: Sequence[str]) -> Outcome:
        self.commands.append(" ".join(words))
        if words[:2] == ("dpkg-deb", "--extract"):
            share = Path(words[3] + DEFAULT_PREFIX) / "share" / "mudskipper"
            share.mkdir(parents=True)
            for source in source_folder().iterdir():
                (share / source.name).write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
            live = share / Path(LIVE_UNIT).name
            live.write_text(live.read_text(encoding="utf-8") + "# new\n", encoding="utf-8")
        if words[0] == "dpkg-query" and not self.is_package:
            return Outcome(1, "dpkg-query: no packages found matching mudskipper")
        if "--check-config" in words:
            return Outcome(exit_codes.CONFIGURATION if self.refusal else 0, self.refusal)
        return Outcome(0, "\n".join(self.keys) if "-c" in words else "1.0")

    def upgrade(self, check: bool = False) -> int:
        return upgrade(Path("new.deb"), check=check, socket=Path("/none"), run=self.run, root=self.root)

    @property
    def installed(self) -> bool:
        return "dpkg --install new.deb" in self.commands


@pytest.fixture
def computer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Computer:
    monkeypatch.setattr(sys, "prefix", DEFAULT_PREFIX)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    return Computer(tmp_path)


def test_a_check_names_keys_and_files_and_changes_nothing(
    computer: Computer, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.read_bytes() for path in computer.root.rglob("*") if path.is_file()}
    computer.keys = [key.replace("faults.silence_s", "faults.silent_s") for key in computer.keys]
    assert computer.upgrade(check=True) == exit_codes.OK and not computer.installed
    lines = capsys.readouterr().out.splitlines()
    assert "keys           faults.silence_s is gone; perhaps it is now faults.silent_s" in lines
    assert "keys           faults.silent_s is new" in lines
    assert [line for line in lines if line.startswith("files")] == [
        f"files          write {computer.root / LIVE_UNIT}.new",
        f"files          {computer.root / LIVE_UNIT} was edited and stays; the new version is in"
        " mudskipper-live.service.new next to it",
    ]  # edited, since no manifest says that this program wrote it
    assert before == {path: path.read_bytes() for path in computer.root.rglob("*") if path.is_file()}


def test_no_upgrade_of_an_installation_that_is_no_package(computer: Computer) -> None:
    """dpkg would mix the package's files with those that pip installed, below a daemon that runs."""
    computer.is_package = False
    assert computer.upgrade(check=True) == exit_codes.OK
    with pytest.raises(CommandError, match="no package"):
        computer.upgrade()
    assert not computer.installed


def test_a_slow_dpkg_is_not_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("dpkg", "dpkg-deb", "dpkg-query"):
        (tmp_path / name).write_text('#!/bin/sh\nsleep 0.2\necho >"$0.done"\n', encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(installation, "COMMAND_TIMEOUT_S", 0.1)
    monkeypatch.setattr(upgrade_module, "_describe", lambda *arguments: [])
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert upgrade(Path("new.deb"), socket="/none") == exit_codes.OK
    assert (tmp_path / "dpkg.done").exists()


@pytest.mark.parametrize("mode", Mode)
def test_it_is_installed_unless_drives_have_torque(
    computer: Computer, monkeypatch: pytest.MonkeyPatch, mode: Mode
) -> None:
    name = mode.name.lower()
    monkeypatch.setattr(upgrade_module, "StatusClient", lambda socket: FakeClient(next_of({"mode": name})))
    if mode in ENERGISED:
        with pytest.raises(CommandError, match=name) as refused:
            computer.upgrade()
        assert refused.value.status == exit_codes.REFUSED and not computer.installed
    else:
        assert computer.upgrade() == exit_codes.OK and computer.installed


def test_no_upgrade_under_a_daemon_that_does_not_say_its_mode(
    computer: Computer, monkeypatch: pytest.MonkeyPatch
) -> None:
    dropped = DroppedError("made room for another client")
    monkeypatch.setattr(upgrade_module, "StatusClient", lambda socket: FakeClient(lambda method: dropped))
    with pytest.raises(DroppedError):
        computer.upgrade()
    assert not computer.installed


def test_no_upgrade_to_a_version_that_refuses_the_configuration(computer: Computer) -> None:
    computer.refusal = "mudskipperd: faults.silence_s: there is no such key\nmudskipperd: another"
    with pytest.raises(CommandError, match="silence_s") as refused:
        computer.upgrade()
    assert refused.value.status == exit_codes.CONFIGURATION and not computer.installed


def test_the_configuration_is_that_of_the_service_s_drop_in(computer: Computer) -> None:
    other = computer.root / "etc/mudskipper/two_buses.toml"
    other.write_text((computer.root / CONFIGURATION).read_text(encoding="utf-8"), encoding="utf-8")
    (drop_in := computer.root / f"{UNIT}.d/override.conf").parent.mkdir()
    drop_in.write_text(
        "[Service]\nExecStart=\nExecStart=/x --config /etc/mudskipper/two_buses.toml\n", encoding="utf-8"
    )
    assert computer.upgrade(check=True) == exit_codes.OK
    assert computer.commands[-1].endswith(f"--config {other}")


def test_a_computer_without_a_configuration_has_none_to_refuse(computer: Computer) -> None:
    computer.refusal = "mudskipperd: there is no such file"
    (computer.root / CONFIGURATION).unlink()
    assert computer.upgrade() == exit_codes.OK and computer.installed


@pytest.mark.parametrize(
    ("mode", "options", "active"),
    [
        *(("", "", active) for active in (False, True)),
        *((mode.name.lower(), "", False) for mode in Mode),
        *(("hold", options, False) for options in ("--config {}", "--config={}")),
    ],
)
def test_the_package_refuses_in_the_same_modes(mode: str, options: str, active: bool, tmp_path: Path) -> None:
    """The scripts of the package also protect an upgrade by apt or dpkg alone.

    A program that is broken, or a daemon that gives no answer, prevents none unless the unit is active. The unit, or a
    drop-in of it, names the configuration.
    """
    configuration = tmp_path / ("other.toml" if options else "mudskipper.toml")
    unit = f"ExecStart={{ path=/x/mudskipperd ; argv[]=/x/mudskipperd {options.format(configuration)} ; pid=0 }}"
    answers = f"test $MUDSKIPPER_SOCKET = own.sock && echo '{json.dumps({'mode': mode})}'"
    answer = f"#!/bin/sh\n{answers}" if mode else "#!/none"
    configuration.write_text('[status]\nsocket = "own.sock"\n', encoding="utf-8")
    systemctl = f"#!/bin/sh\ncase $1 in show) echo '{unit}' ;; --quiet) {str(active).lower()} ;; *) exit 1 ;; esac"
    for name, text in (("mudskipper", answer), ("systemctl", systemctl)):
        (tmp_path / name).write_text(text, encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    path = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    script = (ROOT / "debian" / "prerm").read_text(encoding="utf-8")
    for folder in ("/opt/mudskipper/venv/bin", "/etc/mudskipper"):
        script = script.replace(folder, str(tmp_path))
    command = ["sh", "-c", script, "prerm", "upgrade"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=path)
    refuses = active or mode in {each.name.lower() for each in ENERGISED}
    assert ended.returncode == refuses and ended.stderr.count("\n") == refuses
    assert not refuses or ("does not report its mode" if active else f"in mode {mode}, ") in ended.stderr


def test_a_purge_of_the_package_removes_an_edited_unit_too(tmp_path: Path) -> None:
    answer: dict[str, Any] = {"run": lambda words: Outcome(0, ""), "find": str}
    installation.install(root=tmp_path, **answer)
    (tmp_path / UNIT).write_text("[Unit]\n# mine\n", encoding="utf-8")
    installation.uninstall(root=tmp_path, **answer)
    assert (tmp_path / UNIT).exists() and not (tmp_path / LIVE_UNIT).exists()
    for name in ("systemctl", "groupdel", "userdel"):
        (tmp_path / name).write_text("#!/bin/sh\n", encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    script = (ROOT / "debian" / "postrm").read_text(encoding="utf-8").replace("|/\\1|", f"|{tmp_path}/\\1|")
    script, folders = re.subn(" (/(etc|var|opt)/)", rf" {tmp_path}\1", script)
    assert folders == 4
    path = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    subprocess.run(["sh", "-c", script, "postrm", "purge"], check=True, env=path)
    assert not (tmp_path / UNIT).exists() and not (tmp_path / CONFIGURATION).exists()


def test_a_key_that_is_gone_without_a_similar_one_is_named_alone() -> None:
    assert list(key_changes(["a.b", "log.quota_bytes"], ["a.b"])) == ["log.quota_bytes is gone"]
