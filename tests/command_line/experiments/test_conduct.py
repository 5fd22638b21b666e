"""Conducting an experiment: prompts on the terminal, the report, and how each ending is reported."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from errno import ENOSPC
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated

import pytest
from pandas import DataFrame

from command_line import exit_codes
from command_line.experiments import studies
from command_line.experiments.terminal_prompt import TerminalPrompt
from experiments.robot.bench_errors import AccessDeniedError, BenchError, DaemonLostError, EndedError
from experiments.study import provenance
from experiments.study.notebook import NAME, Notebook
from experiments.study.option import Option
from experiments.study.result import Result, Table
from experiments.study.session import Session

STUDY = "experiments.reports.value_text"  # any module of the product
ANSWERS = {"": "it hangs", "s": "skip it", "r": "the last one again"}


@contextmanager
def typed(monkeypatch: pytest.MonkeyPatch, text: str) -> Iterator[None]:
    """Provides a standard input that contains the text and then ends."""
    source, sink = os.pipe()
    os.write(sink, text.encode())
    os.close(sink)
    with open(source, encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        yield


def nothing() -> None:
    pass


def test_an_answer_is_asked_for_until_it_is_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with typed(monkeypatch, "what\nS\n"):
        assert TerminalPrompt().ask("Hang 10 g on it.", ANSWERS, nothing) == "s"
    printed, said = capsys.readouterr()
    assert not printed and said.count("Hang 10 g on it.\n  [Enter: it hangs, s: skip it, r: the last one again]") == 2
    assert "'what' is none of the answers" in said


def test_a_number_is_asked_for_until_it_is_within_its_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    with typed(monkeypatch, "many\nnan\n99\n2,5\n"):
        assert TerminalPrompt().ask_number("How far?", 1.0, 5.0, nothing) == 2.5


def test_answers_that_come_together_through_an_open_pipe_all_count(monkeypatch: pytest.MonkeyPatch) -> None:
    source, sink = os.pipe()
    os.write(sink, b"s\nr\n")
    with open(source, encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        prompt = TerminalPrompt()
        # the second one is there: a prompt that waited for it would close the pipe, and get the end of the input
        answers = [prompt.ask("Well?", ANSWERS, nothing), prompt.ask("Well?", ANSWERS, lambda: os.close(sink))]
    os.close(sink)
    assert answers == ["s", "r"]


def test_the_robot_is_attended_until_an_answer_comes_that_was_typed_after_the_question(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    keyboard, terminal = os.openpty()
    os.write(keyboard, b"\n\n")  # typed before the question, while the robot still walked
    looks: list[int] = []

    def look() -> None:
        looks.append(1)
        if len(looks) == 3:
            os.write(keyboard, b"s\n")

    with open(terminal, encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        assert TerminalPrompt().ask("Are your hands out of the mud?", ANSWERS, look) == "s"
    os.close(keyboard)
    assert len(looks) == 3


def test_the_end_of_the_input_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    with typed(monkeypatch, ""), pytest.raises(EndedError, match="run this on a terminal"):
        TerminalPrompt().ask("Well?", ANSWERS, nothing)


def conduct(run: Callable[[Session], Result], folder: Path | None, **options: object) -> int:
    """Run an experiment in place of the one that the options name."""
    given = {"out": folder, "restart": False, "json": False, "simulated": True} | options

    def study(session: Session, *, trials: Annotated[int, Option("of each")] = 1) -> Result:
        return run(session)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(studies, "load_study", lambda name: SimpleNamespace(__name__=STUDY, study=study))
        return studies.run_study("walk", argparse.Namespace(**given))


def found(session: Session) -> Result:
    session.operator.report(session.operator.ask("Well?", ANSWERS, nothing) or "it hangs")
    table = Table("values", "A table", {}, DataFrame({"value": [1.0]}))
    return Result([table], summary={"value": 1.0}, title="A trial")


def test_it_ends_in_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert conduct(found, tmp_path / "out") == exit_codes.OK
    said = capsys.readouterr()
    assert said.out == "A table\nvalue\n1\n" and "report.html" in said.err
    assert json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["value"] == 1.0


def test_json_alone_goes_to_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run(session: Session) -> Result:
        session.show(1, 2)
        session.operator.report("half of it")
        return found(session)

    conduct(run, tmp_path, json=True)
    said = capsys.readouterr()
    report = json.loads(said.out)
    assert report["schema"] == "experiment-walk/1" and report["value"] == 1.0 and report["simulated"] is True
    assert said.err.splitlines()[0] == "half of it"  # standard error is no terminal, so no progress bar either
    assert not {"\033", "\r"} & set(said.err)


def test_without_a_folder_each_run_makes_one_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("mudskipper-walk", "mudskipper-walk-2", "mudskipper-walk-3"):
        assert conduct(found, None) == exit_codes.OK
        assert (tmp_path / name / "report.html").exists()


def test_a_new_folder_in_which_nothing_was_measured_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(session: Session) -> Result:
        Notebook(session.folder, {})
        raise DaemonLostError("no daemon answers")

    monkeypatch.chdir(tmp_path)
    assert conduct(run, None) == exit_codes.NO_DAEMON
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("problem", "status", "message"),
    [
        (BenchError("the robot no longer holds"), exit_codes.REFUSED, "the robot no longer holds"),
        (AccessDeniedError("only for members"), exit_codes.NOT_PERMITTED, "only for members"),
        (KeyboardInterrupt(), exit_codes.INTERRUPTED, "interrupted"),
        (OSError(ENOSPC, "No space left on device"), exit_codes.UNHEALTHY, ": No space left on device"),
    ],
)
def test_measurements_remain_however_the_experiment_ends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], problem: BaseException, status: int, message: str
) -> None:
    def run(session: Session) -> Result:
        Notebook(session.folder, {}).write("10 g", {"torque_nm": 0.1})
        raise problem

    assert conduct(run, tmp_path) == status
    said = capsys.readouterr().err
    assert message in said and "the same command" in said
    assert Notebook(tmp_path, {}).entries


# finished, continued, begun again


def measured_by(trials: int, calls: list[int]) -> Callable[[Session], Result]:
    """Return an experiment that measures what is missing, under the session's version and sources."""

    def run(session: Session) -> Result:
        notebook = Notebook(session.folder, {"depth_m": 0.03, **session.program})
        for number in range(trials):
            if str(number) not in notebook.entries:
                calls.append(number)
                notebook.write(str(number), {})
        return Result(summary={"trials": trials})

    return run


