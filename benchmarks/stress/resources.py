"""The resources of a process, as the kernel counts them: resident memory, descriptors, threads, children."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

PAGE_KIB = os.sysconf("SC_PAGE_SIZE") / 1024.0


class Holding(NamedTuple):
    resident_kib: float
    descriptors: int
    threads: int


def resident_kib(process: int | str = "self") -> float:
    return PAGE_KIB * int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])


def holding(process: int | str = "self") -> Holding:
    folder = Path(f"/proc/{process}")
    return Holding(resident_kib(process), len(os.listdir(folder / "fd")), len(os.listdir(folder / "task")))


def children_of(parent: int) -> list[int]:
    text = Path(f"/proc/{parent}/task/{parent}/children").read_text(encoding="ascii")
    return [int(number) for number in text.split()]
