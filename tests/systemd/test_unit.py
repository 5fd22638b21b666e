"""The service files agree with the example configuration and with the code, and systemd accepts them."""

import grp
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import pytest

from control.rate import PERIOD_S, RATE_HZ
from control.records import JOINTS
from drivers.can.mock_bus import MockBus
from drivers.drive_types import make_drives
from firmware_host import daemon
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, Configuration, StatusParameters
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.socket_methods import Level
from firmware_host.sockets.user_groups import load_rights
from tests.folders import ROOT
from tests.waiting import LONGEST_S

SYSTEMD = ROOT / "systemd"
LINUX_QUEUE_LENGTH = 10  # of a CAN interface without configuration

Settings = dict[str, list[str]]
each_service = pytest.mark.parametrize("name", ["mudskipper.service", "mudskipper-live.service"])


def read_settings(name: str) -> Settings:
    """Return, for each key of a unit, the words of all its lines `Key=value`."""
    settings: Settings = {}
    for line in (SYSTEMD / name).read_text(encoding="utf-8").splitlines():
        key, separator, value = line.partition("=")
        if separator and not line.startswith("#"):
            settings.setdefault(key, []).extend(value.split())
    return settings


PLAIN = {  # settings of the daemon's unit with one value
    "RestartPreventExitStatus": str(EXIT_CONFIGURATION),  # a wrong configuration is not tried again
    "Restart": "on-failure",
    "Type": "notify",
    "NotifyAccess": "main",
    "KillMode": "control-group",
    "KillSignal": "SIGTERM",  # which the log's writer ignores, so it may finish
    "LimitMEMLOCK": "infinity",
    "RuntimeDirectoryMode": "0755",  # every user may enter, who may stop
    "StateDirectoryMode": "0750",
    "ProtectSystem": "strict",  # so nothing but logs could be written
}
ABSENT = {
    "ExecStartPre",  # RestartPreventExitStatus ignores its status
    "RestrictRealtime",
    "CPUSchedulingPolicy",  # it would make the log's writer a real-time process too
    "PrivateUsers",  # the daemon would see every caller as the user "nobody"
}


@pytest.fixture(scope="module")
def unit() -> Settings:
    return read_settings("mudskipper.service")


def only(settings: Settings, key: str) -> str:
    (value,) = settings[key]
    return value


def seconds(settings: Settings, key: str) -> float:
    return float(only(settings, key))


def interfaces(configuration: Configuration) -> set[str]:
    return {bus.channel for bus in configuration.bus.values() if bus.interface == "socketcan"}


def systemd_analyze(*arguments: str) -> subprocess.CompletedProcess[str]:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    return subprocess.run(["systemd-analyze", *arguments], capture_output=True, text=True, timeout=LONGEST_S)


def test_the_unit_starts_the_daemon_that_this_project_installs(unit: Settings) -> None:
    program, option, path = unit["ExecStart"]
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]
    assert scripts[Path(program).name] == "firmware_host.daemon:main"
    assert (option, path) == ("--config", f"/etc/{only(unit, 'ConfigurationDirectory')}/mudskipper.toml")


