"""Checks whether the computer suits the robot: one finding for each property, with its fix.

A finding fails only where the robot would not work or its torque would be unsupervised. A property that makes ticks
late or loses logs is a warning.
"""

import os
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from datetime import datetime
from importlib.metadata import packages_distributions
from math import inf
from pathlib import Path
from stat import S_IWGRP, S_IWOTH, S_IWUSR
from typing import NamedTuple

from command_line.doctor.findings import Finding, Level, fail, ok, ok_if, warn
from command_line.doctor.host_facts import (
    Limits,
    Mount,
    Thread,
    can_interrupts,
    deepest_sleep_us,
    isolated_processors,
    mount_of,
    read_text,
    wake_limit_us,
)
from command_line.robot_text import quota_text
from experiments.reports.counted_nouns import counted
from firmware_host.configuration.configuration import LoopParameters
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.log.log_folder import FreeSpace, copies_text, free_space, unfinished_files
from logs.files.stored_logs import size_text

ENOUGH_MEMLOCK_BYTES = 2**30  # the loop's process maps less memory
WALK_BYTES_PER_MIN = 6e6  # of a log, measured: 5.3 to 5.6 MB in a minute with torque
LEAST_MIN, ENOUGH_MIN = 2.0, 60.0  # of walking that the disk should have room for
SHELL_LIMITS = "for a shell: /etc/security/limits.d"
OLDEST_PYTHON = (3, 11)
EARLIEST_YEAR = 2024  # a clock before that was never set
VOLATILE = frozenset({"tmpfs", "ramfs", "overlay"})  # in memory, or likely so: lost at power-off
UNSAFE = frozenset({"vfat", "exfat", "msdos", "nfs", "nfs4", "cifs"})  # without a journal; so are fuseblk, fuse.sshfs
OURS = "mudskipper"  # name of the service, its user, its group and this distribution
REALTIME = "realtime"
STATE_FOLDER = ("var", "lib", OURS)  # StateDirectory= of the unit


class Account(NamedTuple):
    """The user that will write the logs."""

    name: str
    uid: int
    groups: frozenset[int]


def this_account() -> Account:
    return Account("you", os.geteuid(), frozenset({os.getegid(), *os.getgroups()}))


def examine_host(root: Path, loop: LoopParameters, limits: Limits | None, priority: int | None) -> Iterator[Finding]:
    """`priority` is that of the running loop, None where no daemon runs."""
    yield _examine_kernel(root)
    if priority is None:
        yield from examine_limits(loop, limits)
    else:  # what the running loop has counts, not what a limit would permit
        yield from (each for each in examine_limits(loop, limits) if each.id != REALTIME)
        yield examine_priority(loop.priority, priority)
    yield _examine_governor(root)
    yield _examine_sleep(root, loop.stay_awake)
    present = len(list((root / "sys/devices/system/cpu").glob("cpu[0-9]*")))
    yield examine_processor(loop.cpu, isolated_processors(root), present)
    yield examine_interrupts(priority or loop.priority, can_interrupts(root))


def _examine_kernel(root: Path) -> Finding:
    release, version = (read_text(root / "proc/sys/kernel" / name) for name in ("osrelease", "version"))
    realtime = read_text(root / "sys/kernel/realtime") == "1" or "PREEMPT_RT" in version.replace(" RT", "_RT")
    release = release or "unknown"
    text = f"{release}, real-time" if realtime else f"{release} is no real-time kernel: ticks may be late"
    fix = "a kernel with PREEMPT_RT, such as Debian's linux-image-rt-amd64 or -arm64"
    return ok_if(realtime, "kernel", text, fix)


def examine_limits(loop: LoopParameters, limits: Limits | None) -> Iterator[Finding]:
    if limits is None:
        yield warn("limits", "the limits of processes cannot be read", "look into /proc/self/limits")
        return
    if loop.priority:
        enough = limits.rtprio >= loop.priority
        permitted = "permitted" if enough else "not permitted: the loop may be late"
        text = f"real-time priority {loop.priority} is {permitted} (limit {_limit_text(limits.rtprio)} {limits.whose})"
        fix = f"raise the rtprio limit (LimitRTPRIO= in the unit; {SHELL_LIMITS})"
        yield ok_if(enough, REALTIME, text, fix, Level.FAIL)
    if loop.lock_memory:
        text = f"{_limit_text(limits.memlock_bytes)} bytes may be locked in memory ({limits.whose})"
        fix = f"raise the memlock limit (LimitMEMLOCK=infinity in the unit; {SHELL_LIMITS})"
        yield ok_if(limits.memlock_bytes >= ENOUGH_MEMLOCK_BYTES, "memlock", text, fix)


