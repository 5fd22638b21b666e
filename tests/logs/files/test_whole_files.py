"""A file is either written completely or unchanged; a device or a pipe is written to and never replaced."""

import os
import stat
from contextlib import suppress
from pathlib import Path

import pytest

from logs.files.whole_files import whole_file


@pytest.mark.parametrize("fails", [False, True])
def test_a_file_is_whole_or_as_it_was(tmp_path: Path, fails: bool) -> None:
    path = tmp_path / "report"
    path.write_text("before", encoding="utf-8")
    with suppress(InterruptedError), whole_file(path) as part:
        part.write_text("after", encoding="utf-8")
        if fails:
            raise InterruptedError
    assert path.read_text(encoding="utf-8") == ("before" if fails else "after")
    assert not (tmp_path / ".report").exists()


@pytest.mark.parametrize("fails", [False, True])
def test_a_pipe_is_written_and_stays(tmp_path: Path, fails: bool) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    with suppress(InterruptedError), whole_file(path) as part:
        part.write_text("rows", encoding="utf-8")
        if fails:
            raise InterruptedError
    assert os.read(reader, 100) == b"rows"
    os.close(reader)
    assert stat.S_ISFIFO(path.stat().st_mode) and list(tmp_path.iterdir()) == [path]
