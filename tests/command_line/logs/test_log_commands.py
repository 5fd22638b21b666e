"""Commands that read logs print text for an operator and JSON for a program."""

import shlex
import subprocess
import sys
from dataclasses import replace
from fcntl import LOCK_EX, flock
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from command_line import exit_codes, screen
from command_line.main import main
from experiments.pictures.recorded_walk import read_walk
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.log_parameters import ONE_FILE
from firmware_host.log.log_folder import ACTIVE, DONE, first_path, log_files
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.segments import LogSegments
from logs.files.log_reader import read_log
from logs.lab.export import write_lab_csv
from logs.lab.lab_csv import read_lab_csv
from tests.command_line.command_lines import json_of, output, refusal, run, run_process
from tests.recorded_walks import record_walks


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory, configuration: Configuration) -> Path:
    """Record a walk of two strides."""
    path = tmp_path_factory.mktemp("logs") / "walk.mcap"
    record_walks(path, configuration, 2)
    return path


def test_log_info_counts(walk: Path) -> None:
    reported = json_of("log", "info", str(walk))
    assert reported["robot"] == "test" and reported["complete"] is True
    assert reported["missed_ticks"] == 0 and reported["strides"] == 4
    assert reported["unknown_fields"] == [] and 0 < reported["rows"] <= reported["ticks"]
    lines = dict(line.split(maxsplit=1) for line in output("log", "info", str(walk)).splitlines())
    assert lines["complete"] == "yes" and lines["unknown_fields"] == "-"
    assert lines["rate_hz"].startswith("380")


def test_replay_shows_the_depth_that_the_robot_chose(walk: Path) -> None:
    chosen_m = [stride["chosen_depth_m"] for stride in read_log(walk).strides]
    strides = json_of("replay", str(walk))["strides"]
    assert [stride["chosen_depth_m"] for stride in strides] == chosen_m
    for line, depth_m in zip(output("replay", str(walk)).splitlines()[2:], chosen_m, strict=True):
        assert f" {100.0 * depth_m:.2f} " in line


def test_an_exported_log_replays_like_the_log(walk: Path, tmp_path: Path) -> None:
    """Small differences remain because the authors' columns have neither velocities nor the arm's weight."""
    path = tmp_path / "walk.csv"
    output("log", "export", str(walk), "--csv", "--out", str(path))
    assert path.read_text(encoding="utf-8").splitlines()[2].startswith("time,turtle_state,leftadduction_pos")
    ours = json_of("replay", str(walk))["strides"]
    theirs = json_of("replay", str(path))["strides"]
    assert [stride["index"] for stride in ours] == [stride["index"] for stride in theirs]
    for one, other in zip(ours, theirs, strict=True):
        assert other["k_s"]["value"] == pytest.approx(one["k_s"]["value"], rel=0.1)
        assert other["stance_force_n"] == pytest.approx(one["stance_force_n"], abs=0.5)


def test_an_exported_walk_backward_reads_back_as_one(walk: Path, tmp_path: Path) -> None:
    """The authors' columns have no signs of their own: a setting tells it from the walk forward that mirrors it."""
    log, path = read_log(walk), tmp_path / "walk.csv"
    mirrored = log.ticks.copy()
    for name in ("angle_rad", "current_a"):
        mirrored[name][:, ::2] *= -1.0
    mirrored["body_x_m"] *= -1.0
    with path.open("w", encoding="utf-8") as file:
        write_lab_csv(log._replace(ticks=mirrored), file)
    output("log", "export", str(walk), "--csv", "--out", str(tmp_path / "forward.csv"))
    forward, backward = read_lab_csv(tmp_path / "forward.csv"), read_lab_csv(path)
    assert np.allclose(backward.angle_rad, forward.angle_rad * [-1, 1, -1, 1], equal_nan=True)
    assert np.allclose(backward.current_a, forward.current_a * [-1, 1, -1, 1], equal_nan=True)
    assert np.allclose(backward.body_x_m, -forward.body_x_m, equal_nan=True)


