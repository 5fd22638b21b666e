"""The catalogue of all closed logs below a folder: a DuckDB table, stored as one Parquet file.

A log enters the catalogue when a user lists, queries or indexes the folder for the first time after the log was
closed, not when its writer closes it. So the writer on the robot loads no database, a log that was copied, recovered,
preserved or deleted by hand is noticed as well, and the catalogue can be removed at any time. A file's name, size and
time of change decide whether it has to be read again.

The results of campaigns below the folder are the table `trials`: they have the same columns and more.

The file is `catalogue.parquet` in the folder, or in the user's cache where the folder is not the user's own. This
module needs the extra `data`.
"""

import os
import re
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from hashlib import sha256
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import duckdb

from firmware_host.log.log_folder import ACTIVE, DONE, ENDING, PRESERVED, age_of
from logs.catalogue.entry import (
    COLUMNS,
    TRIALS,
    FileStamp,
    LogEntry,
    entry_of_row,
    row_of_entry,
    stamp_of,
    stamp_of_entry,
)
from logs.files.log_error import LogError, Watch
from logs.files.whole_files import hidden_path, is_hidden, whole_file

NAME = "catalogue.parquet"
VERSION = 4  # of COLUMNS and their meaning; an older catalogue is made again
VERSION_KEY = "mudskipper_catalogue"
MOST_DIGITS = 9  # of a version; one with more is damage
TRIALS_TABLE = "trials"
ERROR_NUMBER = re.compile(r'"errno":"(\d+)"')  # of the operating system, in DuckDB's message


class CatalogueError(LogError):
    """A catalogue or a query that cannot be used: the message is one sentence."""


class Answer(NamedTuple):
    """The answer to a query; a name that comes again has a number."""

    names: list[str]
    rows: list[tuple[Any, ...]]


def catalogue_path(folder: Path) -> Path:
    """Return the file in the user's own folder, or in the user's cache: root writes into no folder of the daemon."""
    if folder.stat().st_uid == os.geteuid() and os.access(folder, os.W_OK):
        return folder / NAME
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "mudskipper" / f"{sha256(str(folder.resolve()).encode()).hexdigest()[:16]}-{NAME}"


def closed_logs(folder: Path) -> list[Path]:
    """Return all logs below the folder whose writer is done, oldest first."""
    paths = (path for path in folder.rglob(f"*{ENDING}") if not is_hidden(path, folder))
    return sorted((path for path in paths if path.parent.name != ACTIVE), key=age_of)


