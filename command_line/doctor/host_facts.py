"""Reads properties of the computer from /proc and /sys, below a root that a test may replace.

A file that cannot be read counts as empty; host_checks.py evaluates the values. The layouts are those of proc(5) and
proc_pid_stat(5). Threaded interrupts are kernel threads named irq/NUMBER-DEVICE.
"""

import ctypes
import os
import re
import struct
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import NamedTuple

from firmware_host.configuration.service_file import unit_text

TIME_ERROR = 5  # adjtimex(2): the clock is not synchronised
REFUSED = -1
TIMEX_BYTES = 256  # struct timex has 208
CAN_INTERRUPT = re.compile(r"irq/\d+-.*(can|mcp25|spi|xhci|dwc|ehci)", re.IGNORECASE)  # SPI and USB carry adapters
RT_PRIORITY = 40 - 3  # field of /proc/PID/stat, counted after the name in brackets
LIMIT_LINES = ("Max realtime priority", "Max locked memory")  # in /proc/PID/limits
UNITS = " KMGTPE"  # of a limit: powers of 1024


class Limits(NamedTuple):
    """The resource limits of a process; infinite where unlimited."""

    rtprio: float
    memlock_bytes: float
    whose: str  # "of the daemon", for messages


class Thread(NamedTuple):
    name: str
    priority: int  # under SCHED_FIFO or SCHED_RR; 0 under another policy


class Mount(NamedTuple):
    point: str
    kind: str  # of file system
    read_only: bool


def read_text(path: Path) -> str:
    """Return the text of a file, empty where it cannot be read."""
    with suppress(OSError):
        return path.read_text(encoding="utf-8", errors="replace").strip()
    return ""


def process_limits(root: Path, pid: int | None) -> Limits | None:
    """Return the limits of a process, or of this one; root may exceed them."""
    if pid is None and os.geteuid() == 0:
        return Limits(inf, inf, "for root")
    text = read_text(root / "proc" / str(pid or "self") / "limits")
    rtprio, memlock = (re.search(rf"^{name} +(\S+)", text, re.MULTILINE) for name in LIMIT_LINES)
    if not rtprio or not memlock:
        return None
    return Limits(_limit(rtprio[1]), _limit(memlock[1]), "of the daemon" if pid else "of this shell")


def unit_limits(root: Path) -> Limits | None:
    """Return the limits that the installed service, with its drop-ins, gives its daemon."""
    settings = dict(re.findall(r"^(Limit\w+)=(\S+)$", unit_text(root), re.MULTILINE))
    if not settings:
        return None
    return Limits(_limit(settings.get("LimitRTPRIO", "0")), _limit(settings.get("LimitMEMLOCK", "0")), "in the unit")


def _limit(text: str) -> float:
    """Return a limit as /proc states it, or the soft one of a unit, such as 4G:8G."""
    text = text.partition(":")[0]
    if text in ("unlimited", "infinity"):
        return inf
    number = re.fullmatch(f"([0-9]+)([{UNITS}]?)", text)
    return float(number[1]) * 1024.0 ** UNITS.find(number[2]) if number else 0.0


def deepest_sleep_us(root: Path) -> int:
    """Return the longest time that the first processor's sleep states take to leave."""
    texts = [read_text(path) for path in (root / "sys/devices/system/cpu/cpu0/cpuidle").glob("state*/latency")]
    return max((int(text) for text in texts if text.isdigit()), default=0)


def wake_limit_us(root: Path) -> int | None:
    """Return the time that processors may take to wake, by all programs' requests; None where it is not readable."""
    with suppress(OSError, struct.error):
        limit_us: int = struct.unpack("=i", (root / "dev/cpu_dma_latency").read_bytes()[:4])[0]
        return limit_us
    return None


def isolated_processors(root: Path) -> set[int]:
    """Return the numbers in a list such as 2-3,5."""
    found: set[int] = set()
    for first, last in re.findall(r"(\d+)(?:-(\d+))?", read_text(root / "sys/devices/system/cpu/isolated")):
        found.update(range(int(first), int(last or first) + 1))
    return found


def can_interrupts(root: Path) -> list[Thread]:
    """Return the threads that receive frames: those of CAN controllers, and of the SPI and USB that carry them."""
    names = {int(folder.name): read_text(folder / "comm") for folder in (root / "proc").glob("[0-9]*")}
    return sorted(Thread(name, thread_priority(root, pid)) for pid, name in names.items() if CAN_INTERRUPT.match(name))


def thread_priority(root: Path, pid: int) -> int:
    fields = read_text(root / "proc" / str(pid) / "stat").rpartition(")")[2].split()
    return int(fields[RT_PRIORITY]) if len(fields) > RT_PRIORITY else 0


def mount_of(root: Path, folder: Path) -> Mount | None:
    """Return the file system that a folder is on, or will be on."""
    best: Mount | None = None
    for line in read_text(root / "proc/self/mounts").splitlines():
        fields = line.split()
        if len(fields) < 4:
            continue
        point = fields[1].replace("\\040", " ")
        if folder.absolute().is_relative_to(point) and (best is None or len(point) >= len(best.point)):
            best = Mount(point, fields[2], "ro" in fields[3].split(","))
    return best


def has_clock_chip(root: Path) -> bool:
    return any((root / "sys/class/rtc").glob("rtc*"))


def clock_is_synchronised() -> bool:
    """Read the state of the clock from the kernel, and change nothing."""
    state: int = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))
    return state not in (TIME_ERROR, REFUSED)
