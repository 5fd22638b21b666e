"""The resources of a process, as the kernel counts them: resident memory, descriptors, threads, children."""

import os
import resource
from pathlib import Path

PAGE_KIB = os.sysconf("SC_PAGE_SIZE") / 1024.0


def resident_kib(process: int | str = "self") -> float:
    return PAGE_KIB * int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])


def peak_kib() -> float:
    """Return the largest resident memory that this process ever had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def descriptors(process: int | str = "self") -> int:
    return len(os.listdir(f"/proc/{process}/fd"))


def threads() -> int:
    return len(os.listdir("/proc/self/task"))


def children_of(parent: int) -> list[int]:
    text = Path(f"/proc/{parent}/task/{parent}/children").read_text(encoding="ascii")
    return [int(number) for number in text.split()]
