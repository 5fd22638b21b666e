"""Every measurement is written to the disk and is read again when the same experiment continues."""

from pathlib import Path

import pytest

from experiments.study.notebook import NAME, Notebook, NotebookError
from experiments.study.results_folder import remove_unused

PLAN = {"weights_g": (10, 20), "joint": "right_sweep"}


def test_what_was_measured_is_there_again(tmp_path: Path) -> None:
    first = Notebook(tmp_path / "new", PLAN)
    assert not first.entries
    for key, torque_nm in (("10 g", 0.1), ("20 g", 0.2), ("10 g", 0.11)):
        first.write(key, {"torque_nm": torque_nm})
    first.forget("20 g")
    assert Notebook(tmp_path / "new", PLAN).entries == first.entries == {"10 g": {"torque_nm": 0.11}}


def test_another_plan_is_refused_with_what_differs(tmp_path: Path) -> None:
    Notebook(tmp_path, PLAN).write("10 g", {})
    with pytest.raises(NotebookError, match=r"joint = right_sweep, .*joint = left_sweep: .*--out, .*--restart"):
        Notebook(tmp_path, PLAN | {"joint": "left_sweep"})


@pytest.mark.parametrize("cut", (1, 2, 20, 39))
def test_a_line_that_was_cut_off_costs_itself_alone(tmp_path: Path, cut: int) -> None:
    notebook = Notebook(tmp_path, PLAN)
    notebook.write("10 g", {"torque_nm": 0.1})
    notebook.write("20 g", {"torque_nm": 0.2})
    contents = notebook.path.read_bytes()
    notebook.path.write_bytes(contents[:-cut])
    again = Notebook(tmp_path, PLAN)
    assert set(again.entries) == ({"10 g", "20 g"} if cut == 1 else {"10 g"})  # only the newline is missing
    again.write("50 g", {"torque_nm": 0.5})
    assert set(Notebook(tmp_path, PLAN).entries) == set(again.entries) >= {"10 g", "50 g"}


@pytest.mark.parametrize("contents", ["hello\n", "\nhello\n", "[1]\n", '{"key": "10 g", "entry": {}}\n'])
def test_a_file_that_is_no_notebook_is_left_alone(tmp_path: Path, contents: str) -> None:
    (tmp_path / NAME).write_text(contents, encoding="utf-8")
    with pytest.raises(NotebookError, match="no notebook of an experiment: choose another folder"):
        Notebook(tmp_path, PLAN)
    assert (tmp_path / NAME).read_text(encoding="utf-8") == contents


@pytest.mark.parametrize("left", ["", "\n", '{"plan": {"wei', '{"plan": {"joint": "left_sweep"}}\n'])
def test_where_nothing_was_measured_another_plan_may_begin(tmp_path: Path, left: str) -> None:
    (tmp_path / NAME).write_text(left, encoding="utf-8")
    Notebook(tmp_path, PLAN).write("10 g", {"torque_nm": 0.1})
    assert Notebook(tmp_path, PLAN).entries == {"10 g": {"torque_nm": 0.1}}


@pytest.mark.parametrize("joint", ["", "right_sweep"])
def test_a_new_folder_goes_again_where_nothing_was_measured_and_stays_with_a_measurement(
    tmp_path: Path, joint: str
) -> None:
    empty, measured = tmp_path / "empty", tmp_path / "measured"
    Notebook(empty / joint, PLAN)
    Notebook(measured / joint, PLAN).write("10 g", {})
    for folder in (empty, measured):
        remove_unused(folder)
    assert not empty.exists() and Notebook(measured / joint, PLAN).entries == {"10 g": {}}