def test_a_finished_experiment_is_refused_and_with_more_trials_it_continues(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = list[int]()

    def conduct_with(trials: int) -> int:
        return conduct(measured_by(trials, calls), tmp_path, trials=trials)

    assert conduct_with(2) == exit_codes.OK
    finished = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert conduct_with(2) == exit_codes.REFUSED
    said = capsys.readouterr().err
    record = finished["provenance"]
    assert record["date"] in said and record["version"] in said and "--restart" in said and "--out" in said
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8")) == finished
    assert conduct_with(3) == exit_codes.OK and calls == [0, 1, 2]
    (tmp_path / "report.html").unlink()  # as if its end had failed
    assert conduct_with(3) == exit_codes.OK and calls == [0, 1, 2]


def test_only_an_experiment_that_ends_says_that_nothing_was_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def ends(session: Session) -> Result:
        raise EndedError("the operator ends")

    for run, trials, said in ((measured_by(2, []), 2, False), (ends, 3, False), (measured_by(1, []), 1, True)):
        conduct(run, tmp_path, trials=trials)
        assert ("had every measurement already" in capsys.readouterr().err) is said


def test_another_version_and_other_sources_are_refused_and_the_same_continue(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def continued() -> int:
        (tmp_path / "report.html").unlink(missing_ok=True)  # an experiment that is not finished
        return conduct(measured_by(1, []), tmp_path)

    assert continued() == continued() == exit_codes.OK
    before = (tmp_path / NAME).read_bytes()
    for name, value in (("software_version", "9.9"), ("source_digest", "0123")):
        with monkeypatch.context() as patch:
            patch.setattr(provenance, name, lambda *_, value=value: value)
            capsys.readouterr()
            assert continued() == exit_codes.REFUSED
        said = capsys.readouterr().err
        assert f"= {value}" in said and "--restart" in said and "--out" in said
    assert continued() == exit_codes.OK and (tmp_path / NAME).read_bytes() == before


def test_restart_begins_again_and_keeps_the_earlier_results(tmp_path: Path) -> None:
    calls, folder = list[int](), tmp_path / "out"
    for names in (["out"], ["out", "out-old"], ["out", "out-old", "out-old-2"]):
        assert conduct(measured_by(1, calls), folder, restart=True) == exit_codes.OK
        assert sorted(each.name for each in tmp_path.iterdir()) == names
        assert all((tmp_path / name / "report.html").exists() and (tmp_path / name / NAME).exists() for name in names)
    assert calls == [0, 0, 0]


def test_restart_in_the_working_directory_leaves_its_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, calls = tmp_path / "out", list[int]()
    folder.mkdir()
    monkeypatch.chdir(folder)
    for _ in range(2):
        assert conduct(measured_by(1, calls), Path(), restart=True) == exit_codes.OK
    assert calls == [0, 0] and (tmp_path / "out-old" / NAME).exists() and (folder / NAME).exists()
