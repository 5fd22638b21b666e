"""The resources of a process, as the kernel counts them: resident memory, descriptors, threads, children."""

import os
from pathlib import Path

PAGE_KIB = os.sysconf("SC_PAGE_SIZE") / 1024.0


def resident_kib(process: int | str = "self") -> float:
    return PAGE_KIB * int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])


def descriptors(process: int | str = "self") -> int:
    return len(os.listdir(f"/proc/{process}/fd"))


def threads() -> int:
    return len(os.listdir("/proc/self/task"))


def children_of(parent: int) -> list[int]:
    text = Path(f"/proc/{parent}/task/{parent}/children").read_text(encoding="ascii")
    return [int(number) for number in text.split()]
