"""Logs are found in folders, and their names say which mud they were measured in."""

import gzip
from itertools import chain
from pathlib import Path

import pytest

from experiments.lablogs.log_choice import GroupRule, find_logs, group_key, group_of, groups_of
from firmware_host.log.log_file import LogFile
from firmware_host.trial import METADATA_KEY
from tests.firmware_host.synthetic_rows import OPENING


@pytest.mark.parametrize(
    ("name", "group"),
    [
        ("single_12.5N_trial1.csv.gz", "12.5N"),
        ("single_12.5N_35deg_depth30mm_0.1ms_2_Thu_Jun_27_17_26_11_2024.csv.gz", "12.5N"),
        ("walk_15.6N_50mm_trial1.csv.gz", "walk 15.6N"),
        ("7N.csv", "7N"),
        ("single_stiffest_trial1.csv.gz", None),
        ("_Mon_Aug__5_19_30_04_2024.csv.gz", None),
        ("Test_2024Nov_3Nm.csv", None),
    ],
)
def test_the_label_in_a_name_is_its_group(name: str, group: str | None) -> None:
    assert group_of(name, ()) == group


def test_the_first_rule_that_matches_replaces_the_label() -> None:
    rules = (GroupRule("single_12*", "firm"), GroupRule("*", "other"))
    assert [group_of(f"{name}.csv.gz", rules) for name in ("single_12.5N_1", "single_12N_1", "single_10.3N_1")] == [
        "firm",
        "firm",
        "other",
    ]
    assert group_of("pond.csv.gz", (GroupRule("pond", "wet"),), "A") == "wet"  # without the ending
    assert group_of("single_12.5N_1.csv", (), "A") == "A"  # which the log names


def test_logs_of_one_mud_are_one_group_however_they_spell_it() -> None:
    logs = [("1.mcap", "Pond"), ("2.mcap", "49.5"), ("3.mcap", "pond"), ("4.mcap", "w = 49.50 %"), ("5.csv", "")]
    assert groups_of(logs, ()) == ["Pond", "49.5", "Pond", "49.5", None]


def test_groups_are_in_the_order_of_strength() -> None:
    groups = ["walk 15.6N", "pond", "10.3N", "walk 30N", "12N", "12.5N"]
    assert sorted(groups, key=group_key) == ["12.5N", "12N", "10.3N", "walk 30N", "walk 15.6N", "pond"]


def test_logs_are_found_below_a_folder_once_and_segments_of_a_run_or_trial_are_one(tmp_path: Path) -> None:
    runs = [
        ["bench-0001.mcap"],
        ["one.csv"],
        ["run-0000.mcap", "run-0001.mcap"],
        ["run-0002_A_1.mcap", "run-0003_A_1.mcap"],
        ["run-0004_A_2.mcap"],
        ["run-0005.mcap"],
        ["two.csv.gz"],
    ]
    below = tmp_path / "a" / "b"
    below.mkdir(parents=True)
    for name in ("c.txt", *chain(*runs)):
        (below / name if name.startswith("two") else below.parent / name).touch()
    found = find_logs([tmp_path, below, tmp_path / "a" / "one.csv"])
    assert sorted([path.name for path in paths] for paths in found) == runs


def test_trials_with_other_descriptions_are_logs_of_their_own_though_their_names_are_alike(tmp_path: Path) -> None:
    """A file's name has nothing of a note, and no letters but those of ASCII."""
    trials = ["{}", '{"mud": "泥"}', '{"mud": "砂"}', '{"mud": "砂"}', '{"mud": "砂", "note": "rain"}']
    for number, trial in enumerate(trials):
        opening = OPENING | {"metadata": {"run_id": "run", "segment": str(number), METADATA_KEY: trial}}
        LogFile(tmp_path / f"run-{number:04d}.mcap", opening).finish()
    assert [[path.stem[-1] for path in paths] for paths in find_logs([tmp_path])] == [["0"], ["1"], ["2", "3"], ["4"]]


@pytest.mark.parametrize(
    ("contents", "found"),
    [
        # a copy in the folder of a report is no repetition, and another log of the name is one
        ({"report/one.csv": b"1", "other/one.csv": b"2", "one.csv": b"1"}, ["one.csv", "other/one.csv"]),
        # a CSV next to its compressed file is no repetition
        (
            {"one.csv": b"1", "one.csv.gz": gzip.compress(b"1"), "two.csv": b"2", "two.csv.gz": gzip.compress(b"1")},
            ["one.csv", "two.csv", "two.csv.gz"],
        ),
        # a log that is still being copied is none yet
        ({"done/one.mcap": b"1", "done/.two.mcap": b"2", "done/.partial/three.mcap": b"3"}, ["done/one.mcap"]),
    ],
)
def test_copies_are_no_repetitions(contents: dict[str, bytes], found: list[str], tmp_path: Path) -> None:
    for name, content in contents.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    assert find_logs([tmp_path]) == [(tmp_path / name,) for name in found]
