"""The quota deletes the oldest logs and never certain others; logs are named by their run."""

import os
from pathlib import Path
from shutil import disk_usage

import pytest

from firmware_host.log.log_file import LogFile
from firmware_host.log.log_folder import (
    ACTIVE,
    DONE,
    LAST_BYTES,
    PRESERVED,
    TOP,
    copies_text,
    copy_owner,
    delete_by_quota,
    first_path,
    free_space,
    log_files,
    make_folder,
    mark_of,
    new_run_id,
    segment_path,
    stored_files,
    unfinished_files,
)
from tests.firmware_host.synthetic_rows import OPENING


def make_files(folder: Path, subfolder: str, *names: str) -> list[Path]:
    (folder / subfolder).mkdir(exist_ok=True)
    paths = [folder / subfolder / f"{name}.mcap" for name in names]
    for path in paths:
        path.write_bytes(bytes(92) + LAST_BYTES)
    return paths


def test_names_sort_by_time_and_then_by_segment(tmp_path: Path) -> None:
    names = []
    for _ in range(3):
        first = first_path(tmp_path, new_run_id("mud/skipper ü"))
        assert first.parent == tmp_path / ACTIVE
        names += [segment_path(first, number).name for number in (0, 1, 2, 10)]
    assert names == sorted(set(names))
    assert all("mud_skipper_" in name for name in names)
    later = make_files(tmp_path, DONE, "run-9999", "run-10000_A_3", "run-10001", "runs-0000")
    assert log_files(tmp_path, DONE) == later


@pytest.mark.parametrize(
    ("logs", "quota_bytes", "min_free_fraction", "deleted"),
    [
        ({DONE: "312"}, 250, 0.0, ["1"]),  # only as many as must, the oldest first
        ({DONE: "312"}, 300, 0.0, []),
        ({DONE: "12"}, 0, 0.0, []),  # no quota
        ({DONE: "12"}, 0, 1.1, ["1"]),  # a disk without room, but never the newest
        ({ACTIVE: "0", PRESERVED: "1", DONE: "23"}, 1, 0.0, ["2"]),
        ({PRESERVED: "12", DONE: "34"}, 250, 0.0, []),  # preserved logs do not count
        ({PRESERVED: "12", DONE: "34"}, 150, 0.0, ["3"]),
    ],
)
def test_the_quota_frees_old_finished_logs(
    tmp_path: Path, logs: dict[str, str], quota_bytes: int, min_free_fraction: float, deleted: list[str]
) -> None:
    for subfolder, names in logs.items():
        make_files(tmp_path, subfolder, *names)
    freed = list(delete_by_quota(tmp_path, quota_bytes, min_free_fraction))
    assert freed == [f"room for logs: {name}.mcap was deleted, 100 bytes, not copied" for name in deleted]
    left = {path.stem for path in log_files(tmp_path, ACTIVE, DONE, PRESERVED)}
    assert left == set("".join(logs.values())) - set(deleted)


def test_a_log_that_cannot_be_deleted_does_not_keep_the_quota_from_others(tmp_path: Path) -> None:
    (tmp_path / DONE / "0.mcap").mkdir(parents=True)  # stands for a file with the attribute "immutable"
    make_files(tmp_path, DONE, "1", "2", "3")
    assert [text.split()[3] for text in delete_by_quota(tmp_path, 1, 0.0)] == ["1.mcap", "2.mcap"]


def test_free_space_is_known_before_the_folder_is_made(tmp_path: Path) -> None:
    found, disk = free_space(tmp_path / "none" / "yet"), disk_usage(tmp_path)
    assert found.free_fraction == pytest.approx(free_space(tmp_path).free_fraction, abs=0.05)
    assert found.free_bytes == pytest.approx(disk.free, abs=0.05 * disk.total)


def test_every_file_in_active_counts_as_a_log(tmp_path: Path) -> None:
    make_files(tmp_path, DONE, "1", "2")
    make_files(tmp_path, ACTIVE, "3")
    for name in ("0.mcap.broken", "0.mcap.part", "notes.txt"):
        (tmp_path / ACTIVE / name).write_bytes(bytes(100))
    assert len(stored_files(tmp_path)) == 6
    assert list(delete_by_quota(tmp_path, 600, 0.0)) == []
    assert len(list(delete_by_quota(tmp_path, 599, 0.0))) == 1


def test_logs_of_the_older_layout_are_seen(tmp_path: Path) -> None:
    whole, cut = make_files(tmp_path, TOP, "1", "2")
    cut.write_bytes(bytes(100))
    (done,) = make_files(tmp_path, DONE, "3")
    assert stored_files(tmp_path) == [whole, cut, done]
    assert unfinished_files(tmp_path) == [cut]
    assert len(list(delete_by_quota(tmp_path, 1, 0.0))) == 1 and cut.exists()  # a cut log is not deleted


@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes files that are somebody else's")
def test_what_root_makes_belongs_to_the_owner_of_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    os.chown(folder, 12345, 23456)
    log = LogFile(first_path(folder, "run"), OPENING)
    done = log.finish()
    for path in (folder / ACTIVE, done.parent, done):
        assert (path.stat().st_uid, path.stat().st_gid) == (12345, 23456), path


def test_an_owner_that_may_not_be_given_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(descriptor: int, user: int, group: int) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "fchown", refuse)
    with (tmp_path / "file").open("w") as file:
        copy_owner(file.fileno(), tmp_path)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes files that are somebody else's")
def test_a_link_that_replaces_a_new_folder_is_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The owner of the log folder may swap the folder that root has just made in it."""
    logs, target = tmp_path / "logs", tmp_path / "target"
    logs.mkdir()
    target.mkdir()
    os.chown(logs, 12345, 23456)

    def make_and_swap(folder: Path, **_: object) -> None:
        folder.symlink_to(target)

    monkeypatch.setattr(Path, "mkdir", make_and_swap)
    with pytest.raises(OSError):
        make_folder(logs / "done")
    assert target.stat().st_uid == 0


def test_logs_that_were_not_copied_are_deleted_last(tmp_path: Path) -> None:
    make_files(tmp_path, DONE, *"1234")
    for name in "23":
        mark_of(tmp_path / DONE / f"{name}.mcap", tmp_path).parent.mkdir(exist_ok=True)
        mark_of(tmp_path / DONE / f"{name}.mcap", tmp_path).touch()
    assert copies_text(tmp_path) == "2 of 4 not copied"
    assert [text.split()[3] for text in delete_by_quota(tmp_path, 150, 0.0)] == ["2.mcap", "3.mcap", "1.mcap"]
    assert not list((tmp_path / "copied").iterdir())
