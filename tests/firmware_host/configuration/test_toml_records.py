"""Records are read from nested TOML tables, arrays and changes, and every problem is reported with its key."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import pytest

from control.bounds import Bounds
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.toml_records import (
    LARGEST_FILE_BYTES,
    ChangesOf,
    RecordReader,
    parse_document,
    read_text,
)


@dataclass(frozen=True)
class Plank:
    length_m: Annotated[float, Bounds(0.1, 5.0)]
    nails: Annotated[int, Bounds(0, 100)] = 4


@dataclass(frozen=True)
class Rail:
    height_m: Annotated[float | None, Bounds(0.5, 1.5)] = None
    plank: list[Plank] = field(default_factory=list)


@dataclass(frozen=True)
class Deck:
    plank: Plank = Plank(1.0)
    painted: bool = False
    number: Annotated[int, Bounds(0, 9)] = 0


@dataclass(frozen=True)
class Bridge:
    rail: list[Rail]
    beam: dict[str, Plank] = field(default_factory=dict)
    deck: Annotated[dict[str, Any], ChangesOf(Deck, frozenset({"number"}))] = field(default_factory=dict)
    note: str = ""


READER = RecordReader(Bridge, without={"note"})


def test_tables_arrays_and_arrays_in_arrays_become_their_records() -> None:
    text = (
        "[[rail]]\n[[rail.plank]]\nlength_m = 2\n[[rail.plank]]\nlength_m = 3.5\nnails = 6\n[[rail]]\nheight_m = 1.0\n"
    )
    read = READER.read(parse_document(text + "[beam.left]\nlength_m = 4.0\n"))
    assert read == {
        "rail": [Rail(None, [Plank(2.0), Plank(3.5, 6)]), Rail(1.0)],
        "beam": {"left": Plank(4.0)},
        "deck": {},
    }


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("", {}),
        ("[deck]\npainted = false\n", {"painted": False}),  # listed, although it is the default
        ("[deck.plank]\nlength_m = 2.0\n", {"plank": Plank(2.0)}),
    ],
)
def test_changes_are_what_the_file_sets_and_nothing_else(text: str, changes: dict[str, Any]) -> None:
    assert READER.read(parse_document("rail = []\n" + text))["deck"] == changes


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("", "rail is missing"),
        ("rail = 1", "rail = 1: must be tables, each under [[rail]]"),
        ("[[rail]]\nplank = 1", "rail 1.plank = 1: must be tables, each under [[rail.plank]]"),
        ("[[rail]]\n[[rail]]\nheight_m = 2", "rail 2.height_m = 2: must be at most 1.5"),
        ("[[rail]]\nheight_m = 0.4", "rail 1.height_m = 0.4: must be at least 0.5"),
        ("[[rail]]\n[[rail.plank]]\nlength_m = 1\n[[rail.plank]]\nnails = 1", "rail 1.plank 2.length_m is missing"),
        ("[[rail]]\n[[rail.plank]]\nlength_m = 1\nwood = 'oak'", "rail 1.plank 1.wood: there is no such key"),
        ("rail = []\n[beam.left]\nlength_m = 9", "beam.left.length_m = 9: must be at most 5.0"),
        ("rail = []\n[deck]\nnumber = 3", "deck.number: there is no such key"),
        ("rail = []\n[deck.plank]\nlength_m = inf", "deck.plank.length_m = inf: should be a finite number"),
        ("rail = []\nnote = 'x'", "note: there is no such key"),
    ],
)
def test_each_problem_is_reported_with_key_value_and_bound(text: str, reported: str) -> None:
    document = parse_document(text)
    assert READER.problems(document) == [reported]
    with pytest.raises(ConfigurationError) as caught:
        READER.read(document)
    assert caught.value.problems == [reported]


def test_a_number_of_thousands_of_digits_is_refused_by_its_key() -> None:
    """Python reads such a number in hexadecimal, but refuses to print it in decimal."""
    document = parse_document(f"rail = []\n[beam.left]\nlength_m = 1.0\nnails = 0x{'f' * 6000}\n")
    (reported,) = READER.problems(document)
    assert reported.startswith("beam.left.nails = beyond all size: ")


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        (f"note = {'9' * 5000}", "not a TOML file that can be read: a number or a date is beyond all size"),
        (f"note = {'[' * 20_000}", "not a TOML file that can be read: it is nested too deep"),
        ("a = 1\nnote = \n\n", "not a TOML file: Invalid value (at line 2, column 8); fix it there: "),
        ('a = 1\nnote = """\n\n', "not a TOML file: Unterminated string (at the end, line 2); fix it there: "),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_by_its_name_and_line(text: str, reported: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        parse_document(text, Path("/etc/robot.toml"))
    (problem,) = caught.value.problems
    assert problem.startswith(f"/etc/robot.toml: {reported}")


def test_of_a_long_sentence_the_key_and_the_bound_are_kept() -> None:
    (reported,) = READER.problems(parse_document(f"rail = '{'x' * 100_000}'"))
    assert len(reported) < 500
    assert reported.startswith("rail = 'xxx") and reported.endswith("must be tables, each under [[rail]]")


def test_a_terminal_obeys_nothing_of_a_sentence() -> None:
    (reported,) = READER.problems(parse_document('rail = []\n"\\u001b[2J\\n" = 1'))
    assert reported == "\\x1b[2J\\n: there is no such key"


def test_a_file_beyond_all_size_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    path.write_bytes(b"#" * LARGEST_FILE_BYTES)
    assert len(read_text(path)) == LARGEST_FILE_BYTES
    path.write_bytes(b"#" * (LARGEST_FILE_BYTES + 1))
    with pytest.raises(ConfigurationError, match="must have at most 100000 bytes"):
        read_text(path)
