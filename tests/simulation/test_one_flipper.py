"""A rig with one flipper and two motors runs everything that four motors run: loop, log, replay and viewers."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line.live.page_server import robot_facts
from command_line.watch.feed import updated
from command_line.watch.history import History
from command_line.watch.mud_cells import coefficient_rows
from control.controller import WalkOrder
from control.modes import Mode
from control.records import Phase, Rig, StrideEstimate
from experiments.pictures.recorded_walk import numbered_walk
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from firmware_host.log.rows import TICK, rig_of, tick_kind
from logs.files.log_error import LogError
from logs.files.log_reader import Log, read_log
from logs.flat_columns import flat_columns
from logs.lab.export import write_lab_csv
from logs.lab.lab_csv import read_lab_csv
from logs.recovery import recover_log
from logs.replay import replay_log
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import Lockstep, plant_of
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

FIXED = "[estimation]\nfixed_base = true\n"
STRIDES = 2
RIGHT = Rig(("right",))
TRACK = Track([(9.0, MUDS["48.5"])])
Walked = tuple[Log, list[StrideEstimate], dict[str, Any]]


def configured(sections: str = FIXED) -> Configuration:
    return simulated_configuration(sections, rig=RIGHT)


def walk(lockstep: Lockstep, strides: int = STRIDES, depth_m: float = 0.03) -> list[StrideEstimate]:
    lockstep.arm()
    lockstep.walk(WalkOrder(depth_m, strides=strides))
    assert lockstep.run_until(lambda: lockstep.loop.mode is Mode.HOLD, 30.0), lockstep.loop.fault
    return [closed.estimate for closed in lockstep.loop.learning.strides]


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Walked:
    """Return the log of a walk on a fixed base, the strides that the loop closed in it, and the last status."""
    configuration, path = configured(), tmp_path_factory.mktemp("one") / "walk.mcap"
    recorder = FileRecorder(path, configuration)
    lockstep = Lockstep(configuration, TRACK, recorder=recorder, fixed_base=True)
    strides = walk(lockstep)
    status = LockstepRobot(lockstep, recorder).call("status")
    recorder.close()
    return read_log(path), strides, status


def test_it_walks_on_a_fixed_base_and_learns_the_mud(walked: Walked) -> None:
    _, strides, status = walked
    assert [(stride.flipper, stride.index) for stride in strides] == [("right", index) for index in range(STRIDES)]
    assert all(stride.k_p.valid and stride.k_s.valid and stride.k_e.valid for stride in strides)
    assert [drive["joint"] for drive in status["drives"]] == ["right_sweep", "right_adduction"]
    assert status["loads"].keys() == {"right"} == status["mud"].keys() - {"k_p", "k_s", "k_e", "boundary", "law"}


def test_its_log_names_its_joints_and_replays_to_the_last_digit_with_its_own_rig(walked: Walked) -> None:
    log, strides, _ = walked
    assert log.rig == RIGHT and not log.unknown_fields and not log.missing_fields
    assert log.ticks["angle_rad"].shape[1:] == (2,) and log.ticks["force_x_n"].shape[1:] == (1,)
    replayed = replay_log(Path("log"), log)
    assert replayed.flippers == RIGHT.flippers
    assert repr(replayed.strides) == repr(strides)
    names = {column.name for column in flat_columns(log.ticks, tick_kind(log.rig))}
    assert names >= {"right_adduction_current_a", "right_force_z_n"}
    with pytest.raises(LogError, match="rig.flippers"):
        replay_log(Path("log"), log, simulated_configuration(FIXED))


def test_the_metadata_of_the_rows_names_the_flippers() -> None:
    for rig in (Rig(), RIGHT, Rig(("left",))):
        assert rig_of(tick_kind(rig).metadata) == rig
    assert rig_of({}) == Rig() and tick_kind(Rig()) is TICK


def test_one_flipper_moves_a_body_on_a_rail() -> None:
    configuration = configured(sections="")
    plant = plant_of(configuration, rail_drag_n=1.0, pad_width_m=0.0)  # the paper's drag needs two flippers
    lockstep = Lockstep(configuration, TRACK, plant=plant)
    walk(lockstep, depth_m=0.04)
    assert lockstep.robot.plant.body_m > 0.05


def test_viewers_show_the_flippers_that_there_are(walked: Walked, tmp_path: Path) -> None:
    log, _, status = walked
    row = {name: log.ticks[name][-1] for name in log.ticks.dtype.names or ()}
    history = History()
    history.add_status(updated(status, row), 0.0)
    assert [len(row) for row in coefficient_rows(history, list(status["loads"]))] == [4, 4, 4]
    assert robot_facts(log.configuration_text)["flippers"] == RIGHT.flippers
    numbered = numbered_walk(Path("log"), log)
    assert [side.flipper for side in numbered.sides] == ["right"] and np.isfinite(numbered.depth_m[-1])
    with (tmp_path / "walk.csv").open("w", encoding="utf-8") as file:
        write_lab_csv(log, file)
    assert read_lab_csv(tmp_path / "walk.csv").flippers == RIGHT.flippers


def test_an_interrupted_log_is_recovered_with_its_rig(tmp_path: Path) -> None:
    recorder = FileRecorder(tmp_path / "cut.mcap", configured())
    Lockstep(configured(), TRACK, recorder=recorder).run_for(0.5)
    recorder.flush()
    recorder._file._file.close()
    log = read_log(recover_log(tmp_path / "cut.mcap").path)
    assert log.rig == RIGHT and len(log.ticks) == 190 and set(log.ticks["phase"]) == {Phase.REST}


@pytest.mark.parametrize(
    ("replaced", "by", "key"),
    [
        ("[drive.right_sweep]", "[drive.left_sweep]", "drive.right_sweep"),
        ('["right"]', '["left", "right"]', "drive.left_sweep"),
        *(
            ('["right"]', flippers, "rig.flippers")
            for flippers in ("[]", '["right", "right"]', '["middle"]', '"right"')
        ),
        ("[friction.right_sweep]", "[friction.left_sweep]", "friction.left_sweep"),
    ],
)
def test_a_rig_without_its_drives_is_refused(replaced: str, by: str, key: str) -> None:
    text = configured().text
    assert replaced in text
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text.replace(replaced, by))
    assert caught.value.problems[0].startswith(key)
