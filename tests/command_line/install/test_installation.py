"""`install` and `uninstall` act on a synthetic system that only records its commands."""

import json
import os
import sys
import sysconfig
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.install import installation, service_plan
from command_line.install.installation import (
    Find,
    StepError,
    install,
    location_problem,
    perform,
    run_command,
    uninstall,
)
from command_line.install.service_plan import (
    LINKS,
    LIVE_UNIT,
    MANIFEST,
    NETWORK,
    SOURCES,
    Command,
    Outcome,
    Plan,
    Remove,
    System,
    WriteFile,
    load_sources,
    plan_installation,
    plan_removal,
)
from firmware_host.configuration.service_file import CONFIGURATION, UNIT

PREFIX = Path(sys.prefix)


class Machine:
    """Owns a root folder and emulates the calls of systemctl that an installation needs."""

    def __init__(self, root: Path, patch: pytest.MonkeyPatch) -> None:
        self.root = root
        self._patch = patch
        self.enabled: set[str] = set()
        self.ran: list[str] = []
        self.failing = ""

    def run(self, words: Sequence[str]) -> Outcome:
        line = " ".join(word for word in words if not word.startswith("--root"))
        if line.startswith("systemctl is-enabled "):
            return Outcome(0, "enabled\n" if words[-1] in self.enabled else "disabled\n")
        if line.startswith("systemctl is-active "):
            return Outcome(0, "active\n" if words[-1] in self.enabled else "inactive\n")
        if self.failing and self.failing in line:
            return Outcome(1, "something\nFailed to connect to bus\n")
        self.ran.append(line)
        if line.startswith("systemctl enable"):
            self.enabled.add(words[-1])
        if line.startswith("systemctl disable"):
            self.enabled.discard(words[-1])
        return Outcome(0, "")

    def install(self, status: int = exit_codes.OK, find: Find = str, **options: bool) -> str:
        """Install with this exit status; return what is printed."""
        return self._printed(partial(install, root=self.root, run=self.run, find=find, **options), status)

    def uninstall(self, **options: bool) -> str:
        return self._printed(partial(uninstall, root=self.root, run=self.run, find=str, **options), exit_codes.OK)

    def _printed(self, act: Callable[[], int], status: int) -> str:
        with redirect_stdout(StringIO()) as printed, redirect_stderr(printed):
            assert act() == status
        return printed.getvalue()

    def release(self, location: str) -> None:
        """Simulate a new version of the project in which one file has changed."""
        texts = load_sources(PREFIX)
        changed = texts | {location: texts[location] + "# new\n"}
        self._patch.setattr(service_plan, "load_sources", lambda *given, **named: changed)

    def plan(self) -> Plan:
        """Plan an installation on this folder as a system that is running."""
        return plan_installation(self.system())

    def system(self) -> System:
        """Return this folder as a system that is running."""
        return System(self.root, PREFIX, self.run, live=True)

    def text(self, location: str) -> str:
        return (self.root / location).read_text(encoding="utf-8")

    def edit(self, location: str) -> str:
        edited = self.text(location) + "\n# mine\n"
        (self.root / location).write_text(edited, encoding="utf-8")
        return edited

    def files(self) -> dict[str, str]:
        return {
            str(path.relative_to(self.root)): path.read_text(encoding="utf-8")
            for path in self.root.rglob("*")
            if path.is_file()
        }


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(tmp_path, monkeypatch)


def commands(plan: Plan) -> list[str]:
    return [" ".join(step.words) for step in plan.steps if isinstance(step, Command)]


def test_all_files_are_written_readable_for_every_user_and_the_service_is_enabled(machine: Machine) -> None:
    before = os.umask(0o077)
    try:
        machine.install()
    finally:
        os.umask(before)
    for location in SOURCES:
        assert (machine.root / location).stat().st_mode & 0o777 == 0o644
        assert (machine.root / location).parent.stat().st_mode & 0o777 == 0o755
    assert machine.text(NETWORK) == (service_plan.source_folder() / "80-can.network").read_text(encoding="utf-8")
    assert "mudskipper" in machine.enabled
    targets = [(machine.root / link).readlink() for link in LINKS]
    assert targets == [Path(sys.prefix) / "bin" / name for name in ("mudskipper", "mudskipperd")]


