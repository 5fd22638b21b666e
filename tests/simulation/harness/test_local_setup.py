"""The robot of a shared computer walks although its drives and its loop are late."""

from pathlib import Path
from random import Random

import pytest

from control.controller import WalkOrder
from control.faults import Reaction
from control.modes import Request
from firmware_host.configuration.loading import load_configuration
from simulation.harness.local_setup import named_folder, write_local_setup
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import Clay
from simulation.mud.track import Track

MOST_LATE_TICKS = 8  # 21 ms: the longer stalls of a busy computer
WALK_S = 6.0


@pytest.fixture
def lockstep(tmp_path: Path) -> Lockstep:
    configuration = load_configuration(write_local_setup(tmp_path, tmp_path / "logs"))
    return Lockstep(configuration, Track([(100.0, Clay("soft", 1200.0))]))


class LateRobot:
    """Stops the simulated robot of a lockstep for `late_ticks`, after which it catches up."""

    def __init__(self, lockstep: Lockstep) -> None:
        self.late_ticks = 0
        self._advance = lockstep.robot.advance
        lockstep.robot.advance = self.advance  # type: ignore[method-assign]

    def advance(self, until_s: float) -> None:
        if self.late_ticks:
            self.late_ticks -= 1
        else:
            self._advance(until_s)


@pytest.mark.parametrize("late", ["loop", "robot"])
def test_neither_a_late_loop_nor_late_drives_end_a_walk(lockstep: Lockstep, late: str) -> None:
    robot, chance, faults = LateRobot(lockstep), Random(1), []
    lockstep.arm()
    assert not lockstep.loop.request(Request.WALK, lockstep.now_s, WalkOrder(0.03, True))
    while lockstep.now_s < WALK_S:
        if chance.random() < 0.02:
            (lockstep if late == "loop" else robot).late_ticks = chance.randint(1, MOST_LATE_TICKS)
        lockstep.step()
        faults += [fault.name for fault in lockstep.loop.faults.begun if fault.kind.reaction > Reaction.WARN]
    assert faults == []
    assert lockstep.loop.controller.target.stride > 1


@pytest.mark.parametrize("name", ["", ".", "..", "a/b"])
def test_a_folder_has_a_plain_name_of_its_own(name: str) -> None:
    with pytest.raises(ValueError, match="plain name"):
        named_folder(name)
