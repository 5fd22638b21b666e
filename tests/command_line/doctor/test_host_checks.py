"""The /proc and /sys of a synthetic computer are read and evaluated."""

from __future__ import annotations

import os
import struct
from datetime import UTC, datetime
from math import inf
from pathlib import Path

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
    examine_interrupts,
    examine_limits,
    examine_priority,
    examine_processor,
    examine_python,
    examine_shell,
    examine_space,
    examine_storage,
    may_write,
)
from command_line.doctor.host_facts import (
    Limits,
    Mount,
    Thread,
    can_interrupts,
    isolated_processors,
    mount_of,
    thread_priority,
)
from firmware_host.configuration.configuration import LoopParameters
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.log.log_folder import ACTIVE, FreeSpace
from logs.files.log_reader import read_log
from tests.folders import ROOT

GOOD_LIMITS = Limits(49, inf, "in the unit")
LIMITS = """\
Limit                     Soft Limit           Hard Limit           Units
Max cpu time              unlimited            unlimited            seconds
Max locked memory         unlimited            unlimited            bytes
Max realtime priority     49                   49
"""
STAT = "{pid} ({name}) S 2 0 0 0 -1 2129984 0 0 0 0 0 0 0 0 -51 0 1 0 12 0 0" + " 0" * 15 + " {priority} 1 0 0 0 0 0"
FREE = FreeSpace(0.5, 10**10)


class Computer:
    def __init__(self, root: Path) -> None:
        self.root = root
        self.write("proc/sys/kernel/osrelease", "6.1.0-rt")
        self.write("proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian 6.1")
        self.write("sys/devices/system/cpu/isolated", "3")
        for cpu in range(4):
            self.write(f"sys/devices/system/cpu/cpu{cpu}/cpufreq/scaling_governor", "performance")
        self.thread(55, "irq/55-can0", 50)

    def write(self, location: str, text: str) -> None:
        path = self.root / location
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="utf-8")

    def thread(self, pid: int, name: str, priority: int) -> None:
        self.write(f"proc/{pid}/comm", name)
        self.write(f"proc/{pid}/stat", STAT.format(pid=pid, name=name, priority=priority))

    def levels(self, loop: LoopParameters | None = None, limits: Limits | None = GOOD_LIMITS) -> dict[str, Level]:
        found = examine_host(self.root, loop or LoopParameters(cpu=3), limits, None)
        return {finding.id: finding.level for finding in found}


@pytest.fixture
def computer(tmp_path: Path) -> Computer:
    return Computer(tmp_path)


def test_a_robot_s_computer_is_ok_in_every_line(computer: Computer) -> None:
    found = computer.levels()
    assert set(found) == {"kernel", "realtime", "memlock", "governor", "sleep", "processors", "interrupts"}
    assert set(found.values()) == {Level.OK}


def test_an_empty_tree_breaks_nothing(tmp_path: Path) -> None:
    found = list(examine_host(tmp_path, LoopParameters(), None, None))
    assert {finding.id for finding in found if finding.level is not Level.OK} == {"kernel", "limits"}


@pytest.mark.parametrize(
    ("version", "flag", "realtime"),
    [
        ("#1 SMP PREEMPT_RT Debian", "", True),
        ("#1 SMP PREEMPT RT Wed", "", True),
        ("#1 SMP PREEMPT_DYNAMIC Debian", "", False),
        ("#1 SMP PREEMPT_DYNAMIC", "1", True),
        ("#1 SMP PREEMPT_DYNAMIC", "0", False),
    ],
)
def test_a_real_time_kernel_is_known_by_its_version_or_its_flag(
    computer: Computer, version: str, flag: str, realtime: bool
) -> None:
    computer.write("proc/sys/kernel/version", version)
    computer.write("sys/kernel/realtime", flag)
    assert computer.levels()["kernel"] is (Level.OK if realtime else Level.WARN)


def test_a_governor_that_saves_power_is_warned_of(computer: Computer) -> None:
    computer.write("sys/devices/system/cpu/cpu2/cpufreq/scaling_governor", "ondemand")
    assert computer.levels()["governor"] is Level.WARN


