"""Copies contain all segments of a daemon's run that cover an experiment, whole, and can be read by themselves."""

import dataclasses
import errno
import os
import shutil
from pathlib import Path

import pytest

from experiments.robot.log_copies import copy_since
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.log.log_file import LogFile
from firmware_host.log.log_folder import ACTIVE, first_path, segment_path
from firmware_host.log.recorder import Recorder
from logs.files.log_reader import read_log, read_logs
from logs.files.stored_logs import run_files
from logs.replay import replay_files
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from tests.firmware_host.synthetic_rows import OPENING, make_ticks
from tests.recorded_walks import walk_and_hold

SEGMENT_TICKS = 380


@pytest.fixture
def segments(tmp_path: Path) -> list[Path]:
    """Write five segments of a second each; the last one is still being written."""
    first = tmp_path / "logs" / ACTIVE / "run-0000.mcap"
    for number in range(5):
        metadata = OPENING["metadata"] | {"segment": str(number)}
        log = LogFile(segment_path(first, number), OPENING | {"metadata": metadata})
        log.write(make_ticks(number * SEGMENT_TICKS, (number + 1) * SEGMENT_TICKS))
        if number < 4:
            log.finish()
        else:
            log.flush()
    return run_files(first)


@pytest.mark.parametrize(("from_s", "kept"), [(-1.0, 5), (0.0, 5), (2.5, 3), (2.998, 2), (3.0, 2), (4.9, 1), (9.0, 1)])
def test_a_segment_that_ends_before_the_experiment_began_is_left_out(
    segments: list[Path], tmp_path: Path, from_s: float, kept: int
) -> None:
    copies = copy_since(segments, from_s, tmp_path)
    assert [copy.name for copy in copies] == [log.name for log in segments][5 - kept :]
    assert sorted(tmp_path.glob("*.mcap*")) == copies
    assert all(read_log(copy).complete for copy in copies)
    assert len(read_logs(copies).ticks) == kept * SEGMENT_TICKS


def test_a_full_disk_leaves_no_copy_that_is_cut(
    segments: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fill(source: Path, target: Path) -> None:
        target.write_bytes(source.read_bytes()[:1000])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(target))

    monkeypatch.setattr(shutil, "copyfile", fill)
    with pytest.raises(OSError, match="No space left"):
        copy_since(segments, 0.0, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["logs"]


def test_what_is_copied_is_replayed_without_the_segments_before_it(
    tmp_path: Path, configuration: Configuration
) -> None:
    """Another walk and a long rest come before the experiment's own walk."""
    parameters = LogParameters(directory=str(tmp_path / "logs"), segment_s=1.0)
    first = first_path(tmp_path / "logs", "run")
    recorder = Recorder(first, configuration.text, {"robot": "test", "run_id": "run"}, parameters)
    robot = Lockstep(configuration, paper_track(), recorder=recorder)
    _, (begun_s, _) = walk_and_hold(robot, 1, 2, rest_s=1.5)
    assert recorder.close(20.0)
    copies = copy_since(run_files(first), begun_s, tmp_path)
    assert 0 < len(copies) < len(run_files(first)) and copies[0].name != first.name
    live = [stride.estimate for stride in robot.loop.learning.strides][2:]
    replayed = replay_files(copies).strides
    assert [repr(dataclasses.astuple(one)) for one in live] == [repr(dataclasses.astuple(one)) for one in replayed]
