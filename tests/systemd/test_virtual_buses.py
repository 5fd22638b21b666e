"""The guide's changes for an installation on virtual CAN buses agree with each other."""

import os
import re
import shlex
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from firmware_host.configuration.loading import load_configuration
from tests.folders import ROOT
from tests.waiting import LONGEST_S, wait_until
from verification.virtual_machine import base_system
from verification.virtual_machine.installed_robot import GUIDE, installation

SYSTEMD = ROOT / "systemd"
BUSES = {"vcan0", "vcan1"}
SOURCE = "/opt/mudskipper/src"  # of the project, on a robot
LOCK_FILE = "requirements/robot.txt"


@pytest.fixture
def edited(tmp_path: Path) -> Path:
    """Return copies of configuration and unit after the `sed` commands of the guide."""
    guide = (ROOT / GUIDE).read_text(encoding="utf-8")
    (line,) = [line for line in guide.splitlines() if line.startswith("sed -i ")]
    program, in_place, expression, *paths = shlex.split(line)
    assert {Path(path).name for path in paths} == {"mudskipper.toml", "mudskipper.service"}
    for path in paths:
        copy = tmp_path / Path(path).name
        copy.write_text((SYSTEMD / copy.name).read_text(encoding="utf-8"), encoding="utf-8")
        subprocess.run([program, in_place, expression, str(copy)], check=True, timeout=LONGEST_S)
    return tmp_path


def test_the_configuration_names_the_virtual_buses_and_no_others(edited: Path) -> None:
    buses = load_configuration(edited / "mudskipper.toml").bus.values()
    assert {bus.channel for bus in buses} == BUSES


def test_the_unit_waits_for_the_virtual_buses_and_no_others(edited: Path) -> None:
    text = (edited / "mudskipper.service").read_text(encoding="utf-8")
    assert set(re.findall(r"sys-subsystem-net-devices-(\w+)\.device", text)) == BUSES
    for key in ("BindsTo", "After", "WantedBy"):
        assert all(f"{key}=" in text and f"devices-{bus}.device" in text for bus in BUSES)


def test_the_network_files_make_them_and_bring_them_up() -> None:
    texts = [path.read_text(encoding="utf-8") for path in sorted(SYSTEMD.glob("80-vcan*.netdev"))]
    assert {name for text in texts for name in re.findall(r"^Name=(\w+)$", text, re.MULTILINE)} == BUSES
    assert all("Kind=vcan" in text.splitlines() for text in texts)
    network = (SYSTEMD / "80-vcan.network").read_text(encoding="utf-8").splitlines()
    assert f"Name={' '.join(sorted(BUSES))}" in network
    assert "RequiredForOnline=no" in network


def guide_commands(heading: str) -> list[str]:
    guide = (ROOT / GUIDE).read_text(encoding="utf-8")
    block = re.search(rf"^{heading}$.*?^```sh\n(.*?)^```$", guide, re.MULTILINE | re.DOTALL)
    assert block is not None
    return [line.split("  #")[0].strip() for line in block[1].splitlines()]


def test_the_virtual_machine_is_installed_by_the_guide_s_commands() -> None:
    script = installation()
    commands = guide_commands("## On the robot") + guide_commands("## Without CAN hardware")
    left_out = [command for command in commands if f"\n{{ {command}" not in script]
    assert [" ".join(command.split()[:2]) for command in left_out] == [
        *("apt install", "git clone"),  # the base system has the packages, and the working tree is copied instead
        *("mudskipper doctor", "systemctl status", "mudskipper simulate"),  # need a running system
    ]
    positions = [script.index(f"\n{{ {command}") for command in commands if command not in left_out]
    assert positions == sorted(positions)


def test_a_second_run_of_the_virtual_machine_waits_for_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(base_system, "PROJECT", tmp_path)
    lock = base_system.lock_clone.__wrapped__
    first = lock()
    with ThreadPoolExecutor(1) as threads:
        second = threads.submit(lock)
        wait_until(lambda: "waiting for its end" in capsys.readouterr().err)
        assert not second.done()
        os.close(first)
        os.close(second.result())


def test_the_virtual_machine_installs_the_locked_requirements_and_nothing_else() -> None:
    pip_calls = [
        shlex.split(call) for call in re.findall(r"^\{ \S*/pip (install .*?);? \}", installation(), re.MULTILINE)
    ]
    locked, project = pip_calls
    assert {"--require-hashes", "--only-binary=:all:"} < {*locked}
    assert locked[locked.index("-r") + 1 :] == [f"{SOURCE}/{LOCK_FILE}"] and (ROOT / LOCK_FILE).is_file()
    assert {"--no-deps", "--no-index", "--no-build-isolation"} < {*project} and project[-1] == SOURCE