@pytest.fixture(scope="module")
def segments(walk: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Write the same walk as files of two seconds."""
    folder = tmp_path_factory.mktemp("segments")
    topics = [kind.topic for kind in ROW_KINDS]
    with walk.open("rb") as file:
        messages = make_reader(file).iter_messages(log_time_order=False)
        rows = [(topics.index(channel.topic), message.data) for _, channel, message in messages]
    parameters = replace(ONE_FILE, segment_s=2.0)
    opening = {"configuration_text": read_log(walk).configuration_text, "metadata": {"robot": "test", "run_id": "run"}}
    log = LogSegments(first_path(folder, "run"), opening, parameters)
    for place in range(0, len(rows), 50):
        log.write(rows[place : place + 50])
    assert log.close()
    return log_files(folder, DONE)


def test_segments_of_a_run_are_drawn_and_counted_as_one_log(walk: Path, segments: list[Path], tmp_path: Path) -> None:
    paths = [*map(str, segments)]
    assert len(paths) > 2
    whole, joined = read_walk(walk), read_walk(segments[0], 0, segments[1:])
    assert np.array_equal(whole.sweep_angle_rad, joined.sweep_angle_rad)
    assert (repr(joined.strides), joined.cut) == (repr(whole.strides), "")
    assert run("plot", *paths, "--out", str(tmp_path / "walk.png")).stderr == ""
    assert json_of("log", "info", *paths)["strides"] == 4


def test_a_walk_over_a_border_of_segments_is_reported(segments: list[Path], tmp_path: Path) -> None:
    drawn = run("plot", str(segments[1]), "--out", str(tmp_path / "walk.png")).stderr
    assert "before segment 1" in drawn and "next segment" in drawn
    assert "segments before 1" in run("replay", str(segments[1])).stderr
    assert "segments before" not in run("replay", str(segments[0])).stderr


def test_a_picture_of_a_log_that_is_being_written_is_not_left_next_to_it(
    walk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for place in (ACTIVE, "here"):
        (tmp_path / place).mkdir()
    monkeypatch.chdir(tmp_path / "here")
    path = tmp_path / ACTIVE / "walk.mcap"
    path.write_bytes(walk.read_bytes()[:-1000])
    assert "was cut off" in run("plot", str(path)).stderr  # no writer holds its lock
    assert (tmp_path / "here" / "walk.png").exists()
    with path.open("rb") as writer:
        flock(writer.fileno(), LOCK_EX)
        assert "still being written" in run("replay", str(path)).stderr
    (tmp_path / DONE).mkdir()
    output("plot", str(path))
    assert (tmp_path / DONE / "walk.png").exists()
    assert list((tmp_path / ACTIVE).iterdir()) == [path]


@pytest.mark.parametrize(
    ("command", "word"),
    [
        (("replay",), "ticks replayed"),
        (("log", "info"), "kB read"),
        (("log", "export", "--csv", "--out", "/dev/null"), "rows written"),
    ],
)
def test_a_command_that_takes_its_time_says_how_far_it_is(
    walk: Path, command: tuple[str, ...], word: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(screen, "REFRESH_S", 0.0)
    assert main([*command, str(walk)]) == exit_codes.OK
    assert word not in capsys.readouterr().err  # a quick command shows no progress
    monkeypatch.setattr(screen, "QUIET_S", 1e-9)
    assert main([*command, str(walk)]) == exit_codes.OK
    assert word in capsys.readouterr().err


def test_a_reader_that_stops_reading_is_no_error(walk: Path) -> None:
    command = shlex.join([sys.executable, "-m", "command_line.main", "log", "export", str(walk), "--csv"])
    ended = subprocess.run(f"{command} | head -n 3", shell=True, capture_output=True, text=True, check=False)
    assert len(ended.stdout.splitlines()) == 3 and ended.stderr == ""


def test_an_export_never_overwrites_its_own_log(walk: Path) -> None:
    before = walk.read_bytes()
    assert "is the log itself" in refusal("log", "export", str(walk), "--csv", "--out", str(walk))
    assert walk.read_bytes() == before


def test_a_terminal_without_unicode_gets_question_marks(walk: Path) -> None:
    ended = run_process("replay", str(walk), PYTHONUTF8="0", LC_ALL="C", PYTHONIOENCODING="ascii")
    assert ended.returncode == exit_codes.OK and "N/cm?" in ended.stdout and ended.stderr == ""


def test_numbers_beyond_all_measure_are_shown_as_unknown(tmp_path: Path, walk: Path) -> None:
    lines = output("log", "export", str(walk), "--csv").splitlines()
    column = lines[2].split(",").index("rightsweeping_curr")
    rows = [line.split(",") for line in lines[3:]]
    for row in rows[::50]:
        row[column] = "1e154"
    path = tmp_path / "huge.csv"
    path.write_text("\n".join(lines[:3] + [",".join(row) for row in rows]), encoding="utf-8")
    output("replay", str(path))