def test_an_operator_who_starts_the_daemon_without_options_gets_the_same_configuration(
    unit: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []

    def refuse(path: Path) -> Configuration:
        asked.append(path)
        raise ConfigurationError([])

    monkeypatch.setattr(daemon, "load_configuration", refuse)
    daemon.main([])
    assert asked == [Path(unit["ExecStart"][-1])]


def test_the_socket_is_in_the_unit_s_runtime_directory(unit: Settings, configuration: Configuration) -> None:
    assert Path(configuration.status.socket).parent == Path("/run") / only(unit, "RuntimeDirectory")
    assert configuration.status.socket == StatusParameters().socket
    assert configuration.status.anyone_may_stop


def test_logs_go_into_the_unit_s_state_directory(unit: Settings, configuration: Configuration) -> None:
    state = Path("/var/lib") / only(unit, "StateDirectory")
    assert Path(configuration.log.directory).is_relative_to(state)
    assert configuration.log.directory == LogParameters().directory


def test_the_unit_s_user_and_group_are_the_ones_that_sysusers_makes(unit: Settings) -> None:
    lines = (SYSTEMD / "mudskipper.sysusers").read_text(encoding="utf-8").splitlines()
    users = [line.split()[1] for line in lines if line.startswith("u ")]  # `u` makes the group as well
    assert users == [only(unit, "User")] == [only(unit, "Group")]


def test_the_service_that_a_network_reaches_may_read_and_not_drive(
    unit: Settings, configuration: Configuration, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a robot after the installation: the groups that sysusers makes, the daemon's own, the shipped file."""
    lines = (SYSTEMD / "mudskipper.sysusers").read_text(encoding="utf-8").splitlines()
    made = {line.split()[1]: number for number, line in enumerate(lines, 990) if line[:2] in ("u ", "g ")}
    monkeypatch.setattr(grp, "getgrnam", lambda name: grp.struct_group((name, "x", made[name], [])))
    monkeypatch.setattr(os, "getegid", lambda: made[only(unit, "Group")])
    live = read_settings("mudskipper-live.service")
    peer = Peer(1, 61234, frozenset({61234, *(made[group] for group in live["SupplementaryGroups"])}))
    assert load_rights(configuration.status).level(peer) is Level.READ


def test_the_unit_has_the_settings_on_which_the_daemon_relies(unit: Settings) -> None:
    assert {key: only(unit, key) for key in PLAIN} == PLAIN and not unit.keys() & ABSENT


def test_systemd_waits_longer_than_the_daemon_ever_takes_to_end(unit: Settings) -> None:
    longest_s = daemon.LONGEST_SHUTDOWN_S + daemon.IDLING_S + daemon.LONGEST_LOG_CLOSE_S
    assert seconds(unit, "TimeoutStopSec") > longest_s + 2.0


def test_a_healthy_loop_feeds_the_watchdog_several_times_over(unit: Settings) -> None:
    slowest_s = 2 * daemon.NOTIFY_TICKS / RATE_HZ  # a loop that misses every other tick still counts as healthy
    assert seconds(unit, "WatchdogSec") >= 3 * slowest_s


def test_the_loop_may_have_its_priority_but_not_that_of_the_interrupts(
    unit: Settings, configuration: Configuration
) -> None:
    assert configuration.loop.priority <= int(only(unit, "LimitRTPRIO")) < 50


def test_the_unit_lives_and_dies_with_the_buses_of_the_example_configuration(
    unit: Settings, configuration: Configuration
) -> None:
    devices = {f"sys-subsystem-net-devices-{name}.device" for name in interfaces(configuration)}
    assert devices
    assert set(unit["BindsTo"]) == devices
    assert devices <= set(unit["After"])
    assert devices <= set(unit["WantedBy"])


def test_the_network_files_configure_the_same_buses(configuration: Configuration) -> None:
    network, link = read_settings("80-can.network"), read_settings("80-can.link")
    assert set(network["Name"]) == set(link["OriginalName"]) == interfaces(configuration)
    assert only(network, "BitRate") == "1M"
    assert only(network, "RestartSec") == "100ms"
    assert only(network, "RequiredForOnline") == "no"


def test_the_transmit_queue_holds_the_tick_that_arms_where_linux_s_own_would_not(configuration: Configuration) -> None:
    buses = {name: MockBus() for name in configuration.bus}
    peers = [bus.open() for bus in buses.values()]
    drives = make_drives(configuration.drive, {name: bus.open() for name, bus in buses.items()}, configuration.limits)
    drives.request_settings(0.0)
    drives.arm(0.0)
    drives.send((0.0,) * len(JOINTS), PERIOD_S)  # type: ignore[arg-type]
    most = max(len(peer.receive()) for peer in peers)
    assert LINUX_QUEUE_LENGTH < most <= int(only(read_settings("80-can.link"), "TransmitQueueLength"))


def test_the_filter_lets_through_what_the_loop_and_the_writer_call(unit: Settings) -> None:
    allowed = expand(unit["SystemCallFilter"][0]) - expand(unit["SystemCallFilter"][1].removeprefix("~"))
    needed = {"sched_setscheduler", "sched_setaffinity", "setpriority", "mlockall", "vfork", "execve", "chmod"}
    needed |= {"umask", "getsockopt"}  # for the permissions of the socket's file and the identity of callers
    assert len(unit["SystemCallFilter"]) == 2
    assert needed <= allowed
    assert not {"setuid", "chown", "reboot", "ptrace"} & allowed


def expand(name: str) -> set[str]:
    """Return the system calls of one of systemd's sets."""
    listing = systemd_analyze("syscall-filter", name).stdout
    words = {line.strip() for line in listing.splitlines()[1:] if line.startswith("    ")}
    calls = {word for word in words if word[0] not in "@#"}
    return calls.union(*(expand(word) for word in words if word[0] == "@"))


@each_service
def test_systemd_finds_nothing_wrong_with_a_unit(name: str, tmp_path: Path) -> None:
    """`verify` requires that the program exists, so the copied unit starts this Python instead."""
    copy, unit = tmp_path / name, read_settings(name)
    program = Path(tempfile.mkdtemp(prefix="mud-")) / "python"  # the repository's path may contain spaces
    program.symlink_to(sys.executable)
    text = (SYSTEMD / name).read_text(encoding="utf-8")
    copy.write_text(text.replace(unit["ExecStart"][0], str(program)), encoding="utf-8")
    done = systemd_analyze("verify", "--man=no", str(copy))
    assert (done.returncode, done.stderr) == (0, "")


@each_service
def test_a_service_is_exposed_no_more_than_a_well_hardened_one(name: str) -> None:
    """It is 1.3 of 10 on systemd's scale; most of the rest comes from the robot's need of CAN and of real time."""
    done = systemd_analyze("security", "--offline=true", "--threshold=13", str(SYSTEMD / name))
    assert done.returncode == 0, done.stdout


def test_the_service_for_viewers_reaches_this_computer_alone_and_has_no_real_time() -> None:
    live = read_settings("mudskipper-live.service")
    assert (only(live, "IPAddressDeny"), only(live, "IPAddressAllow")) == ("any", "localhost")
    assert only(live, "RestrictRealtime") == "yes" and only(live, "DynamicUser") == "yes"
