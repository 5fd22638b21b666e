"""A finished log is preserved and comes back; what is not whole, or would replace another log, stays where it is."""

from pathlib import Path

import pytest

from firmware_host.log.log_folder import ACTIVE, DONE, PRESERVED, TOP
from logs.files.stored_logs import preserve


def make_log(folder: Path, subfolder: str) -> Path:
    for name in (DONE, subfolder):
        (folder / name).mkdir(exist_ok=True)
    path = folder / subfolder / "1.mcap"
    path.touch()
    return path


@pytest.mark.parametrize("subfolder", [DONE, TOP])
def test_a_preserved_log_comes_back(tmp_path: Path, subfolder: str) -> None:
    path = make_log(tmp_path, subfolder)
    kept = preserve(path)
    assert kept == tmp_path / PRESERVED / "1.mcap" and kept.exists() and not path.exists()
    assert preserve(kept) == kept
    assert preserve(kept, undo=True) == tmp_path / DONE / "1.mcap" and not kept.exists()


def test_what_is_not_whole_or_not_there_cannot_be_preserved(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="only a log in done/"):
        preserve(make_log(tmp_path, ACTIVE))
    with pytest.raises(FileNotFoundError):
        preserve(tmp_path / DONE / "none.mcap")


def test_a_log_of_the_same_name_is_not_replaced(tmp_path: Path) -> None:
    make_log(tmp_path, PRESERVED)
    with pytest.raises(ValueError, match="exists already"):
        preserve(make_log(tmp_path, DONE))
