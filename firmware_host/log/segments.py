"""The files of one run, one after the other: rotation, a disk that refuses, and the logs' quota.

Every file of a run carries the run's id, its own number, the configuration, version and host, and the offset of both
clocks, measured again for each file, so each can be read alone. A row goes into exactly one file. When the disk refuses
(full, read-only, removed), the file is cut back to its safe rows and left for recovery, rows are counted instead of
written, and a new file is tried every few seconds; its first events report deleted logs and the number of missing rows.
"""

import errno
import math
import platform
import subprocess
import sys
import time
from contextlib import suppress
from datetime import UTC, datetime
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.log.log_file import LogFile, Rows
from firmware_host.log.log_folder import (
    ACTIVE,
    delete_by_quota,
    delete_oldest,
    finished_path,
    free_space,
    segment_path,
    synchronise_folder,
    unfinished_files,
)
from firmware_host.log.rest_thinning import RestThinning
from firmware_host.log.rows import EVENT, EVENT_KIND, ROW_KINDS, TICK_KIND, opening_kinds
from firmware_host.trial import (
    BEGUN,
    METADATA_KEY,
    SET,
    OperatorReport,
    Trial,
    from_json,
    name_part,
    read_report,
    store_defaults,
    to_json,
)

REPORTED = b"trial "  # in the row of an event that this module acts on
RETRY_S = 3.0  # between two attempts at a disk that refuses
QUOTA_INTERVAL_S = 10.0


