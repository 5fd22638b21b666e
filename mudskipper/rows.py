"""Rows of a log as a numpy array that pandas understands."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmware_host.log.schema import RowKind
from logs.flat_columns import flat_columns


class Rows(np.ndarray[Any, np.dtype[np.void]]):
    """A structured array: `rows["stamp_s"]` is the plain column of that field, `rows[10:20]` are rows again."""

    kind: RowKind
    wall_offset_ns: int | None = None

    @classmethod
    def of(cls, rows: NDArray[np.void], kind: RowKind, wall_offset_ns: int | None = None) -> Rows:
        viewed = rows.view(cls)
        viewed.kind, viewed.wall_offset_ns = kind, wall_offset_ns
        return viewed

    def __array_finalize__(self, parent: Any) -> None:
        self.wall_offset_ns = getattr(parent, "wall_offset_ns", None)
        self.kind = getattr(parent, "kind", None)  # type: ignore[assignment]  # only `of` makes rows of no rows

    def __reduce__(self) -> Any:
        """Rows that come from another process know their kind."""
        return Rows.of, (self.view(np.ndarray), self.kind, self.wall_offset_ns)

    def __getitem__(self, wanted: Any) -> Any:
        found = super().__getitem__(wanted)
        return found.view(np.ndarray) if isinstance(found, Rows) and found.dtype.names is None else found

    def to_pandas(self) -> Any:
        """Return a DataFrame with one column per joint or flipper, enumerations as categories.

        Its index is `time`, in universal time; rows that do not know the wall clock are numbered.

        `frame.attrs["units"]` has the unit of each column. Needs pandas: install mudskipper with its extra `data`.
        """
        import pandas as pd

        columns = flat_columns(self.view(np.ndarray), self.kind, self.wall_offset_ns)
        cells = {
            column.name: pd.Categorical.from_codes(*column.coded()) if column.words else column.values
            for column in columns
        }
        frame = pd.DataFrame(cells, copy=True)
        if "time" in frame:
            frame = frame.set_index(frame.pop("time").dt.tz_localize("UTC"))
        frame.attrs["units"] = {column.name: column.unit for column in columns if column.unit}
        return frame
