"""A closed log takes a description without a change of its rows, and everything that reads logs knows it."""

import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader

from experiments.lablogs.log_choice import group_of
from experiments.lablogs.recording import read_recording
from experiments.run_report.results import headline_of, headline_sentences
from experiments.run_report.run import MudsFrom, read_runs
from firmware_host.log.log_file import LogFile
from logs.annotation import annotate
from logs.catalogue.catalogue import Catalogue
from logs.files.log_error import LogError, unwatched
from logs.files.scanned_log import scan_log
from logs.recovery import recover_log
from tests.command_line.command_lines import run
from tests.firmware_host.synthetic_rows import OPENING, make_ticks
from tests.folders import ROOT
from tests.full_disk import files_of_at_most

WALK = ROOT / "tests/fixtures/walk_0_1.mcap"
TRIAL = {"mud": "A", "water": "49.5", "tags": "wet, warm", "plate": "flat"}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return Path(shutil.copyfile(WALK, tmp_path / "walk.mcap"))


def test_keys_are_added_replaced_and_removed_and_no_row_changes(log: Path) -> None:
    assert annotate(log, TRIAL | {"note": "?"}) == TRIAL | {"note": "?"}
    assert annotate(log, {"note": "", "operator": "Anna"}) == TRIAL | {"operator": "Anna"}
    assert annotate(log, {"operator": "Ben"}) == TRIAL | {"operator": "Ben"}
    before, after = WALK.read_bytes(), log.read_bytes()
    with WALK.open("rb") as old, log.open("rb") as new:
        readers = [make_reader(old, validate_crcs=True), make_reader(new, validate_crcs=True)]
        rows = [[(row[2].log_time, row[2].data) for row in reader.iter_messages()] for reader in readers]
        summary = readers[1].get_summary()
        assert summary and summary.statistics and summary.statistics.metadata_count == 4
        chunks = summary.chunk_indexes[-1]
    data_end = chunks.chunk_start_offset + chunks.chunk_length
    assert rows[0] == rows[1] and before[:data_end] == after[:data_end]
    assert scan_log(log).complete


def test_catalogue_report_and_lablogs_know_the_description(log: Path) -> None:
    annotate(log, TRIAL)
    catalogue = Catalogue(log.parent)
    catalogue.update(unwatched)
    query = "select mud, water, tags, trial, more->>'plate' from logs where list_contains(tags, 'warm')"
    assert catalogue.query(query).rows == [("A", 49.5, ["wet", "warm"], "", "flat")]
    (found,) = read_runs([log], None, unwatched)
    headline = headline_of(found)
    assert found.muds_from is MudsFrom.LOG and [mud["mud"] for mud in headline["muds"]] == ["A"]
    assert headline["trial"] == TRIAL and "water 49.5 %" in headline_sentences(found, headline)[0]
    assert group_of("walk.mcap", (), read_recording([log]).mud) == "A"


@pytest.mark.parametrize("step", range(1, 1200, 239))
def test_a_power_cut_in_the_middle_costs_no_row(log: Path, step: int) -> None:
    annotate(log, TRIAL)
    old, new = WALK.read_bytes(), log.read_bytes()
    same = next(index for index, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1])
    log.write_bytes(new[: same + step] + old[same + step :])
    recover_log(log)
    before, after = scan_log(WALK), scan_log(log)
    assert after.complete and (after.rows, len(after.strides)) == (before.rows, len(before.strides))


def test_a_full_disk_leaves_the_log_as_it_was(log: Path) -> None:
    before = log.read_bytes()
    with files_of_at_most(len(before) + 10), pytest.raises(OSError, match="File too large"):
        annotate(log, TRIAL)
    assert log.read_bytes() == before


def test_a_log_that_is_recovered_keeps_its_description(log: Path) -> None:
    annotate(log, TRIAL)
    log.write_bytes(log.read_bytes()[:-20])
    recover_log(log)
    assert annotate(log, {"mud": "B"}) == TRIAL | {"mud": "B"}


def test_what_cannot_be_annotated_stays_as_it_was(log: Path, tmp_path: Path) -> None:
    living = LogFile(tmp_path / "living.mcap", OPENING)
    living.write(make_ticks(0, 39))
    cut, other, tiny = tmp_path / "cut.mcap", tmp_path / "notes.txt", tmp_path / "tiny.mcap"
    cut.write_bytes(WALK.read_bytes()[:-100])
    other.write_text("mud A")
    tiny.write_bytes(WALK.read_bytes()[:8])
    refusals = {living.path: "is being written", cut: "its end is", other: "is no log", tiny: "its end is"}
    for path, reason in refusals.items():
        before = path.read_bytes()
        with pytest.raises(LogError, match=f"{path.name}: {reason}"):
            annotate(path, TRIAL)
        assert path.read_bytes() == before
    before = log.read_bytes()
    assert run("log", "annotate", str(log), "mud=A", "note=a\nb").returncode == 2
    assert run("log", "annotate", str(log), "Mud=A").returncode == 2 and log.read_bytes() == before
    assert run("log", "annotate", str(log), "mud=A").stdout.startswith("mud ")
    assert run("log", "annotate", str(log), "mud=A", "--json").returncode == 0
    living.finish()
    assert annotate(living.path, {"mud": "A"}) == {"mud": "A"}