def test_where_there_is_no_working_tree_the_files_come_from_the_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(service_plan, "__file__", str(tmp_path / "site-packages/command_line/install/service_plan.py"))
    assert service_plan.source_folder() == Path(sysconfig.get_path("data")) / "share/mudskipper"


def test_a_dry_run_shows_everything_and_the_second_time_there_is_nothing_to_do(machine: Machine) -> None:
    shown = machine.install(dry_run=True)
    assert all(str(machine.root / location) in shown for location in (*SOURCES, *LINKS, MANIFEST))
    assert "run systemd-sysusers" in shown
    assert (machine.files(), machine.ran) == ({}, [])
    machine.install()
    before, ran = machine.files(), list(machine.ran)
    assert machine.install() == "nothing to do\n"
    assert (machine.files(), machine.ran) == (before, ran)


@pytest.mark.parametrize(("location", "edited"), [(NETWORK, False), (NETWORK, True), (CONFIGURATION, True)])
def test_an_upgrade_replaces_a_file_and_is_written_once_next_to_an_edited_one(
    machine: Machine, location: str, edited: bool
) -> None:
    machine.install()
    before = machine.edit(location) if edited else machine.text(location)
    assert not machine.plan().steps
    machine.release(location)
    machine.install()
    newer = machine.root / f"{location}.new"
    assert (newer if edited else machine.root / location).read_text(encoding="utf-8").endswith("# new\n")
    assert newer.exists() is (machine.text(location) == before) is edited
    newer.unlink(missing_ok=True)
    machine.install()
    assert not newer.exists()


def test_a_running_system_reloads_the_installed_files(machine: Machine) -> None:
    for name in ("net/can0", "net/lo", "misc/cpu_dma_latency"):
        (machine.root / "sys/class" / name).mkdir(parents=True)
    assert commands(machine.plan()) == [
        "systemd-sysusers",
        "systemctl daemon-reload",
        "udevadm control --reload",
        f"udevadm trigger --action=add {machine.root}/sys/class/net/can0 {machine.root}/sys/class/misc/cpu_dma_latency",
        "systemctl enable --now systemd-networkd",
        "systemctl disable systemd-networkd-wait-online",
        "networkctl reload",
        "systemctl enable mudskipper",
    ]


@pytest.mark.parametrize(
    ("was", "becomes", "devices"),
    [
        ('channel = "can1"', 'channel = "can-right"', ["can0", r"can\x2dright"]),
        ('interface = "socketcan"\nchannel = "can1"', 'interface = "slcan"\nchannel = "/dev/ttyACM0"', ["can0"]),
        ("wait_for_bus = false", "wait_for_bus = true", []),
    ],
)
def test_a_second_installation_lets_the_unit_wait_for_the_configured_buses(
    machine: Machine, was: str, becomes: str, devices: list[str]
) -> None:
    machine.install()
    configuration = machine.root / CONFIGURATION
    text = configuration.read_text(encoding="utf-8")
    assert was in text
    configuration.write_text(text.replace(was, becomes), encoding="utf-8")
    machine.ran.clear()
    machine.install()
    assert machine.ran == ["systemctl reenable mudskipper"]
    lines = machine.text(UNIT).splitlines()
    for key in ("BindsTo=", "After=", "WantedBy="):
        waits_for = " ".join(line.partition("=")[2] for line in lines if line.startswith(key)).split()
        found = [each for each in waits_for if each.endswith(".device")]
        assert found == [f"sys-subsystem-net-devices-{device}.device" for device in devices]
    assert "WantedBy=multi-user.target" in lines
    machine.ran.clear()
    machine.install()
    assert not machine.ran


