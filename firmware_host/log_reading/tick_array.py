"""The ticks of a log as one numpy array, with one field for each field of the tick row."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from firmware_host.log.rows import TICK, rig_of, tick_kind
from firmware_host.log.schema import FORMAT_OF, RowKind

Ticks: TypeAlias = NDArray[np.void]


def tick_type(kind: RowKind = TICK) -> np.dtype[np.void]:
    """The numpy type of a stored tick, its encapsulation included."""
    formats = [np.dtype((f"<{FORMAT_OF[f.kind]}", (f.length,) if f.length else ())) for f in kind.numbers]
    names = [field.name for field in kind.numbers]
    return np.dtype({"names": names, "formats": formats, "offsets": kind.offsets, "itemsize": kind.layout.size})


def stack_ticks(kind: RowKind, rows: list[bytes]) -> Ticks:
    """Returns the rows as an array, sorted by tick. Raises ValueError where a row does not fit its description.

    The array of a log of this version lies over the stored bytes. A log of another version is copied: into all fields
    of this version, then those that this version does not know.
    """
    for number, row in enumerate(rows, 1):
        if not kind.fits(row):
            raise ValueError(f"row {number} of {kind.topic} has {len(row)} bytes, not {kind.layout.size}")
    ticks = np.frombuffer(b"".join(row[: kind.layout.size] for row in rows), dtype=tick_type(kind))
    own = tick_kind(rig_of(kind.definition))
    return sort_ticks(ticks if tick_type(kind) == tick_type(own) else _with_own_fields(ticks, own))


def _with_own_fields(ticks: Ticks, own: RowKind) -> Ticks:
    types, names = tick_type(own), ticks.dtype.names or ()
    unknown = [(name, ticks.dtype[name]) for name in names if name not in (types.names or ())]
    full = np.empty(len(ticks), [*((field.name, types[field.name]) for field in own.fields), *unknown])
    missing = {field.name: field.missing for field in own.fields}
    for name in full.dtype.names or ():
        full[name] = ticks[name] if name in names else missing[name]
    return full


def sort_ticks(ticks: Ticks) -> Ticks:
    """Sorts by the tick's number: ticks that were held back at rest follow later ones in the file (rest_thinning)."""
    if np.all(ticks["tick"][1:] >= ticks["tick"][:-1]):
        return ticks
    whole_rows = ticks.view(np.dtype((np.void, ticks.dtype.itemsize)))  # with the bytes that no field names
    return whole_rows[np.argsort(ticks["tick"], kind="stable")].view(ticks.dtype)
