"""A walk from this project's log agrees with the log's rows, and one from an authors' log agrees with the replay."""

import gzip
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from pandas import read_csv

from control.modes import Mode
from experiments.pictures.recorded_walk import read_walk
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import Recorder
from logs.files.log_error import LogError
from logs.files.log_reader import read_log
from logs.lab.export import write_lab_csv
from logs.lab.lab_csv import read_lab_csv
from logs.replay import replay_files
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track


@pytest.fixture(scope="module")
def as_csv(two_walks: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("csv") / "two.csv.gz"
    text = StringIO()
    write_lab_csv(read_log(two_walks), text)
    path.write_bytes(gzip.compress(text.getvalue().encode()))
    return path


def test_a_walk_is_the_rows_of_its_mode(two_walks: Path) -> None:
    log, walks = read_log(two_walks), [read_walk(two_walks, number) for number in (1, 2)]
    walking = log.ticks[log.ticks["mode"] == Mode.WALKING]
    assert len(walks[0].time_s) + len(walks[1].time_s) == len(walking)
    for walk, ticks in zip(walks, (walking[: len(walks[0].time_s)], walking[len(walks[0].time_s) :]), strict=True):
        assert walk.time_s[0] == 0.0 and walk.walks == 2 and walk.complete
        of_walk = [walk.time_s, walk.sweep_angle_rad, walk.adduction_angle_rad, walk.force_z_n, walk.body_x_m]
        time_s, angles_rad = ticks["stamp_s"] - ticks["stamp_s"][0], ticks["angle_rad"]
        of_log = [time_s, angles_rad[:, 2], angles_rad[:, 3], ticks["force_z_n"][:, 1], ticks["body_x_m"]]
        np.testing.assert_array_equal(of_walk, of_log)


def test_every_stride_belongs_to_one_walk_and_the_last_walk_is_shown_unless_another_is_named(two_walks: Path) -> None:
    walks = [read_walk(two_walks, number) for number in (1, 2)]
    assert [[stride["index"] for stride in walk.own_strides] for walk in walks] == [[0, 1], [0]]
    assert sum(len(walk.strides) for walk in walks) == len(read_log(two_walks).strides)
    assert all(0.0 < s["t_start_s"] < s["stamp_s"] <= walk.time_s[-1] for walk in walks for s in walk.strides)
    assert len(read_walk(two_walks).own_strides) == 1
    with pytest.raises(LogError):
        read_walk(two_walks, 3)


def test_a_mud_begins_with_the_stride_that_revealed_it(two_walks: Path) -> None:
    strides = [
        {"flipper": 1, "t_start_s": 1.0, "stamp_s": 2.0},
        {"flipper": 0, "t_start_s": 2.9, "stamp_s": 4.0},
        {"flipper": 1, "t_start_s": 3.0, "stamp_s": 4.0},
        {"flipper": 1, "t_start_s": 5.0, "stamp_s": 6.0},
    ]
    walk = read_walk(two_walks)._replace(strides=strides, noticed_s=[4.0])
    assert walk.mud_starts_s == [3.0]
    assert walk._replace(noticed_s=[0.5, 6.0]).mud_starts_s == [0.5, 5.0]


def test_a_log_without_a_walk_says_so(tmp_path: Path, configuration: Configuration) -> None:
    path = tmp_path / "idle.mcap"
    recorder = Recorder(path, configuration.text, {"robot": "test"})
    Lockstep(configuration, paper_track(), recorder=recorder).run_for(0.1)
    assert recorder.close(20.0)
    with pytest.raises(LogError, match="there is no walk"):
        read_walk(path)


# the authors' form


def test_strides_of_the_authors_form_are_those_of_the_replay(as_csv: Path) -> None:
    walk, replayed = read_walk(as_csv), replay_files([as_csv]).strides
    start_s = float(read_lab_csv(as_csv).stamp_s[0])
    assert len(walk.strides) == len(replayed) > 2
    for stride, estimate in zip(walk.strides, replayed, strict=True):
        assert (stride["index"], ("left", "right")[stride["flipper"]]) == (estimate.index, estimate.flipper)
        assert stride["stamp_s"] + start_s == estimate.t_end_s
        np.testing.assert_array_equal(
            [stride["k_p"], stride["k_s"], stride["k_e"], stride["step_m"], stride["k_p_std_error"]],
            [estimate.k_p.value, estimate.k_s.value, estimate.k_e.value, estimate.step_m, estimate.k_p.std_error],
        )
        assert stride["released"] == estimate.released


def test_what_the_authors_form_does_not_hold_is_named(as_csv: Path, tmp_path: Path) -> None:
    path, table = tmp_path / "bare.csv", read_csv(as_csv, skiprows=2)
    bare = table[[name for name in table if not name.startswith(("Optitrack", "insertiondepth"))]]
    path.write_text(f"# gait header: scenario | turtle\n{bare.to_csv(index=False)}", encoding="utf-8")
    walk = read_walk(path)
    assert walk.missing == ["the position of the body, so no steps", "the commanded depth"]
    assert read_walk(as_csv).missing == []


def test_one_flipper_alone_is_the_one_shown(as_csv: Path, tmp_path: Path) -> None:
    path, table = tmp_path / "left.csv", read_csv(as_csv, skiprows=2)
    table[[name for name in table if name.startswith("right")]] = 0
    head = gzip.decompress(as_csv.read_bytes()).decode().splitlines()[:2]
    path.write_text("\n".join([*head, table.to_csv(index=False)]), encoding="utf-8")
    walk = read_walk(path)
    assert walk.flipper == "left"
    assert walk.strides == walk.own_strides != []