def test_the_unit_waits_for_the_buses_of_the_file_that_its_drop_in_names(machine: Machine) -> None:
    machine.install()
    text = machine.text(CONFIGURATION).replace('"can1"', '"can7"')
    (machine.root / "etc/mudskipper/other.toml").write_text(text, encoding="utf-8")
    (drop_in := machine.root / f"{UNIT}.d/override.conf").parent.mkdir()
    drop_in.write_text("[Service]\nExecStart=\nExecStart=/x --config=/etc/mudskipper/other.toml\n", encoding="utf-8")
    machine.install()
    assert "can7.device" in machine.text(UNIT) and "can1.device" not in machine.text(UNIT)
    machine.uninstall()
    assert not (machine.root / UNIT).exists()


@pytest.mark.parametrize("text", ["[bus", "bus = 3", "[bus]\nleft = 1", '[bus.left]\ninterface = "socketcan"', ""])
def test_a_configuration_that_makes_no_sense_is_refused_and_can_be_removed(machine: Machine, text: str) -> None:
    machine.install()
    (machine.root / CONFIGURATION).write_text(text, encoding="utf-8")
    before = machine.files()
    with pytest.raises(CommandError) as refused:
        machine.install()
    assert refused.value.status == exit_codes.CONFIGURATION and machine.files() == before
    machine.uninstall()
    assert not (machine.root / UNIT).exists()


def test_a_system_with_networkd_keeps_its_wait_for_the_network(machine: Machine) -> None:
    machine.enabled.add("systemd-networkd")
    assert not [line for line in commands(machine.plan()) if "systemd-networkd" in line]


def test_what_the_operator_disabled_stays_so_until_the_service_is_removed(machine: Machine) -> None:
    machine.install()
    machine.enabled.clear()
    machine.edit(UNIT)
    machine.release(NETWORK)
    machine.install()
    assert not machine.enabled
    machine.uninstall()
    machine.install()
    assert machine.enabled == {"systemd-networkd", "mudskipper"}


def test_a_service_that_runs_is_never_restarted_under_a_robot(machine: Machine) -> None:
    machine.install()
    machine.release(UNIT)
    plan = machine.plan()
    assert not [line for line in commands(plan) if "restart" in line or " start " in line]
    assert any("systemctl restart mudskipper" in note for note in plan.notes)


def test_a_failure_lists_the_finished_steps_and_the_next_run_does_the_rest(machine: Machine) -> None:
    machine.failing = "systemd-sysusers"
    said = machine.install(exit_codes.UNHEALTHY)
    assert "systemd-sysusers" in said and "Failed to connect to bus" in said and "9 of 14" in said
    machine.failing = ""
    machine.install()
    assert "systemd-sysusers" in machine.ran
    assert "mudskipper" in machine.enabled


def test_a_missing_program_is_reported_before_anything_is_written(machine: Machine) -> None:
    found = {name: f"/bin/{name}" for name in ("systemctl", "udevadm", "networkctl")}
    assert "systemd-sysusers: not installed" in machine.install(exit_codes.UNHEALTHY, found.get)
    assert machine.files() == {}


@pytest.mark.parametrize("command", ["install", "uninstall"])
def test_without_root_it_is_refused_before_anything_is_written(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], machine: Machine
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(installation, "location_problem", lambda locations: "")
    monkeypatch.setattr(installation, "_perform_all", None)  # would raise
    act = install if command == "install" else uninstall
    assert act(run=machine.run) == exit_codes.NOT_PERMITTED
    assert "sudo" in capsys.readouterr().err
    assert machine.ran == []


@pytest.mark.parametrize(
    ("folders", "named"),
    [
        (("/tmp/venv", "/opt/venv"), "/tmp/venv"),
        (("/opt/venv", "/home/ann/tree"), "/home/ann/tree"),  # an editable installation
        (("/opt/venv", "/opt/venv"), "no mudskipperd in /opt/venv"),
    ],
)
def test_an_environment_from_which_the_service_cannot_start_is_refused(folders: tuple[str, str], named: str) -> None:
    assert named in location_problem([Path(folder) for folder in folders])