class LogSegments:
    """Owns the file that is being written. No method raises OSError; `problem` is the message about the disk."""

    def __init__(self, first: Path, opening: dict[str, Any], parameters: LogParameters) -> None:
        self.problem = self._reason = ""
        self.dropped = 0
        self.path = first
        self.durable_stamp_s = math.nan  # of the newest row that a power cut would leave
        self.slowest_s = 0.0  # write since this was last set to zero
        self._first, self._opening, self._parameters = first, opening, parameters
        self._folder = first.parent.parent if first.parent.name == ACTIVE else None
        self._thinning = RestThinning(parameters.rest_hz, parameters.rest_full_s, opening_kinds(opening)[TICK_KIND])
        self._file: LogFile | None = None
        self._segment = 0
        self._trial: Trial = {}  # that this file belongs to
        self._missing = 0  # rows that the next file has to report
        self._full = False  # the disk, when it refused
        self._deleting_helps = True
        self._deleted: list[str] = []  # messages for the next file
        self._latest_stamp_s = 0.0
        self._first_stamp_s: float | None = None  # of the ticks in this file
        self._retry_s = self._quota_s = 0.0
        self._recovery: subprocess.Popen[bytes] | None = None
        self._repaired = 0  # files that it examines
        self._tried: set[Path] = set()  # to recover, once a run: a failure would be repeated at every file
        self._open()

    def write(self, rows: Rows) -> None:
        """Call this regularly, without rows too: a file is flushed by time. A trial is the first row of a file."""
        written = 0
        for index, (number, row) in enumerate(rows):
            if number == EVENT_KIND and REPORTED in row and (report := read_report(EVENT.decode(row)["text"])):
                self._write_rows(rows[written:index])
                written = index
                self._act_on(report)
        self._write_rows(rows[written:])

    def _act_on(self, report: OperatorReport) -> None:
        """Begin a file with each trial, and store new defaults."""
        if report.kind == BEGUN:
            self._trial = from_json(report.text)
            self._begin_next()
        elif report.kind == SET and self._folder is not None:
            with suppress(OSError):  # they hold until the daemon ends
                store_defaults(self._folder, report.text)
                synchronise_folder(self._folder)

    def _write_rows(self, rows: Rows) -> None:
        for number, row in rows[-1:]:
            self._latest_stamp_s = ROW_KINDS[number].stamp_s(row)
        thinned = self._thinning.thin(rows)
        wanted = [*thinned.rows, self._event(thinned.notice)] if thinned.notice else thinned.rows
        if self._file is None and time.monotonic() >= self._retry_s:
            self._open()
        self._rotate(wanted)
        self._write(wanted)
        self._apply_quota()

    def _write(self, rows: Rows) -> None:
        if self._file is None:
            self._drop(len(rows))
            return
        before = self._file.rows
        try:
            self._file.write(rows)
        except OSError as error:
            self._give_up(error, unwritten=len(rows) - (self._file.rows - before))
        else:
            self._note_disk(self._file)

    def _event(self, text: str) -> tuple[int, bytes]:
        return EVENT_KIND, EVENT.encode(self._latest_stamp_s, text)

    def _drop(self, count: int) -> None:
        self.dropped += count
        self._missing += count

    def _open(self) -> None:
        self.path = segment_path(self._first, self._segment, name_part(self._trial))
        try:
            self._make_room()
            if finished_path(self.path).exists():
                raise FileExistsError(errno.EEXIST, "File exists")
            self._file = LogFile(self.path, self._opening_of(self._segment))
            self._segment += 1
            self._first_stamp_s = None
            self._report_gap(self._file)
        except OSError as error:
            self._segment += isinstance(error, FileExistsError)
            self._give_up(error)
            return
        self.problem = self._reason = ""
        self._deleting_helps = True
        self._start_recovery()

    def _report_gap(self, file: LogFile) -> None:
        """Write events about the rows that are missing before this file and the logs that were deleted for it."""
        texts = list(self._deleted)
        if self._missing:
            texts.append(f"rows missing here: {self._missing}, the log could not be written: {self._reason}")
        if texts:
            file.write([self._event(text) for text in texts])
            file.flush()
            self._missing = 0
            self._deleted.clear()

    def _opening_of(self, segment: int) -> dict[str, Any]:
        metadata = {
            "segment": str(segment),
            "configuration_sha256": sha256(self._opening["configuration_text"].encode()).hexdigest(),
            "host": platform.node(),
            "kernel": f"{platform.release()} {platform.version()}",
            "started": datetime.now(UTC).isoformat(),
            "rest_hz": f"{self._parameters.rest_hz:g}",
            "rest_full_s": f"{self._parameters.rest_full_s:g}",
        }
        metadata |= {METADATA_KEY: to_json(self._trial)} if self._trial else {}
        return self._opening | {
            "metadata": self._opening["metadata"] | metadata,
            "wall_minus_monotonic_ns": time.time_ns() - time.monotonic_ns(),
        }

    def _give_up(self, error: OSError, unwritten: int = 0) -> None:
        """Give up this file, not the log."""
        if self._file is not None:
            self._drop(self._file.rows - self._file.safe_rows + unwritten)
            self._segment -= self._file.safe_rows == 0  # such a file is removed
            self._file.abandon()
            self._file = None
        reason = error.strerror or str(error)
        self.problem = f"{self.path}: {reason}."
        if reason != self._reason:
            with suppress(OSError):  # standard error may be a file on the same disk
                print(f"The log cannot be written: {self.problem}", file=sys.stderr, flush=True)
        self._reason = reason
        self._full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        self._retry_s = time.monotonic() + RETRY_S

    def _note_disk(self, file: LogFile) -> None:
        self.slowest_s, file.slowest_s = max(self.slowest_s, file.slowest_s), 0.0
        if not math.isnan(file.durable_stamp_s):
            self.durable_stamp_s = file.durable_stamp_s

    def _rotate(self, rows: Rows) -> None:
        """Begin a new file before these rows where the present one is too long or too large."""
        if self._file is None or not rows:
            return
        number, row = rows[0]
        begin_s = ROW_KINDS[number].stamp_s(row)
        if self._first_stamp_s is None:
            self._first_stamp_s = begin_s
        long = self._latest_stamp_s - self._first_stamp_s >= self._parameters.segment_s
        if long or self._file.length >= self._parameters.segment_bytes:
            self._trial = {} if self._thinning.resting else self._trial  # the hours after a trial are not of it
            self._begin_next()
            self._first_stamp_s = begin_s

    def _begin_next(self) -> None:
        """End this file and begin the next one; a disk that refuses is tried again later."""
        self._finish()
        if not self.problem:
            self._quota_s = 0.0
            self._open()

    def _finish(self) -> None:
        if self._file is None:
            return
        try:
            self.path = self._file.finish()
            self._note_disk(self._file)
            self._file = None
        except OSError as error:
            self._give_up(error)

    def close(self) -> bool:
        """Return whether every row is on the disk, or reported there as missing."""
        if self._file is None:
            self._open()
        self._write(self._thinning.release())
        self._finish()
        return not self.problem

    def _make_room(self) -> None:
        """Delete the oldest log at once where the disk was full, logs may be deleted, and deleting helped before."""
        may_delete = self._parameters.quota_bytes > 0 or self._parameters.min_free_fraction > 0.0
        if self._full and self._folder is not None and may_delete and self._deleting_helps:
            before = free_space(self._folder).free_bytes
            for message in islice(delete_oldest(self._folder), 1):
                self._deleted.append(message)
                self._deleting_helps = free_space(self._folder).free_bytes > before
        self._full = False

    def _apply_quota(self) -> None:
        if self._folder is None or time.monotonic() < self._quota_s:
            return
        self._quota_s = time.monotonic() + QUOTA_INTERVAL_S
        quota_bytes, fraction = self._parameters.quota_bytes, self._parameters.min_free_fraction
        with suppress(OSError):  # the disk gives no answer
            for message in delete_by_quota(self._folder, quota_bytes, fraction):
                if self._file is None:
                    self._deleted.append(message)
                else:
                    self._write([self._event(message)])

    @property
    def repairing(self) -> int:
        """Return how many unfinished logs of other runs are being repaired."""
        return self._repaired if self._recovery is not None and self._recovery.poll() is None else 0

    def _start_recovery(self) -> None:
        """Recover the files of other runs, or of this run before its disk failed, in a process of its own."""
        if self._folder is None or (self._recovery is not None and self._recovery.poll() is None):
            return
        found = set(unfinished_files(self._folder)) - {self.path}
        if found <= self._tried:
            return
        self._tried |= found
        self._repaired = len(found)
        command = [sys.executable, "-P", "-m", "logs.recovery", str(self._folder)]
        with suppress(OSError):  # the next start finds them too
            self._recovery = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
