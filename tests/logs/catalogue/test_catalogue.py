"""The catalogue knows every closed log of a folder, reads each once, and cannot be changed by a query."""

import os
from collections.abc import Callable
from pathlib import Path
from statistics import median

import duckdb
import pytest

from control.modes import Mode
from firmware_host.log.log_file import EXPORTED, LogFile
from firmware_host.log.log_folder import ACTIVE, DONE, PRESERVED
from logs.annotation import annotate
from logs.catalogue import catalogue as catalogue_module
from logs.catalogue.catalogue import VERSION, VERSION_KEY, Catalogue, CatalogueError, catalogue_path
from logs.catalogue.entry import LogEntry
from logs.catalogue.log_contents import entry_of_log
from logs.files.log_error import unwatched
from logs.files.log_reader import read_log
from logs.files.stored_logs import preserve
from tests.firmware_host.synthetic_rows import OPENING, make_event, make_ticks
from tests.folders import ROOT
from tests.full_disk import files_of_at_most

WALK = ROOT / "tests/fixtures/walk_0_1.mcap"


def make_log(path: Path, *events: str, **metadata: str) -> Path:
    log = LogFile(path, OPENING | {"metadata": OPENING["metadata"] | metadata})
    log.write([*make_ticks(0, 39), *map(make_event, events)])
    return log.finish()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / DONE).mkdir()
    (tmp_path / DONE / "walk.mcap").write_bytes(WALK.read_bytes())
    faults = "fault drive_silent (drives_idle): gone", "fault drive_version (none): unknown"
    make_log(tmp_path / ACTIVE / "rest.mcap", *faults)
    return tmp_path


def updated(folder: Path) -> dict[str, LogEntry]:
    catalogue = Catalogue(folder)
    assert catalogue.update(unwatched) == 0
    return {entry.file: entry for entry in catalogue.entries()}


