"""The ticks of a log as numpy arrays with one field for each field of the tick row, in the order of their numbers.

Ticks that were held back at rest follow later ones in the file (rest_thinning). The first pass over a log measures how
far back the farthest of them belongs, so a later pass only holds as many ticks as that and passes on the others.
"""

from collections.abc import Iterable, Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from firmware_host.log.rows import TICK, rig_of, tick_kind
from firmware_host.log.schema import FORMAT_OF, RowKind

Ticks: TypeAlias = NDArray[np.void]

BLOCK_ROWS = 4096  # at least, except in the last block: 1.8 megabytes


def tick_type(kind: RowKind = TICK) -> np.dtype[np.void]:
    """The numpy type of a stored tick, its encapsulation included."""
    formats = [np.dtype((f"<{FORMAT_OF[f.kind]}", (f.length,) if f.length else ())) for f in kind.numbers]
    names = [field.name for field in kind.numbers]
    return np.dtype({"names": names, "formats": formats, "offsets": kind.offsets, "itemsize": kind.layout.size})


def divide_ticks(kind: RowKind, stored: NDArray[np.void]) -> Ticks:
    """Return whole rows with their fields.

    Rows of this version keep their bytes. Those of another version are copied: into all fields of this version, then
    those that this version does not know.
    """
    ticks = np.ascontiguousarray(stored).view(tick_type(kind))
    own = tick_kind(rig_of(kind.metadata))
    return ticks if ticks.dtype == tick_type(own) else _with_own_fields(ticks, own)


def _with_own_fields(ticks: Ticks, own: RowKind) -> Ticks:
    types, names = tick_type(own), ticks.dtype.names or ()
    unknown = [(name, ticks.dtype[name]) for name in names if name not in (types.names or ())]
    full = np.empty(len(ticks), [*((field.name, types[field.name]) for field in own.fields), *unknown])
    missing = {field.name: field.missing for field in own.fields}
    for name in full.dtype.names or ():
        full[name] = ticks[name] if name in names else missing[name]
    return full


def whole_rows(ticks: Ticks) -> NDArray[np.void]:
    """Return the rows without a division into fields, so that joining and sorting keep the bytes between fields."""
    return ticks if ticks.dtype.names is None else ticks.view(np.dtype((np.void, ticks.dtype.itemsize)))


def sort_ticks(ticks: Ticks) -> Ticks:
    """Sort by the tick's number; ticks of one number keep their order."""
    if np.all(ticks["tick"][1:] >= ticks["tick"][:-1]):
        return ticks
    return whole_rows(ticks)[np.argsort(ticks["tick"], kind="stable")].view(ticks.dtype)


def join_ticks(pieces: list[Ticks]) -> Ticks:
    """Return the rows of at least one piece as one array."""
    return np.concatenate([whole_rows(piece) for piece in pieces]).view(pieces[0].dtype)


def in_groups(pieces: Iterable[Ticks], rows: int) -> Iterator[Ticks]:
    """Join pieces until they have so many rows together, or no more follow."""
    gathered: list[Ticks] = []
    for piece in pieces:
        gathered.append(piece)
        if sum(map(len, gathered)) >= rows:
            yield join_ticks(gathered)
            gathered = []
    if gathered:
        yield join_ticks(gathered)


def in_order(blocks: Iterable[Ticks], farthest: int) -> Iterator[Ticks]:
    """Sort blocks in which no tick follows one whose number is larger by more than `farthest`."""
    held: Ticks | None = None
    for block in blocks:
        held = sort_ticks(block if held is None or not len(held) else join_ticks([held, block]))
        ready = int(np.searchsorted(held["tick"], int(held["tick"][-1]) - farthest)) if farthest else len(held)
        if ready:
            yield held[:ready]
        held = held[ready:]
    if held is not None and len(held):
        yield held


class TickTally:
    """Counts ticks; owns the first and last by number, and how far at most a tick came after a larger number."""

    def __init__(self) -> None:
        self.rows = self.farthest = 0
        self.ends: Ticks | None = None

    def add(self, ticks: Ticks) -> None:
        """`ticks` are the next rows of the file, at least one."""
        numbers = ticks["tick"].astype(np.int64)
        largest = np.maximum(np.maximum.accumulate(numbers), self._largest)
        last = len(numbers) - 1 - int(np.argmax(numbers[::-1]))
        self.rows += len(ticks)
        self.farthest = max(self.farthest, int(np.max(largest - numbers)))
        self._extend(ticks[[int(np.argmin(numbers)), last]])

    def add_after(self, later: "TickTally") -> None:
        """Add the ticks of the next segment."""
        if later.ends is None:
            return
        self.rows += later.rows
        self.farthest = max(self.farthest, later.farthest, self._largest - int(later.ends["tick"][0]))
        self._extend(later.ends)

    @property
    def _largest(self) -> int:
        return -1 if self.ends is None else int(self.ends["tick"][-1])

    def _extend(self, ends: Ticks) -> None:
        self.ends = sort_ticks(ends if self.ends is None else join_ticks([self.ends, ends]))[[0, -1]]