@pytest.mark.parametrize(
    ("limit_us", "stay_awake", "level", "text"),
    [
        (0, True, Level.OK, "all processors are kept awake now"),
        (2_000_000_000, True, Level.OK, "takes up to 133 µs to wake; the daemon keeps all of them awake"),
        (2_000_000_000, False, Level.WARN, "ticks come late"),
        (None, True, Level.WARN, "is not readable"),
    ],
)
def test_processors_that_sleep_are_named_with_their_latency_and_with_what_holds_them(
    computer: Computer, limit_us: int | None, stay_awake: bool, level: Level, text: str
) -> None:
    for state, latency_us in enumerate((0, 2, 133)):
        computer.write(f"sys/devices/system/cpu/cpu0/cpuidle/state{state}/latency", str(latency_us))
    if limit_us is not None:
        device = computer.root / "dev/cpu_dma_latency"
        device.parent.mkdir()
        device.write_bytes(struct.pack("=i", limit_us))
    loop = LoopParameters(stay_awake=stay_awake)
    (found,) = (each for each in examine_host(computer.root, loop, GOOD_LIMITS, None) if each.id == "sleep")
    assert found.level is level and text in found.text


@pytest.mark.parametrize(("text", "found"), [("", set()), ("3", {3}), ("1-3,6", {1, 2, 3, 6})])
def test_a_list_of_processors_is_read(computer: Computer, text: str, found: set[int]) -> None:
    computer.write("sys/devices/system/cpu/isolated", text)
    assert isolated_processors(computer.root) == found


@pytest.mark.parametrize(
    ("cpu", "isolated", "level"),
    [(-1, set(), Level.OK), (2, {2}, Level.OK), (2, set(), Level.WARN), (4, {4}, Level.FAIL)],
)
def test_a_loop_with_a_processor_of_its_own_wants_it_isolated(cpu: int, isolated: set[int], level: Level) -> None:
    assert examine_processor(cpu, isolated, present=4).level is level


