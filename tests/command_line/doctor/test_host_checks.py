"""The /proc and /sys of a synthetic computer are read and evaluated."""

import os
from datetime import UTC, datetime
from math import inf
from pathlib import Path
from typing import Any

import pytest

from command_line.doctor import host_facts
from command_line.doctor.findings import Finding, Level
from command_line.doctor.host_checks import (
    ENOUGH_MIN,
    LEAST_MIN,
    WALK_BYTES_PER_MIN,
    Account,
    examine_clock,
    examine_folder,
    examine_host,
    examine_limits,
    examine_python,
    examine_shell,
    examine_space,
    examine_storage,
    may_write,
)
from command_line.doctor.host_facts import Limits, Mount, can_interrupts, isolated_processors, mount_of, thread_priority
from firmware_host.configuration.configuration import LoopParameters
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.configuration.service_file import UNIT
from firmware_host.log.log_folder import ACTIVE, FreeSpace
from tests.folders import ROOT

OK, WARN, FAIL = Level
GOOD_LIMITS = Limits(49, inf, "in the unit")
LIMITS = """\
Limit                     Soft Limit           Hard Limit           Units
Max cpu time              unlimited            unlimited            seconds
Max locked memory         unlimited            unlimited            bytes
Max realtime priority     49                   49
"""
STAT = "{pid} ({name}) S 2 0 0 0 -1 2129984 0 0 0 0 0 0 0 0 -51 0 1 0 12 0 0" + " 0" * 15 + " {priority} 1 0 0 0 0 0"
KERNEL, REALTIME, ISOLATED = "proc/sys/kernel/version", "sys/kernel/realtime", "sys/devices/system/cpu/isolated"
GOVERNOR = "sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor"
MOUNTS = """\
/dev/sda1 / ext4 rw,relatime 0 0
tmpfs /run tmpfs rw,nosuid 0 0
/dev/sdb1 /var/lib/my\\040logs vfat rw 0 0
/dev/sdc1 /mnt ext4 ro,relatime 0 0
host:/logs /net fuse.sshfs rw 0 0
"""


def thread(pid: int, name: str, priority: int) -> dict[str, str]:
    """Return the files of a thread."""
    return {f"proc/{pid}/comm": name, f"proc/{pid}/stat": STAT.format(pid=pid, name=name, priority=priority)}


GOOD = {
    "proc/sys/kernel/osrelease": "6.1.0-rt",
    KERNEL: "#1 SMP PREEMPT_RT Debian 6.1",
    ISOLATED: "3",
    **{GOVERNOR.format(cpu): "performance" for cpu in range(4)},
    **thread(55, "irq/55-can0", 50),
    "proc/self/mounts": MOUNTS,
}
DYNAMIC = {KERNEL: "#1 SMP PREEMPT_DYNAMIC Debian"}
SLEEPY = {f"sys/devices/system/cpu/cpu0/cpuidle/state{n}/latency": us for n, us in enumerate(("0", "2", "133"))}
LATENCY = "dev/cpu_dma_latency"  # a binary number
TWO_BUSES = thread(56, "irq/56-can1", 45)


def write(root: Path, files: dict[str, str]) -> Path:
    for location, text in files.items():
        path = root / location
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="utf-8")
    return root


@pytest.fixture
def computer(tmp_path: Path) -> Path:
    return write(tmp_path, GOOD)


def levels(root: Path, priority: int | None = None, **loop: Any) -> dict[str, Level]:
    found = examine_host(root, LoopParameters(**{"cpu": 3} | loop), GOOD_LIMITS, priority)
    return {finding.id: finding.level for finding in found}


def test_a_robot_s_computer_is_ok_in_every_line(computer: Path) -> None:
    lines = ("kernel", "realtime", "memlock", "governor", "sleep", "processors", "interrupts")
    assert levels(computer) == dict.fromkeys(lines, OK)


def test_an_empty_tree_breaks_nothing(tmp_path: Path) -> None:
    found = list(examine_host(tmp_path, LoopParameters(), None, None))
    assert {finding.id for finding in found if finding.level is not OK} == {"kernel", "limits"}