def examine_shell(loop: LoopParameters, limits: Limits | None) -> Iterator[Finding]:
    """Check the limits of a daemon that is started by hand, where a service is installed: none of them fails."""
    for finding in examine_limits(loop, limits):
        text = f"{finding.text}; it counts only for a daemon that you start by hand"
        yield ok_if(finding.level is Level.OK, f"shell.{finding.id}", text, finding.fix)


def _limit_text(value: float) -> str:
    return "unlimited" if value == inf else f"{value:.0f}"


def examine_priority(wanted: int, actual: int) -> Finding:
    text = f"the running loop has real-time priority {actual}" + (f" instead of {wanted}" if actual < wanted else "")
    fix = "raise the rtprio limit, then restart the daemon"
    return ok_if(actual >= wanted, "loop.priority", text, fix, Level.FAIL)


def _examine_governor(root: Path) -> Finding:
    paths = (root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
    names = {read_text(path) for path in paths} - {""}
    if not names:
        return ok("governor", "the processors' clock is not scaled by this kernel")
    text, fast = ", ".join(sorted(names)), names == {"performance"}
    fix = "'cpupower frequency-set --governor performance', or cpufreq.default_governor=performance for the kernel"
    return ok_if(fast, "governor", text if fast else f"{text}: the loop wakes late where the clock is slow", fix)


def _examine_sleep(root: Path, stay_awake: bool) -> Finding:
    """Check whether the processors sleep between two ticks, and whether the daemon may forbid it."""
    deepest_us = deepest_sleep_us(root)
    if deepest_us == 0:
        return ok("sleep", "the processors have no sleep state that takes time to leave")
    text = f"a processor that sleeps takes up to {deepest_us} µs to wake"
    if not stay_awake:
        return warn("sleep", f"{text}: ticks come late", "set loop.stay_awake = true")
    limit_us = wake_limit_us(root)
    if limit_us is None:
        return warn("sleep", f"{text}; whether the daemon may forbid it is not readable", "run this with sudo")
    if limit_us == 0:
        return ok("sleep", "all processors are kept awake now, which costs power")
    return ok("sleep", f"{text}; the daemon keeps all of them awake while torque is on, which costs power")


def examine_processor(cpu: int, isolated: set[int], present: int) -> Finding:
    isolation = f"isolated: {', '.join(map(str, sorted(isolated))) or 'none'}"
    if cpu < 0:
        return ok("processors", f"{present}, the loop runs on any; {isolation}")
    if cpu >= present > 0:
        return fail("processors", f"loop.cpu = {cpu}, but there are {present}", "correct loop.cpu")
    text = f"the loop has {cpu} for itself" if cpu in isolated else f"the loop shares {cpu} with everything"
    return ok_if(cpu in isolated, "processors", f"{text}; {isolation}", f"isolcpus={cpu} for the kernel")


def examine_interrupts(priority: int, threads: list[Thread]) -> Finding:
    """Compare the loop's priority with the threads that receive its frames: above them it would wait in vain."""
    if not threads:
        return ok("interrupts", "no interrupt thread of a CAN adapter")
    text = ", ".join(f"{thread.name} {thread.priority}" for thread in threads)
    if all(thread.priority > priority for thread in threads):
        return ok("interrupts", f"the loop's {priority} is below {text}")
    lowest = min(thread.priority for thread in threads)
    fix = f"set loop.priority to less than {lowest}, or raise those with chrt"
    return warn("interrupts", f"the loop's {priority} is not below all of {text}", fix)


def examine_storage(root: Path, log: LogParameters, writer: Account, daemon_runs: bool) -> Iterator[Finding]:
    """Check the folder of the logs."""
    if not log.enabled:
        yield warn("log", "no log is written", "set log.enabled = true")
        return
    folder = Path(log.directory)
    mount = mount_of(root, folder)
    if mount is not None:
        yield examine_mount(mount)
    below_root = root / folder.absolute().relative_to("/")
    yield log_space(log, root)
    yield examine_folder(below_root, writer)
    yield ok("quota", f"{quota_text(log.quota_bytes, log.min_free_fraction)}; {copies_text(below_root)}")
    if not daemon_runs:
        yield examine_unfinished(below_root)


def examine_mount(mount: Mount) -> Finding:
    text = f"{mount.point} is {mount.kind}"
    if mount.read_only:
        fix = f"'mount -o remount,rw {mount.point}'; look for errors of the disk"
        return fail("file_system", f"{text}, read-only", fix)
    if mount.kind in VOLATILE:
        return warn("file_system", f"{text}: logs may be gone after power-off", "set log.directory to a disk")
    if mount.kind in UNSAFE or mount.kind.startswith("fuse"):
        return warn("file_system", f"{text}: it may lose whole logs in a power cut", "use ext4, xfs, btrfs or f2fs")
    return ok("file_system", text)


def examine_space(space: FreeSpace, least_fraction: float) -> Finding:
    """Evaluates the time that a walk can be logged, and the fraction below which old logs are deleted."""
    minutes = space.free_bytes / WALK_BYTES_PER_MIN
    time = f"{minutes:.0f} min" if minutes < 120.0 else f"{minutes / 60.0:.0f} h"
    text = f"{size_text(space.free_bytes)} free, {100.0 * space.free_fraction:.0f} %: {time} of walking"
    if minutes >= LEAST_MIN and space.free_fraction < least_fraction:
        fix = "free some of it, or lower log.min_free_fraction"
        return warn("disk", f"{text}; less than log.min_free_fraction is free, so old logs are deleted", fix)
    level = Level.FAIL if minutes < LEAST_MIN else Level.WARN
    fix = "free some of it, or set log.directory to another disk"
    return ok_if(minutes >= ENOUGH_MIN, "disk", text, fix, level)


def log_space(log: LogParameters, root: Path = Path("/")) -> Finding:
    """Check the free space for the logs."""
    folder = Path(log.directory).absolute()
    try:
        return examine_space(free_space(root / folder.relative_to("/")), log.min_free_fraction)
    except OSError as problem:
        return fail("disk", f"{folder}: {problem.strerror}", "mount it")


def examine_folder(folder: Path, writer: Account) -> Finding:
    """Check the folder, or its nearest parent that exists: the daemon makes the missing ones."""
    nearest = folder
    try:
        while not nearest.exists():
            nearest = nearest.parent
        writable = may_write(nearest.stat(), writer)
    except PermissionError:
        return warn("log", f"{folder} cannot be read", "run this with sudo")
    if writer.name == OURS and not writable and nearest == folder_of_systemd(folder):
        return ok("log", f"{folder}: made when the service starts")
    text = f"{folder}: {'' if writable else 'not '}writable for {writer.name}"
    fix = f"'install -d -o {writer.uid} {folder}', or change log.directory"
    return ok_if(writable, "log", text, fix, Level.FAIL)


def folder_of_systemd(folder: Path) -> Path | None:
    """Return the folder in which systemd will make the service's StateDirectory, if the log folder is in that."""
    return next((path.parent for path in (folder, *folder.parents) if path.parts[-3:] == STATE_FOLDER), None)


def may_write(status: os.stat_result, writer: Account) -> bool:
    if writer.uid == 0:
        return True
    if status.st_uid == writer.uid:
        return bool(status.st_mode & S_IWUSR)
    return bool(status.st_mode & (S_IWGRP if status.st_gid in writer.groups else S_IWOTH))


def examine_unfinished(folder: Path) -> Finding:
    unfinished = 0
    with suppress(OSError):
        unfinished = len(unfinished_files(folder))
    text = f"{counted(unfinished, 'log')} cut off, such as by a power cut" if unfinished else "none"
    return ok_if(not unfinished, "unfinished_logs", text, "'mudskipper log recover'; the daemon does it at its start")


def examine_clock(now: datetime, synchronised: bool, chip: bool) -> Finding:
    """Check the wall clock: it names the logs, and the quota deletes the oldest names first."""
    fix = "'timedatectl set-ntp true', or set it yourself with 'date --set'"
    if now.year < EARLIEST_YEAR:
        return fail("clock", f"it shows {now:%Y-%m-%d}: it was never set", fix)
    text = f"{now:%Y-%m-%d %H:%M} UTC, {'synchronised' if synchronised else 'not synchronised'}"
    if not chip:
        text, fix = f"{text}, and no clock chip keeps it without power", "fit one, or wait for the network before a run"
    return ok_if(synchronised and chip, "clock", text, fix)


def examine_python(version: tuple[int, ...], owners: Mapping[str, Collection[str]]) -> Iterator[Finding]:
    """Check the interpreter and our import names; `owners` are the distributions of each top-level package."""
    recent, text = version[:2] >= OLDEST_PYTHON, ".".join(map(str, version[:3]))
    fix = "install Python 3.11 or newer"
    yield ok_if(recent, "python", text if recent else f"{text} is too old", fix, Level.FAIL)
    found = [f"{name} of {', '.join({*each} - {OURS})}" for name, each in owners.items() if {*each} > {OURS}]
    text = f"{'; '.join(found) or 'no other software'} has packages of the same name"
    fix = "give the daemon an environment of its own: docs/how-to/install.md"
    yield ok_if(not found, "packages", text, fix, Level.FAIL)


def examine_this_python() -> Iterator[Finding]:
    yield from examine_python(tuple(sys.version_info[:3]), packages_distributions())