def test_limits_are_read_of_a_process_and_of_the_unit(computer: Computer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    computer.write("proc/77/limits", LIMITS)
    computer.write("proc/self/limits", LIMITS.replace("49 ", "0  ").replace("unlimited", "8388608  "))
    assert host_facts.process_limits(computer.root, 77) == Limits(49, inf, "of the daemon")
    assert host_facts.process_limits(computer.root, None) == Limits(0, 8388608, "of this shell")
    assert host_facts.process_limits(computer.root, 78) is None
    assert host_facts.unit_limits(computer.root) is None
    computer.write(host_facts.UNIT, "[Service]\nLimitRTPRIO=49\nLimitMEMLOCK=infinity")
    assert host_facts.unit_limits(computer.root) == GOOD_LIMITS
    computer.write(f"{host_facts.UNIT}.d/override.conf", "[Service]\nLimitRTPRIO=20")
    assert host_facts.unit_limits(computer.root) == Limits(20, inf, "in the unit")


def test_the_installed_unit_s_limits_suffice_for_the_example_configuration(tmp_path: Path) -> None:
    unit = ROOT / "systemd/mudskipper.service"
    (tmp_path / host_facts.UNIT).parent.mkdir(parents=True)
    (tmp_path / host_facts.UNIT).write_text(unit.read_text(encoding="utf-8"), encoding="utf-8")
    found = examine_limits(LoopParameters(), host_facts.unit_limits(tmp_path))
    assert [finding.level for finding in found] == [Level.OK, Level.OK]


def test_a_limit_below_the_loop_s_priority_fails_and_a_small_memlock_warns() -> None:
    realtime, memory = examine_limits(LoopParameters(), Limits(44, 8e6, "of this shell"))
    assert (realtime.level, memory.level) == (Level.FAIL, Level.WARN)
    assert "not permitted" in realtime.text
    assert not list(examine_limits(LoopParameters(priority=0, lock_memory=False), Limits(0, 0, "")))


def test_where_a_service_is_installed_the_shell_s_limits_are_lines_apart_and_never_fail() -> None:
    found = {finding.id: finding for finding in examine_shell(LoopParameters(), Limits(0, 8e6, "of this shell"))}
    assert {identity: finding.level for identity, finding in found.items()} == {
        "shell.realtime": Level.WARN,
        "shell.memlock": Level.WARN,
    }
    assert all("start by hand" in finding.text for finding in found.values())


def test_a_running_loop_that_did_not_get_its_priority_fails() -> None:
    assert [examine_priority(45, has).level for has in (45, 0)] == [Level.OK, Level.FAIL]


def test_the_priority_of_a_thread_is_read_after_any_thread_name(computer: Computer) -> None:
    computer.thread(90, "odd) S 1 (", 37)
    assert thread_priority(computer.root, 90) == 37
    assert thread_priority(computer.root, 91) == 0


def test_this_process_s_own_priority_is_that_of_the_system() -> None:
    assert thread_priority(Path("/"), os.getpid()) == os.sched_getparam(0).sched_priority


def test_threads_that_carry_frames_are_found_among_the_others(computer: Computer) -> None:
    for pid, name in ((60, "irq/60-spi0.0"), (61, "irq/61-xhci_hcd"), (62, "irq/9-acpi"), (63, "candump")):
        computer.thread(pid, name, 50)
    assert [thread.name for thread in can_interrupts(computer.root)] == [
        "irq/55-can0",
        "irq/60-spi0.0",
        "irq/61-xhci_hcd",
    ]


def test_a_loop_above_its_interrupts_is_warned_of_with_the_bound() -> None:
    threads = [Thread("irq/55-can0", 50), Thread("irq/56-can1", 45)]
    assert [examine_interrupts(priority, threads).level for priority in (44, 45, 60)] == [
        Level.OK,
        Level.WARN,
        Level.WARN,
    ]
    assert "less than 45" in examine_interrupts(60, threads).fix


MOUNTS = """\
/dev/sda1 / ext4 rw,relatime 0 0
tmpfs /run tmpfs rw,nosuid 0 0
/dev/sdb1 /var/lib/my\\040logs vfat rw 0 0
/dev/sdc1 /mnt ext4 ro,relatime 0 0
"""


@pytest.mark.parametrize(
    ("folder", "mount"),
    [
        ("/var/lib/mudskipper/logs", Mount("/", "ext4", False)),
        ("/run/logs", Mount("/run", "tmpfs", False)),
        ("/runner", Mount("/", "ext4", False)),
        ("/var/lib/my logs/a", Mount("/var/lib/my logs", "vfat", False)),
        ("/mnt/x", Mount("/mnt", "ext4", True)),
    ],
)
def test_the_file_system_of_a_folder_is_that_of_the_longest_mount(
    computer: Computer, folder: str, mount: Mount
) -> None:
    computer.write("proc/self/mounts", MOUNTS)
    assert mount_of(computer.root, Path(folder)) == mount


@pytest.mark.parametrize(
    ("folder", "level"),
    [("/var/x", Level.OK), ("/run/x", Level.WARN), ("/var/lib/my logs", Level.WARN), ("/mnt/x", Level.FAIL)],
)
def test_the_folder_of_logs_is_evaluated(computer: Computer, folder: str, level: Level) -> None:
    computer.write("proc/self/mounts", MOUNTS)
    assert storage(computer, folder)["file_system"].level is level


def storage(computer: Computer, folder: str, daemon_runs: bool = False) -> dict[str, Finding]:
    writer = Account("you", os.geteuid(), frozenset({os.getegid()}))
    found = examine_storage(computer.root, LogParameters(folder, min_free_fraction=0.0), writer, daemon_runs)
    return {finding.id: finding for finding in found}


def test_logs_that_were_cut_off_are_reported_if_no_daemon_is_writing_them(computer: Computer) -> None:
    computer.write(f"logs/{ACTIVE}/20260101T000000.000000Z-robot-0000.mcap", "")
    assert storage(computer, "/logs")["unfinished_logs"].level is Level.WARN
    assert "unfinished_logs" not in storage(computer, "/logs", daemon_runs=True)
    assert storage(computer, "/elsewhere")["unfinished_logs"].level is Level.OK


@pytest.mark.parametrize(
    ("space", "level", "text"),
    [
        (FREE, Level.OK, "10.0 GB free, 50 %: 28 h of walking"),
        (FreeSpace(0.05, 10**9), Level.WARN, "log.min_free_fraction"),
        (FreeSpace(0.0, 0), Level.FAIL, "0 min"),
        (FreeSpace(0.99, 3_000_000), Level.FAIL, "3.0 MB free, 99 %: 0 min of walking"),  # a small disk in memory
        (FreeSpace(0.99, round(WALK_BYTES_PER_MIN * LEAST_MIN) - 1), Level.FAIL, ""),
        (FreeSpace(0.99, round(WALK_BYTES_PER_MIN * LEAST_MIN)), Level.WARN, "2 min"),
        (FreeSpace(0.99, round(WALK_BYTES_PER_MIN * ENOUGH_MIN) - 1), Level.WARN, "60 min"),
        (FreeSpace(0.99, round(WALK_BYTES_PER_MIN * ENOUGH_MIN)), Level.OK, "60 min"),
    ],
)
def test_a_disk_is_evaluated_by_the_walking_time_that_it_has_room_for(
    space: FreeSpace, level: Level, text: str
) -> None:
    found = examine_space(space, 0.1)
    assert found.level is level and text in found.text


def test_the_length_of_a_log_that_a_disk_has_room_for_is_that_of_a_walk() -> None:
    walk = read_log(ROOT / "tests/fixtures/walk_0_1.mcap")
    minutes = (walk.ticks["stamp_s"][-1] - walk.ticks["stamp_s"][0]) / 60.0
    assert 0.8 < (ROOT / "tests/fixtures/walk_0_1.mcap").stat().st_size / minutes / WALK_BYTES_PER_MIN <= 1.0


@pytest.mark.parametrize("mode", [0o700, 0o070, 0o007, 0o770, 0o000, 0o755])
@pytest.mark.parametrize(
    ("uid", "group", "bit"), [(10, 20, 0o200), (11, 20, 0o020), (11, 21, 0o002), (10, 21, 0o200), (0, 0, 0)]
)
def test_write_permission_is_that_of_the_kernel(mode: int, uid: int, group: int, bit: int) -> None:
    status = os.stat_result((mode, 0, 0, 0, 10, 20, 0, 0, 0, 0))
    assert may_write(status, Account("x", uid, frozenset({group}))) is (uid == 0 or bool(mode & bit))


def test_a_folder_that_the_daemon_s_user_cannot_write_fails_with_who_should_own_it(tmp_path: Path) -> None:
    tmp_path.chmod(0o700)
    other_user = Account("mudskipper", os.geteuid() + 4242, frozenset())
    found = examine_folder(tmp_path / "logs" / "deeper", other_user)
    assert found.level is Level.FAIL
    assert found.fix.startswith(f"'install -d -o {other_user.uid} {tmp_path / 'logs' / 'deeper'}'")


def test_the_service_s_own_folder_is_made_at_its_start_and_no_other(tmp_path: Path) -> None:
    (tmp_path / "var/lib").mkdir(parents=True)
    service, you = (Account(name, os.geteuid() + 4242, frozenset()) for name in ("mudskipper", "you"))
    logs = tmp_path / "var/lib/mudskipper/logs"
    assert examine_folder(logs, service).level is Level.OK
    assert examine_folder(logs, you).level is Level.FAIL
    assert examine_folder(tmp_path / "var/lib/elsewhere", service).level is Level.FAIL
    logs.mkdir(parents=True)
    assert examine_folder(logs, service).level is Level.FAIL


def test_a_clock_that_was_never_set_fails_and_one_that_is_not_synchronised_warns() -> None:
    today, never = datetime(2026, 5, 1, tzinfo=UTC), datetime(1970, 1, 2, tzinfo=UTC)
    assert examine_clock(today, True, True).level is Level.OK
    assert examine_clock(today, False, True).level is Level.WARN
    assert examine_clock(today, True, False).level is Level.WARN
    assert examine_clock(never, True, True).level is Level.FAIL


def test_asking_the_clock_changes_nothing_and_answers() -> None:
    assert host_facts.clock_is_synchronised() in (True, False)


def test_another_owner_of_control_and_an_old_python_fail() -> None:
    ours = {"control": ["mudskipper"]}
    assert [f.level for f in examine_python((3, 11, 2), ours)] == [Level.OK, Level.OK]
    assert [f.level for f in examine_python((3, 10, 9), ours)] == [Level.FAIL, Level.OK]
    _, packages = examine_python((3, 12, 0), {"control": ["mudskipper", "control"]})
    assert packages.level is Level.FAIL
    assert "control of control" in packages.text