@pytest.mark.parametrize(
    ("files", "loop", "line", "level"),
    [
        ({KERNEL: "#1 SMP PREEMPT RT Wed"}, {}, "kernel", OK),
        (DYNAMIC, {}, "kernel", WARN),
        (DYNAMIC | {REALTIME: "1"}, {}, "kernel", OK),
        (DYNAMIC | {REALTIME: "0"}, {}, "kernel", WARN),
        ({GOVERNOR.format(2): "ondemand"}, {}, "governor", WARN),
        (SLEEPY | {LATENCY: "\0\0\0\0"}, {}, "sleep", OK),
        (SLEEPY | {LATENCY: "\1\1\1\1"}, {}, "sleep", OK),
        (SLEEPY | {LATENCY: "\1\1\1\1"}, {"stay_awake": False}, "sleep", WARN),
        (SLEEPY, {}, "sleep", WARN),
        ({}, {"cpu": -1}, "processors", OK),
        ({ISOLATED: "1-2"}, {"cpu": 2}, "processors", OK),
        ({ISOLATED: ""}, {"cpu": 2}, "processors", WARN),
        ({ISOLATED: "4"}, {"cpu": 4}, "processors", FAIL),  # there are four
        (TWO_BUSES, {"priority": 44}, "interrupts", OK),
        (TWO_BUSES, {"priority": 45}, "interrupts", WARN),
    ],
)
def test_each_property_is_evaluated(
    computer: Path, files: dict[str, str], loop: dict[str, Any], line: str, level: Level
) -> None:
    assert levels(write(computer, files), **loop)[line] is level


@pytest.mark.parametrize(("actual", "level"), [(45, OK), (0, FAIL)])
def test_a_running_loop_that_did_not_get_its_priority_fails(computer: Path, actual: int, level: Level) -> None:
    assert levels(computer, actual)["loop.priority"] is level


def test_properties_are_read(computer: Path) -> None:
    write(computer, SLEEPY | {ISOLATED: "1-3,6"} | thread(90, "odd) S 1 (", 37))
    for pid, name in ((60, "irq/60-spi0.0"), (61, "irq/61-xhci_hcd"), (62, "irq/9-acpi"), (63, "candump")):
        write(computer, thread(pid, name, 50))
    assert host_facts.deepest_sleep_us(computer) == 133
    assert isolated_processors(computer) == {1, 2, 3, 6}
    assert (thread_priority(computer, 90), thread_priority(computer, 91)) == (37, 0)
    assert thread_priority(Path("/"), os.getpid()) == os.sched_getparam(0).sched_priority
    assert [each.name for each in can_interrupts(computer)] == ["irq/55-can0", "irq/60-spi0.0", "irq/61-xhci_hcd"]
    assert host_facts.clock_is_synchronised() in (True, False)


