"""The walks of an experiment are drawn from the logs in its folder, without the robot's other activities."""

from pathlib import Path

import numpy as np
import pytest

from experiments.trackway.bench import LoggedTime
from experiments.trackway.figures import logged_walk, walk_figures
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.log.log_folder import DONE, first_path, log_files
from firmware_host.log.recorder import Recorder
from logs.files.log_reader import read_log
from simulation.harness.direct import Direct
from simulation.mud.track import paper_track
from tests.recorded_walks import walk_and_hold
from tests.scripted_operator import ScriptedOperator


@pytest.fixture
def walks(tmp_path: Path, configuration: Configuration) -> list[LoggedTime]:
    """Record walks of one and of two strides; the log segments between them are not copied."""
    recorder = Recorder(
        first_path(tmp_path / "logs", "run"),
        configuration.text,
        {"robot": "test", "run_id": "run"},
        LogParameters(directory=str(tmp_path), segment_s=1.0),
    )
    robot = Direct(configuration, paper_track(), recorder=recorder)
    # The writer ends segments between its batches, which cover seconds of a simulation that runs faster than real time.
    logged = [LoggedTime("run", *span_s) for span_s in walk_and_hold(robot, 1, 2, rest_s=15.0)]
    assert recorder.close(20.0)
    stamps_s = {log: read_log(log).ticks["stamp_s"] for log in log_files(tmp_path / "logs", DONE)}
    stamps_s = {log: at_s for log, at_s in stamps_s.items() if at_s.size}  # a busy writer may leave a segment empty
    # With a second of rest before the walk: a segment that begins with a walk's first row may have lost its beginning.
    needed = (logged[0].to_s, logged[1].from_s - 1.0)
    copied = [log for log, at_s in stamps_s.items() if at_s[0] < needed[0] or at_s[-1] > needed[1]]
    assert len(copied) < len(stamps_s)
    for log in copied:
        log.rename(tmp_path / log.name)
    return logged


def test_each_walk_is_drawn_alone_also_where_segments_between_them_are_missing(
    walks: list[LoggedTime], tmp_path: Path
) -> None:
    first, second = (logged_walk(tmp_path, logged) for logged in walks)
    for walk, logged in ((first, walks[0]), (second, walks[1])):
        assert walk.time_s[-1] == pytest.approx(logged.to_s - logged.from_s, abs=0.3)
        assert np.all(np.diff(walk.time_s) < 0.01) and walk.walks == 1 and not walk.cut
    assert (len(first.own_strides), len(second.own_strides)) == (1, 2)
    operator = ScriptedOperator()
    gone = LoggedTime("another", 0.0, 1.0)
    (figure,) = walk_figures({"3 cm, trial 1": walks[1], "5 cm, trial 1": gone}, tmp_path, operator)
    assert figure.name == "figure8_3_cm__trial_1" and figure.caption.startswith("3 cm, trial 1, as figure 8 B to E")
    assert operator.reported == [f"5 cm, trial 1 is not drawn: its log is not in {tmp_path}"]
    assert {"depth (cm)", "body (m)"} <= {panel.get_ylabel() for panel in figure.draw().axes}