@pytest.fixture
def readings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list of files that the catalogue reads, in order."""
    read: list[str] = []
    plain: Callable[..., LogEntry] = catalogue_module._read_entry

    def noted(path: Path, *arguments: object) -> LogEntry:
        read.append(path.name)
        return plain(path, *arguments)

    monkeypatch.setattr(catalogue_module, "_read_entry", noted)
    return read


def test_an_entry_says_what_the_log_contains(folder: Path) -> None:
    entries = updated(folder)
    walk, rest = entries[f"{DONE}/walk.mcap"], entries[f"{DONE}/rest.mcap"]
    assert (walk.robot, walk.walks, walk.strides, walk.stuck_strides, walk.state) == ("test", 1, 6, 0, "whole")
    assert walk.started is not None and walk.started.isoformat() == "2026-11-22T14:50:21"
    assert walk.distance_m == pytest.approx(0.36, abs=0.01) and walk.speed_m_s == pytest.approx(0.067, abs=0.001)
    (mud,) = walk.muds
    assert mud.strides == 6 and mud.k_p == pytest.approx(1.3e6, rel=0.05)
    assert walk.configuration_sha256.startswith("5a798700")
    assert (rest.robot, rest.run, rest.walks, rest.speed_m_s) == ("mudskipper-1", "run", 0, None)
    assert rest.faults == ("drive_silent",)


def test_the_event_of_another_mud_begins_a_mud_with_its_own_medians_and_speed(folder: Path) -> None:
    walk, log = updated(folder)[f"{DONE}/walk.mcap"], read_log(WALK)
    border = {"stamp_s": log.strides[2]["stamp_s"], "text": "another mud"}
    muds = entry_of_log(walk, log._replace(events=[border])).muds
    for mud, strides in zip(muds, (log.strides[:2], log.strides[2:]), strict=True):
        assert (mud.strides, mud.k_p) == (len(strides), median(stride["k_p"] for stride in strides))
        assert mud.speed_m_s == pytest.approx(0.12 / 1.57, rel=0.02)  # a step in the time between two insertions


def test_each_walk_begins_another_mud_as_the_robot_may_have_been_moved(folder: Path) -> None:
    walk, log = updated(folder)[f"{DONE}/walk.mcap"], read_log(WALK)
    stopped = (log.ticks["stamp_s"] > log.strides[2]["stamp_s"]) & (log.ticks["stamp_s"] < log.strides[4]["t_start_s"])
    log.ticks["mode"][stopped] = Mode.HOLD
    entry = entry_of_log(walk, log)
    assert (entry.walks, [mud.strides for mud in entry.muds]) == (2, [4, 2])
    assert entry.muds[0].speed_m_s == pytest.approx(0.12 / 1.57, rel=0.02)


def test_a_lower_bound_counts_in_no_median(folder: Path) -> None:
    walk, log = updated(folder)[f"{DONE}/walk.mcap"], read_log(WALK)
    bound = log.strides[0] | {"k_p": 9e9, "k_p_at_least": True}
    (mud,) = entry_of_log(walk, log._replace(strides=[bound, *log.strides[1:]])).muds
    assert mud.k_p == median(stride["k_p"] for stride in log.strides[1:])


def test_a_copy_that_an_earlier_version_exported_counts_nothing(folder: Path) -> None:
    make_log(folder / ACTIVE / "ros.mcap", **{EXPORTED: "true"})
    entry = updated(folder)[f"{DONE}/ros.mcap"]
    assert (entry.state, entry.duration_s) == ("export", None)


def test_a_log_is_read_once_and_added_when_it_is_closed(folder: Path, readings: list[str]) -> None:
    living = LogFile(folder / ACTIVE / "now.mcap", OPENING)
    updated(folder)
    assert sorted(readings) == ["rest.mcap", "walk.mcap"]
    readings.clear()
    living.write(make_ticks(0, 10))
    living.finish()
    assert f"{DONE}/now.mcap" in updated(folder)
    assert readings == ["now.mcap"]


def test_a_log_that_moved_is_known_and_a_deleted_one_forgotten(folder: Path, readings: list[str]) -> None:
    updated(folder)
    preserve(folder / DONE / "walk.mcap")
    (folder / DONE / "rest.mcap").unlink()
    readings.clear()
    assert list(updated(folder)) == [f"{PRESERVED}/walk.mcap"]
    assert readings == []


def test_a_copy_of_a_log_counts_once(folder: Path, readings: list[str]) -> None:
    (folder / "report").mkdir()
    path = make_log(folder / ACTIVE / "run-0000.mcap", run_id="other", segment="0")
    for name in ("run-0000.mcap", "same.mcap"):
        (folder / "report" / name).write_bytes(path.read_bytes())
    entries = updated(folder)
    assert "report/run-0000.mcap" not in entries and readings.count("run-0000.mcap") == 1
    states = {file: (entry.state, entry.duration_s is None) for file, entry in entries.items()}
    assert states["done/run-0000.mcap"] == ("whole", False) and states["report/same.mcap"] == ("copy", True)
    updated(folder)
    assert len(readings) == 4  # nothing is read again
    path.unlink()
    (folder / "report" / "run-0000.mcap").unlink()
    entry = updated(folder)["report/same.mcap"]  # the only one now
    assert (entry.state, entry.run) == ("whole", "other") and entry.duration_s is not None


def test_a_log_that_was_annotated_is_no_copy_of_one_that_was_not(folder: Path) -> None:
    path = make_log(folder / "day.mcap", run_id="other", segment="0")
    (folder / "day-report").mkdir()
    copy = path.replace(folder / "day-report" / "day.mcap")
    path.write_bytes(copy.read_bytes())
    annotate(path, {"mud": "B"})
    entries = updated(folder)
    assert (entries["day.mcap"].state, entries["day.mcap"].mud) == ("whole", "B")
    assert entries["day-report/day.mcap"].reason == "of day.mcap"


def test_two_logs_of_one_name_are_two_entries(folder: Path) -> None:
    make_log(folder / "walk.mcap")
    assert {"walk.mcap", f"{DONE}/walk.mcap"} <= updated(folder).keys()


def test_a_log_that_is_still_being_copied_is_no_entry(folder: Path) -> None:
    (folder / DONE / ".partial").mkdir()
    for name in (".partial/next.mcap", ".next.mcap"):
        (folder / DONE / name).write_bytes(WALK.read_bytes()[:-100])
    assert sorted(updated(folder)) == [f"{DONE}/rest.mcap", f"{DONE}/walk.mcap"]


def test_a_broken_log_is_an_entry_with_its_reason(folder: Path) -> None:
    (folder / DONE / "cut.mcap").write_bytes(WALK.read_bytes()[:-100])
    (folder / DONE / "text.mcap").write_text("no log", encoding="utf-8")
    entries = updated(folder)
    assert entries[f"{DONE}/cut.mcap"].state == entries[f"{DONE}/text.mcap"].state == "broken"
    assert entries[f"{DONE}/cut.mcap"].strides == 6
    assert "MCAP" in entries[f"{DONE}/text.mcap"].reason and str(folder) not in entries[f"{DONE}/text.mcap"].reason


def test_broken_logs_are_read_again_on_demand(folder: Path, readings: list[str]) -> None:
    (folder / DONE / "text.mcap").write_text("no log", encoding="utf-8")
    updated(folder)
    readings.clear()
    assert Catalogue(folder).update(unwatched, broken_again=True) == 0
    assert readings == ["text.mcap"]


def write_catalogue(path: Path, version: object) -> None:
    duckdb.execute(f"COPY (SELECT 1 AS x) TO '{path}' (FORMAT parquet, KV_METADATA {{{VERSION_KEY}: '{version}'}})")


def test_a_catalogue_of_a_newer_version_is_refused_and_left(folder: Path) -> None:
    path = catalogue_path(folder)
    write_catalogue(path, VERSION + 1)
    before = path.read_bytes()
    with pytest.raises(CatalogueError, match="update mudskipper"):
        Catalogue(folder)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(b"PAR1 garbage PAR1"),
        lambda path: write_catalogue(path, "9" * 5000),  # no version of ours
    ],
)
def test_a_damaged_catalogue_is_made_again(folder: Path, damage: Callable[[Path], object]) -> None:
    known = updated(folder)
    damage(catalogue_path(folder))
    assert updated(folder) == known == updated(folder)


def test_an_interrupted_update_keeps_what_it_read(folder: Path, readings: list[str]) -> None:
    def interrupt(what: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Catalogue(folder).update(interrupt)
    assert Catalogue(folder).update(unwatched, longest_s=-1.0) == 1
    updated(folder)
    assert readings == ["rest.mcap", "walk.mcap"]


def test_a_catalogue_that_cannot_be_stored_can_be_queried(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue_module, "catalogue_path", lambda _: Path("/proc/mudskipper/catalogue.parquet"))
    catalogue = Catalogue(folder)
    with pytest.raises(OSError, match="/proc/mudskipper"):
        catalogue.update(unwatched)
    assert catalogue.query("SELECT count(*) FROM logs").rows == [(2,)]


def test_a_full_disk_leaves_the_catalogue_before(folder: Path) -> None:
    updated(folder)
    before = catalogue_path(folder).read_bytes()
    make_log(folder / ACTIVE / "new.mcap")
    with files_of_at_most(100), pytest.raises(OSError, match="^File too large$"):
        Catalogue(folder).update(unwatched)
    assert catalogue_path(folder).read_bytes() == before
    assert f"{DONE}/new.mcap" in updated(folder)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may give files away")
def test_root_writes_into_no_folder_of_another_user(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    os.chown(folder, 12345, 12345)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    updated(folder)
    assert not (folder / "catalogue.parquet").exists()
    assert len(list((tmp_path / "cache" / "mudskipper").iterdir())) == 1


@pytest.mark.parametrize(
    "text",
    [
        "", "all the logs", "SELECT depth FROM logs", "SELECT 1; SELECT 2", "DROP TABLE logs", "DELETE FROM logs",
        "SET threads = 1", "COPY logs TO '/tmp/logs.csv'", "ATTACH '/tmp/other.db'", "SELECT * FROM '/etc/passwd'",
        "SELECT * FROM read_text('/etc/passwd')", "SELECT * FROM glob('/*')",
    ],
)  # fmt: skip
def test_what_is_no_select_on_the_logs_is_one_message(folder: Path, text: str) -> None:
    catalogue = Catalogue(folder)
    catalogue.update(unwatched)
    with pytest.raises(CatalogueError) as refused:
        catalogue.query(text)
    assert "\n" not in str(refused.value)
    assert catalogue.query("SELECT count(*) FROM logs").rows == [(2,)]
