"""A configuration file is changed in place: atomically, only in the requested keys, and never to an invalid file."""

import os
import tomllib
from pathlib import Path

import pytest

from experiments.actuator.file_change import FileChangeError, changed_text, replace_file
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.local_setup import CONFIGURATION

LOCAL = CONFIGURATION.format(left='"l"', right='"r"', logs='"logs"', status='"s"', pose='""')
CONSTANT = ("drive", "right_sweep", "torque_constant_nm_a")
FRICTION = ("friction", "right_sweep", "coulomb_nm")


def table_text(text: str, name: str) -> str:
    """Returns the header and all keys of a table that ends with an empty line."""
    header = f"[{name}]\n"
    _, found, below = text.partition(header)
    assert found
    return header + below.partition("\n\n")[0] + "\n"


def test_a_value_is_changed_and_nothing_else(example_text: str) -> None:
    after = changed_text(example_text, {CONSTANT: 0.0721})
    changed = [pair for pair in zip(example_text.splitlines(), after.splitlines(), strict=True) if pair[0] != pair[1]]
    assert changed == [("torque_constant_nm_a = 0.083", "torque_constant_nm_a = 0.0721")]
    assert parse_configuration(after).drive["right_sweep"].torque_constant_nm_a == 0.0721


def test_a_new_key_is_in_its_own_table_above_the_comments_of_the_next_one() -> None:
    after = changed_text(LOCAL, {("drive", "right_adduction", "torque_constant_nm_a"): 0.072})
    table = table_text(LOCAL, "drive.right_adduction")
    below = "\n# As a calibration of these joints would show.\n"
    assert table + below in LOCAL
    assert after == LOCAL.replace(table + below, table + "torque_constant_nm_a = 0.072\n" + below)


@pytest.mark.parametrize("text", [LOCAL, "example"])
def test_a_new_table_is_made_where_there_is_none(text: str, example_text: str) -> None:
    before = example_text if text == "example" else text.replace(table_text(text, "friction.right_sweep"), "")
    after = changed_text(before, {CONSTANT: 0.0721, FRICTION: 0.012})
    assert parse_configuration(after).friction["right_sweep"].coulomb_nm == 0.012
    kept = [line for line in before.splitlines() if line and line not in after.splitlines()]
    assert kept == []
    comments = [line for line in before.splitlines() if line.startswith("#")]
    assert [line for line in after.splitlines() if line.startswith("#")] == comments


def test_tables_may_be_written_in_any_way() -> None:
    table = table_text(LOCAL, "drive.right_sweep")
    inline = f"drive.right_sweep = {{ {', '.join(table.splitlines()[1:])} }}\n\n{LOCAL.replace(table, '')}"
    assert tomllib.loads(inline) == tomllib.loads(LOCAL)
    after = changed_text(inline, {CONSTANT: 0.0721})
    assert parse_configuration(after).drive["right_sweep"].torque_constant_nm_a == 0.0721


def test_a_change_that_would_be_wrong_is_refused_with_key_value_and_bound(example_text: str) -> None:
    with pytest.raises(FileChangeError, match="cannot be changed"):
        changed_text("[drive", {CONSTANT: 0.07})
    with pytest.raises(FileChangeError, match=r"stays as it is.*right_sweep.torque_constant_nm_a = 99.0: must be"):
        changed_text(example_text, {CONSTANT: 99.0})
    with pytest.raises(FileChangeError, match=r"drive.right_sweep.current_limit_a = 12.0: must be at least 18.75"):
        changed_text(example_text, {CONSTANT: 0.04})


def test_a_file_is_replaced_with_its_permissions_and_the_old_one_remains(tmp_path: Path, example_text: str) -> None:
    path = tmp_path / "mudskipper.toml"
    path.write_text(example_text, encoding="utf-8")
    path.chmod(0o640)
    link = tmp_path / "link.toml"
    link.symlink_to(path)
    after = changed_text(example_text, {CONSTANT: 0.0721})
    backup = replace_file(link, example_text, after)
    assert path.read_text(encoding="utf-8") == after and link.is_symlink()
    assert backup == tmp_path / "mudskipper.toml.before" and backup.read_text(encoding="utf-8") == example_text
    assert path.stat().st_mode & 0o777 == 0o640
    assert sorted(each.name for each in tmp_path.iterdir()) == [
        "link.toml",
        "mudskipper.toml",
        "mudskipper.toml.before",
    ]


def test_a_file_that_changed_meanwhile_or_cannot_be_written_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, text = tmp_path / "mudskipper.toml", "a = 1\n"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileChangeError, match="changed during this command"):
        replace_file(path, "mine = 1\n", "mine = 2\n")

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(FileChangeError, match=r"mudskipper.toml: Permission denied; nothing was changed. It needs"):
        replace_file(path, text, "a = 2\n")
    assert path.read_text(encoding="utf-8") == text
    assert list(tmp_path.iterdir()) == [path]