def test_uninstall_keeps_logs_and_what_was_edited_and_a_purge_keeps_nothing(machine: Machine) -> None:
    machine.install()
    edited = {location: machine.edit(location) for location in (CONFIGURATION, NETWORK)}
    log = "var/lib/mudskipper/logs/done/a.mcap"
    (machine.root / log).parent.mkdir(parents=True)
    (machine.root / log).write_text("a log", encoding="utf-8")
    machine.uninstall()
    left = machine.files()
    assert set(json.loads(left.pop(MANIFEST))) == edited.keys() and left == edited | {log: "a log"}
    assert "mudskipper" not in machine.enabled
    assert not any((machine.root / link).is_symlink() for link in LINKS)
    machine.install()
    assert machine.text(CONFIGURATION) == edited[CONFIGURATION]
    assert not (machine.root / f"{CONFIGURATION}.new").exists()
    machine.uninstall(purge=True)
    assert machine.files() == {}


def test_a_purge_stops_the_service_first_and_removes_group_and_user_last(machine: Machine) -> None:
    machine.install()
    (machine.root / "etc/passwd").write_text("root:x:0:0::/root:/bin/sh\nmudskipper:x:990:990::/:\n", encoding="utf-8")
    (machine.root / "etc/group").write_text("mudskipper-view:x:991:ada\nmudskipper:x:990:\n", encoding="utf-8")
    steps = plan_removal(machine.system(), purge=True).steps
    assert str(steps[0]) == "run systemctl disable --now mudskipper"
    assert [str(step) for step in steps[-2:]] == ["run groupdel mudskipper-view", "run userdel mudskipper"]
    assert Remove(machine.root / "etc/mudskipper") in steps


def test_the_service_for_viewers_is_loaded_again_when_it_was_deleted_or_changes_and_ended_when_it_goes(
    machine: Machine,
) -> None:
    machine.install()
    machine.enabled.add("mudskipper-live")
    assert "systemctl disable --now mudskipper-live" in commands(plan_removal(machine.system(), purge=False))
    (machine.root / LIVE_UNIT).unlink()
    assert commands(machine.plan()) == ["systemctl daemon-reload"]
    machine.install()
    machine.release(LIVE_UNIT)
    assert commands(machine.plan()) == ["systemctl daemon-reload"]


def test_a_manifest_that_makes_no_sense_counts_as_none(machine: Machine) -> None:
    machine.install()
    (machine.root / MANIFEST).write_text("[1, 2", encoding="utf-8")
    machine.install()
    assert set(json.loads(machine.text(MANIFEST))) == set(SOURCES)


def test_files_that_were_there_before_stay(machine: Machine) -> None:
    other = LINKS[0]
    for path in (CONFIGURATION, UNIT, other):
        (machine.root / path).parent.mkdir(parents=True, exist_ok=True)
    (machine.root / CONFIGURATION).write_text("[bus]\n", encoding="utf-8")
    (machine.root / other).write_text("#!/bin/sh\n", encoding="utf-8")
    (machine.root / UNIT).symlink_to("/dev/null")  # a masked unit
    machine.install()
    assert machine.text(CONFIGURATION) == "[bus]\n" and (machine.root / UNIT).readlink() == Path("/dev/null")
    machine.uninstall(purge=True)
    assert machine.text(other) == "#!/bin/sh\n"


@pytest.mark.parametrize("step", [Command(("/nothing",)), Command(("false",)), WriteFile(Path("/dev/null/x"), "")])
def test_a_step_that_fails_raises_its_reason(step: Command | WriteFile) -> None:
    with pytest.raises((StepError, OSError)) as raised:
        perform(step, run_command)
    assert str(raised.value)