class Catalogue:
    """Owns the table, and the file that stores it."""

    def __init__(self, folder: Path) -> None:
        """Raises CatalogueError for a catalogue of a newer version."""
        self._folder = folder
        self.path = catalogue_path(folder)
        self._trials = sorted(folder.rglob(TRIALS))
        self._connection = duckdb.connect()
        self._confine()
        self._connection.execute(f"CREATE TABLE logs ({', '.join(map(' '.join, COLUMNS.items()))})")
        if self.path.is_file():
            self._load()

    def _confine(self) -> None:
        """A query reaches no file but the catalogue and the results of campaigns, and no network."""
        own = [str(path) for path in (self.path, hidden_path(self.path), *self._trials)]
        self._connection.execute(f"SET allowed_paths = [{', '.join(map(_quoted, own))}]")
        self._connection.execute("SET enable_external_access = false")
        self._connection.execute("SET lock_configuration = true")

    def _load(self) -> None:
        """A file that is no catalogue or damaged is replaced, since everything in it can be read from the logs."""
        try:
            version = self._stored_version()
            if version > VERSION:
                raise CatalogueError(
                    f"{self.path}: this catalogue has version {version}, this program reads version {VERSION}: "
                    "update mudskipper, or move the file away to have it made again"
                )
            if version == VERSION:
                self._connection.execute("INSERT INTO logs SELECT * FROM read_parquet(?)", [str(self.path)])
        except duckdb.Error:
            self._connection.execute("DELETE FROM logs")

    def _stored_version(self) -> int:
        query = "SELECT value FROM parquet_kv_metadata(?) WHERE key = ?"
        found = self._connection.execute(query, [str(self.path), VERSION_KEY.encode()]).fetchone()
        return int(found[0]) if found and found[0].isdigit() and len(found[0]) <= MOST_DIGITS else 0

    def entries(self) -> list[LogEntry]:
        return [entry_of_row(row) for row in self._connection.execute("SELECT * FROM logs ORDER BY file").fetchall()]

    def update(self, watch: Watch, longest_s: float = inf, broken_again: bool = False) -> int:
        """Read new and changed logs, none that begins after `longest_s`, and store the table where it changed.

        `broken_again` also reads the logs again that could not be read: rights or this program may have changed.
        Returns the number of logs that are still to be read. Raises OSError where the table cannot be stored. An
        interruption costs no log that was read before.
        """
        before, present = self.entries(), _without_copies(_stamped(closed_logs(self._folder)))
        originals = {f"of {self._name_of(path)}" for path, _ in present}
        known = {
            stamp_of_entry(entry): entry
            for entry in before
            if entry.state == "whole" or not (broken_again or entry.state == "copy" and entry.reason not in originals)
        }
        new = [(path, stamp) for path, stamp in present if stamp not in known]
        deadline_s, read = time.monotonic() + longest_s, 0
        try:
            for path, stamp in new:
                if time.monotonic() > deadline_s:
                    break
                known[stamp] = _read_entry(path, self._name_of(path), stamp)
                read += 1
                watch("logs read", read, len(new))
        finally:
            entries = _mark_copies(
                known[stamp]._replace(file=self._name_of(path)) for path, stamp in present if stamp in known
            )
            if set(entries) != set(before):
                self._store(before, entries)
        return len(new) - read

    def _name_of(self, path: Path) -> str:
        return path.relative_to(self._folder).as_posix()

    def _store(self, before: Iterable[LogEntry], after: Iterable[LogEntry]) -> None:
        for entry in set(before) - set(after):
            self._connection.execute("DELETE FROM logs WHERE file = ?", [entry.file])
        for entry in set(after) - set(before):
            row = row_of_entry(entry)
            self._connection.execute(f"INSERT INTO logs VALUES ({', '.join('?' * len(row))})", row)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(self.path) as hidden:
            self._copy_to(hidden)

    def _copy_to(self, path: Path) -> None:
        """Raises OSError."""
        options = f"FORMAT parquet, COMPRESSION zstd, KV_METADATA {{{VERSION_KEY}: '{VERSION}'}}"
        try:
            self._connection.execute(f"COPY logs TO {_quoted(str(path))} ({options})")
        except duckdb.Error as problem:
            found = ERROR_NUMBER.search(str(problem))
            raise OSError(os.strerror(int(found[1])) if found else _first_line(problem)) from None

    def query(self, text: str) -> Answer:
        """Answer one SELECT on the tables `logs` and `trials`. It can change nothing. Raises CatalogueError."""
        try:
            if TRIALS_TABLE in text.casefold():
                self._load_trials()
            statements = self._connection.extract_statements(text)
            if [statement.type for statement in statements] != [duckdb.StatementType.SELECT]:
                raise CatalogueError(
                    'a query is one SELECT on the tables logs and trials, such as "select file, strides from logs"'
                )
            found = self._connection.execute(statements[0])
            names = [column[0] for column in found.description or ()]
            counts = [names[:place].count(name) for place, name in enumerate(names)]
            return Answer([name + f"_{n}" * bool(n) for name, n in zip(names, counts, strict=True)], found.fetchall())
        except duckdb.Error as problem:
            raise CatalogueError(f"the query is not understood: {_first_line(problem)}") from None

    def _load_trials(self) -> None:
        """Make the table of the results of all campaigns below the folder; without a campaign it is empty.

        Raises CatalogueError for a file that is damaged.
        """
        files = ", ".join(_quoted(str(path)) for path in self._trials)
        read = f"read_parquet([{files}], union_by_name = true)" if self._trials else "logs LIMIT 0"
        try:
            self._connection.execute(f"CREATE OR REPLACE TEMP TABLE {TRIALS_TABLE} AS FROM {read}")
        except duckdb.Error as problem:
            raise CatalogueError(f"the results of the campaigns cannot be read: {_first_line(problem)}") from None


def _stamped(paths: Iterable[Path]) -> Iterator[tuple[Path, FileStamp]]:
    for path in paths:
        with suppress(OSError):  # removed meanwhile
            yield path, stamp_of(path)


def _without_copies(present: Iterable[tuple[Path, FileStamp]]) -> list[tuple[Path, FileStamp]]:
    """Leave out files with the name and the size of another one, such as a report's copy: the one higher up stays."""
    found: dict[tuple[str, int], tuple[Path, FileStamp]] = {}
    for path, stamp in sorted(present, key=lambda each: (len(each[0].parts), each[0])):
        found.setdefault((stamp.name, stamp.bytes), (path, stamp))
    return sorted(found.values(), key=lambda each: age_of(each[0]))


def _mark_copies(entries: Iterable[LogEntry]) -> list[LogEntry]:
    """Return the entries, of which one alone has the numbers of a segment of a run: renamed copies have none.

    That is the longest file: an annotation is added to a log, and a copy may be older than it.
    """
    first: dict[object, str] = {}
    marked = []
    for entry in sorted(entries, key=lambda log: (-log.bytes, not log.file.startswith((DONE, PRESERVED)), log.file)):
        contents = (entry.run, entry.segment, entry.duration_s, entry.recovered)
        original = first.setdefault(contents, entry.file) if entry.run and entry.state == "whole" else entry.file
        marked.append(entry if entry.file == original else _copy_of(original, entry))
    return marked


def _copy_of(original: str, entry: LogEntry) -> LogEntry:
    return LogEntry(entry.file, "copy", f"of {original}", entry.bytes, entry.changed_ns)


def _read_entry(path: Path, file: str, stamp: FileStamp) -> LogEntry:
    from logs.catalogue.log_contents import read_entry  # numpy is slow to import, and seldom needed here

    return read_entry(path, file, stamp)


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"


def _first_line(problem: duckdb.Error) -> str:
    return str(problem).partition("\n")[0]