def test_limits_are_read_of_a_process_and_of_the_unit(computer: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    write(computer, {"proc/77/limits": LIMITS})
    write(computer, {"proc/self/limits": LIMITS.replace("49 ", "0  ").replace("unlimited", "8388608  ")})
    assert host_facts.process_limits(computer, 77) == Limits(49, inf, "of the daemon")
    assert host_facts.process_limits(computer, None) == Limits(0, 8388608, "of this shell")
    assert host_facts.process_limits(computer, 78) is None
    assert host_facts.unit_limits(computer) is None
    write(computer, {UNIT: (ROOT / "systemd/mudskipper.service").read_text(encoding="utf-8")})
    installed = host_facts.unit_limits(computer)
    assert installed == GOOD_LIMITS
    assert [finding.level for finding in examine_limits(LoopParameters(), installed)] == [OK, OK]
    write(computer, {f"{UNIT}.d/override.conf": "[Service]\nLimitRTPRIO=20"})
    assert host_facts.unit_limits(computer) == Limits(20, inf, "in the unit")
    write(computer, {f"{UNIT}.d/override.conf": "[Service]\nLimitRTPRIO=48:49\nLimitMEMLOCK=4G"})
    assert host_facts.unit_limits(computer) == Limits(48, 2**32, "in the unit")


def test_small_limits_fail_a_daemon_and_warn_of_a_shell_next_to_a_service() -> None:
    small = Limits(44, 8e6, "of this shell")
    assert [finding.level for finding in examine_limits(LoopParameters(), small)] == [FAIL, WARN]
    assert not list(examine_limits(LoopParameters(priority=0, lock_memory=False), Limits(0, 0, "")))
    found = {finding.id: finding.level for finding in examine_shell(LoopParameters(), small)}
    assert found == {"shell.realtime": WARN, "shell.memlock": WARN}


@pytest.mark.parametrize(
    ("folder", "mount", "level"),
    [
        ("/var/lib/mudskipper/logs", Mount("/", "ext4", False), OK),
        ("/run/logs", Mount("/run", "tmpfs", False), WARN),
        ("/runner", Mount("/", "ext4", False), OK),
        ("/var/lib/my logs/a", Mount("/var/lib/my logs", "vfat", False), WARN),
        ("/mnt/x", Mount("/mnt", "ext4", True), FAIL),
        ("/net/x", Mount("/net", "fuse.sshfs", False), WARN),
    ],
)
def test_the_file_system_of_the_logs_is_that_of_the_longest_mount(
    computer: Path, folder: str, mount: Mount, level: Level
) -> None:
    assert mount_of(computer, Path(folder)) == mount
    assert storage(computer, folder)["file_system"].level is level


def storage(computer: Path, folder: str, daemon_runs: bool = False) -> dict[str, Finding]:
    writer = Account("you", os.geteuid(), frozenset({os.getegid()}))
    found = examine_storage(computer, LogParameters(folder, min_free_fraction=0.0), writer, daemon_runs)
    return {finding.id: finding for finding in found}


def test_logs_that_were_cut_off_are_reported_if_no_daemon_is_writing_them(computer: Path) -> None:
    write(computer, {f"logs/{ACTIVE}/20260101T000000.000000Z-robot-0000.mcap": ""})
    assert storage(computer, "/logs")["unfinished_logs"].level is WARN
    assert "unfinished_logs" not in storage(computer, "/logs", daemon_runs=True)
    assert storage(computer, "/elsewhere")["unfinished_logs"].level is OK
    assert storage(computer, "/elsewhere")["quota"].text.endswith("uncopied ones last; 0 of 0 not copied")


@pytest.mark.parametrize(
    ("fraction", "free_bytes", "level"),
    [
        (0.5, 10**10, OK),
        (0.05, 10**9, WARN),  # less than is to stay free
        (0.99, WALK_BYTES_PER_MIN * LEAST_MIN - 1, FAIL),
        (0.99, WALK_BYTES_PER_MIN * LEAST_MIN, WARN),
        (0.99, WALK_BYTES_PER_MIN * ENOUGH_MIN - 1, WARN),
        (0.99, WALK_BYTES_PER_MIN * ENOUGH_MIN, OK),
    ],
)
def test_a_disk_is_evaluated_by_the_walking_time_that_it_has_room_for(
    fraction: float, free_bytes: float, level: Level
) -> None:
    assert examine_space(FreeSpace(fraction, round(free_bytes)), 0.1).level is level


@pytest.mark.parametrize("mode", [0o700, 0o070, 0o007, 0o770, 0o000, 0o755])
@pytest.mark.parametrize(
    ("uid", "group", "bit"), [(10, 20, 0o200), (11, 20, 0o020), (11, 21, 0o002), (10, 21, 0o200), (0, 0, 0)]
)
def test_write_permission_is_that_of_the_kernel(mode: int, uid: int, group: int, bit: int) -> None:
    status = os.stat_result((mode, 0, 0, 0, 10, 20, 0, 0, 0, 0))
    assert may_write(status, Account("x", uid, frozenset({group}))) is (uid == 0 or bool(mode & bit))


def test_the_service_s_own_folder_is_made_at_its_start_and_no_other(tmp_path: Path) -> None:
    (tmp_path / "var/lib").mkdir(parents=True)
    service, you = (Account(name, os.geteuid() + 4242, frozenset()) for name in ("mudskipper", "you"))
    logs = tmp_path / "var/lib/mudskipper/logs"
    assert examine_folder(logs, service).level is OK
    refused = examine_folder(logs, you)
    assert refused.level is FAIL and f"-o {you.uid} {logs}'" in refused.fix
    assert examine_folder(tmp_path / "var/lib/elsewhere", service).level is FAIL
    logs.mkdir(parents=True)
    assert examine_folder(logs, service).level is FAIL


@pytest.mark.parametrize(
    ("year", "synchronised", "chip", "level"),
    [(2026, True, True, OK), (2026, False, True, WARN), (2026, True, False, WARN), (1970, True, True, FAIL)],
)
def test_a_clock_is_set_synchronised_and_kept(year: int, synchronised: bool, chip: bool, level: Level) -> None:
    assert examine_clock(datetime(year, 1, 2, tzinfo=UTC), synchronised, chip).level is level


@pytest.mark.parametrize(
    ("version", "owners", "found"),
    [
        ((3, 11, 2), ["mudskipper"], [OK, OK]),
        ((3, 10, 9), ["mudskipper"], [FAIL, OK]),
        ((3, 12, 0), ["mudskipper", "control"], [OK, FAIL]),
    ],
)
def test_an_old_python_and_another_owner_of_control_fail(
    version: tuple[int, ...], owners: list[str], found: list[Level]
) -> None:
    assert [finding.level for finding in examine_python(version, {"control": owners})] == found
