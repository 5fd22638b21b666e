"""A replayed log gives the estimates that the robot had while it walked; the authors' logs are read unchanged."""

import dataclasses
import math
from pathlib import Path

import pytest

from command_line.init.key_reference import toml_value
from control.controller import WalkOrder
from control.modes import Mode
from control.records import StrideEstimate
from experiments.campaign.plate_file import read_corners
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.log_parameters import LogParameters
from firmware_host.log.log_folder import DONE, first_path, log_files
from firmware_host.log.recorder import Recorder
from logs.files.log_error import LogError
from logs.files.log_reader import read_logs
from logs.replay import replay_files
from simulation.harness.drive_presets import calibrated
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from tests.folders import ROOT, SHARED_DATA
from tests.recorded_walks import record_walks

SHARED = SHARED_DATA
LAB_LOGS = sorted((SHARED / "flipper_in_mud").glob("*.csv.gz"))


def same(live: StrideEstimate, replayed: StrideEstimate) -> bool:
    """Return whether both agree to the last digit; NaN equals NaN."""
    return repr(dataclasses.astuple(live)) == repr(dataclasses.astuple(replayed))


def same_strides(robot: Lockstep, paths: list[Path], configuration: Configuration | None = None) -> list[bool]:
    """Return for each stride whether its replay agrees with the robot's own estimate."""
    live = [stride.estimate for stride in robot.loop.learning.strides]
    replayed = replay_files(paths, configuration).strides
    return [same(one, other) for one, other in zip(live, replayed, strict=True)]


def test_a_replayed_walk_gives_the_same_strides_to_the_last_digit(walked_twice: tuple[Path, Lockstep]) -> None:
    path, robot = walked_twice  # the second walk in one log begins afresh
    assert same_strides(robot, [path]) == [True] * 6


def test_a_log_carries_the_shape_of_the_plate(tmp_path: Path, example_text: str) -> None:
    corners = read_corners(ROOT / "examples" / "plates" / "paddle.csv")
    lines = [line for line in example_text.splitlines() if not line.startswith(("plate_width_m", "plate_height_m"))]
    text = "\n".join(lines).replace("[geometry]", f"[geometry]\nplate_corners_m = {toml_value(corners)}")
    path = tmp_path / "walk.mcap"
    robot = record_walks(path, parse_configuration(calibrated(text)), 1)
    assert same_strides(robot, [path]) == [True] * 2
    assert same_strides(robot, [path], parse_configuration(example_text)) == [False] * 2


def test_a_log_that_was_thinned_and_cut_into_segments_gives_the_same_strides(
    tmp_path: Path, configuration: Configuration
) -> None:
    """The log begins with a long rest, of which few ticks are written, and has a new segment every 1.5 s."""
    parameters = LogParameters(directory=str(tmp_path), segment_s=1.5)
    first = first_path(tmp_path, "run")
    recorder = Recorder(first, configuration.text, {"robot": "test", "run_id": "run"}, parameters)
    robot = Lockstep(configuration, paper_track(), recorder=recorder)
    robot.run_for(14.0)
    robot.arm()
    robot.walk(WalkOrder(0.03, True, 1))
    robot.run_until(lambda: robot.loop.mode is Mode.HOLD, 20.0)
    assert recorder.close(20.0) and recorder.dropped == 0
    paths = log_files(tmp_path, DONE)
    assert len(paths) > 3
    assert len(read_logs(paths).ticks) < robot.tick_number - 1000
    assert same_strides(robot, paths) == [True] * 2


# First strokes in undisturbed mud, ranges over all trials measured with the published formula: mud-physics 1.5. The
# extraction peak is a single sample, so it is allowed the noise of one, 0.3 N, beyond the range.
MEASURED = {
    "single_12.5N": ((2.3, 2.9), (7.4, 8.3), (-2.6, -1.6)),
    "single_12N": ((1.9, 3.0), (7.0, 8.3), (-2.9, -1.4)),
    "single_10.3N": ((2.1, 2.6), (6.3, 6.6), (-2.6, -1.7)),
}


@pytest.mark.skipif(not LAB_LOGS, reason="the shared measurements are not next to the repository")
@pytest.mark.parametrize("mud", MEASURED)
def test_first_strokes_have_the_sizes_that_were_measured(mud: str) -> None:
    insertion_n, stance_n, extraction_n = MEASURED[mud]
    logs = [path for path in LAB_LOGS if path.name.startswith(f"{mud}_")]
    assert len(logs) >= 2
    for path in logs:
        first = replay_files([path], method="paper").strides[0]
        assert insertion_n[0] <= first.insertion_force_n <= insertion_n[1], path.name
        assert stance_n[0] <= first.stance_force_n <= stance_n[1], path.name
        assert extraction_n[0] <= first.extraction_force_n <= extraction_n[1], path.name


def test_a_file_of_another_kind_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"notes\.txt: not a log"):
        replay_files([tmp_path / "notes.txt"])


def test_estimates_of_an_absent_flipper_are_left_out() -> None:
    single = [path for path in LAB_LOGS if path.name.startswith("single")]
    if not single:
        pytest.skip("the shared measurements are not next to the repository")
    replayed = replay_files([single[0]])
    assert replayed.flippers == ("right",)
    assert {stride.flipper for stride in replayed.strides} == {"right"}
    assert math.isnan(replayed.strides[0].step_m)
