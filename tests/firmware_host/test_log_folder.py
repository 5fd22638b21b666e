"""Which log is freed, which never, and how logs are named."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmware_host.log_folder import (
    ACTIVE,
    DONE,
    KEPT,
    finished_path,
    first_path,
    free_logs,
    free_space,
    log_files,
    new_run_id,
    present_path,
    preserve,
    segment_path,
)


def make_files(folder: Path, place: str, *names: str) -> list[Path]:
    (folder / place).mkdir(exist_ok=True)
    paths = [folder / place / f"{name}.mcap" for name in names]
    for path in paths:
        path.write_bytes(bytes(100))
    return paths


def test_names_sort_by_time_and_then_by_segment(tmp_path: Path) -> None:
    names = []
    for _ in range(3):
        first = first_path(tmp_path, new_run_id("mud/skipper ü"))
        assert first.parent == tmp_path / ACTIVE
        names += [segment_path(first, number).name for number in (0, 1, 2, 10)]
    assert names == sorted(set(names))
    assert all("mud_skipper_" in name for name in names)


def test_only_a_log_in_active_has_somewhere_to_go(tmp_path: Path) -> None:
    assert finished_path(tmp_path / ACTIVE / "a.mcap") == tmp_path / DONE / "a.mcap"
    for path in (tmp_path / "a.mcap", tmp_path / ACTIVE / "a.mcap.part", tmp_path / DONE / "a.mcap"):
        assert finished_path(path) == path


def test_a_log_is_found_where_it_has_gone(tmp_path: Path) -> None:
    (done,) = make_files(tmp_path, DONE, "a")
    assert present_path(tmp_path / ACTIVE / "a.mcap") == done
    assert present_path(tmp_path / ACTIVE / "b.mcap") == tmp_path / ACTIVE / "b.mcap"


def test_the_oldest_goes_first_and_only_as_many_as_must(tmp_path: Path) -> None:
    make_files(tmp_path, DONE, "3", "1", "2")
    assert [freed.name for freed in free_logs(tmp_path, 250, 0.0)] == ["1.mcap"]
    assert [freed.name for freed in free_logs(tmp_path, 250, 0.0)] == []
    assert [path.name for path in log_files(tmp_path, DONE)] == ["2.mcap", "3.mcap"]


def test_what_is_being_written_or_preserved_is_never_freed(tmp_path: Path) -> None:
    active, kept = make_files(tmp_path, ACTIVE, "0"), make_files(tmp_path, KEPT, "1")
    make_files(tmp_path, DONE, "2", "3")
    assert [(freed.name, freed.size) for freed in free_logs(tmp_path, 1, 0.0)] == [("2.mcap", 100), ("3.mcap", 100)]
    assert all(path.exists() for path in (*active, *kept))


def test_a_disk_without_room_frees_too(tmp_path: Path) -> None:
    make_files(tmp_path, DONE, "1")
    assert list(free_logs(tmp_path, 0, 0.0)) == []
    assert [freed.name for freed in free_logs(tmp_path, 0, 1.1)] == ["1.mcap"]


def test_a_preserved_log_comes_back(tmp_path: Path) -> None:
    (path,) = make_files(tmp_path, DONE, "1")
    kept = preserve(path)
    assert kept == tmp_path / KEPT / "1.mcap" and kept.exists() and not path.exists()
    assert preserve(kept) == kept
    assert preserve(kept, undo=True) == path and path.exists()


def test_what_is_not_whole_cannot_be_preserved(tmp_path: Path) -> None:
    (path,) = make_files(tmp_path, ACTIVE, "1")
    with pytest.raises(ValueError, match="only a log in done/"):
        preserve(path)
    with pytest.raises(FileNotFoundError):
        preserve(tmp_path / DONE / "none.mcap")


def test_a_log_of_the_same_name_is_not_replaced(tmp_path: Path) -> None:
    (path,), _ = make_files(tmp_path, DONE, "1"), make_files(tmp_path, KEPT, "1")
    with pytest.raises(ValueError, match="exists already"):
        preserve(path)


def test_free_space_is_known_before_the_folder_is_made(tmp_path: Path) -> None:
    assert free_space(tmp_path / "none" / "yet").free_share == pytest.approx(free_space(tmp_path).free_share, abs=0.05)
