"""Bounds how far a compressed log may expand.

Logs of walks expand by 1.6 to 3, the authors' CSV files by 8 to 12, and rows that are all zero by 28 with LZ4. A file
that expands much further was made to fill the memory or the time of its reader.
"""

from pathlib import Path

from logs.files.log_error import LogError

LARGEST_CHUNK_BYTES = 8 * 1024 * 1024  # twice the chunks of the `mcap` tool; this project's have 64 kB
MOST_TIMES = 32  # the file's own size, for all of it; in addition to one chunk, so that a short file may be all zeros


class Expansion:
    """Owns the size of what was decompressed from one file so far."""

    def __init__(self, path: Path, stored_bytes: int) -> None:
        self._path, self._stored = path, stored_bytes
        self._most = LARGEST_CHUNK_BYTES + MOST_TIMES * stored_bytes
        self._expanded = 0

    def add(self, size: int) -> None:
        """Count decompressed bytes. Raises LogError beyond the bound."""
        self._expanded += size
        if self._expanded > self._most:
            bound = f"more than {self._most} bytes, {MOST_TIMES} times its size and {LARGEST_CHUNK_BYTES} more"
            raise LogError(f"{self._path}: its {self._stored} bytes expand to {bound}: no log does")
