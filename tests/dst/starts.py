"""Sound robots at the states from which scenarios start, each a copy of one walk in the same surroundings.

Booting, arming and walking into a phase of the gait takes two seconds of simulated time, which every scenario would
otherwise spend without a failure.
"""

import tomllib
from collections.abc import Callable
from functools import lru_cache

import tomlkit

from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import calibrated, with_drive_type
from simulation.harness.world import World
from simulation.mud.clay import Clay
from simulation.mud.disturbances import LAB, NONE
from simulation.mud.stones import Stone
from simulation.mud.track import Track
from tests.copied_robots import copy_of
from tests.dst.scenario import Surroundings
from tests.folders import EXAMPLE_CONFIGURATION
from verification.faults.failing_robot import FailingRobot, RowList

TRACK_M, STONE_LENGTH_M, STONE_TOP_M = 5.0, 0.2, 0.02
LONGEST_S = 6.0  # from one start to the next
PHASES = {
    "insertion": (Phase.INSERTION,),
    "stance": (Phase.STANCE,),
    "extraction": (Phase.EXTRACTION,),
    "release": (Phase.SWING, Phase.RECOVERY),  # the flippers come out of the mud, or are stuck in it
}
STARTS = ("power-on", "idle", "hold", "path", *PHASES)  # in the order in which a walk passes them
STUCK_PA, STUCK_M = 9000.0, 0.05  # mud and depth in which most extractions leave the flippers stuck


class RecordedRobot(FailingRobot):
    """A robot that also owns the rows of its log, and the numbers of its ticks with and without torque."""

    def __init__(self, configuration: Configuration, world: World, seed: int) -> None:
        self.rows = RowList()
        self.energised_ticks: list[int] = []
        self.resting_ticks: list[int] = []
        super().__init__(
            configuration,
            world.track,
            seed=seed,
            recorder=self.rows,
            plant=world.plant(configuration),
            drives=world.drives(configuration),
        )

    def step(self) -> None:
        super().step()
        ticks = self.energised_ticks if self.loop.mode in ENERGISED else self.resting_ticks
        ticks.append(self.tick_number)


@lru_cache(maxsize=1)
def _example() -> str:
    return calibrated(EXAMPLE_CONFIGURATION.read_text(encoding="utf-8"))


def configuration_of(surroundings: Surroundings) -> Configuration:
    """Return the configuration; raises ConfigurationError where the changed keys contradict each other."""
    document = tomllib.loads(with_drive_type(_example(), surroundings.drive_type))
    for key, value in (("failures.allowed", True), *surroundings.configuration):
        section, _, name = key.rpartition(".")
        document.setdefault(section, {})[name] = value
    return parse_configuration(tomlkit.dumps(document))


def robot_of(surroundings: Surroundings) -> RecordedRobot:
    """Make a robot at power-on."""
    start_m = surroundings.stone_m
    stones = [] if start_m is None else [Stone(start_m, start_m + STONE_LENGTH_M, STONE_TOP_M)]
    clay = Clay(f"{surroundings.strength_pa:g} Pa", surroundings.strength_pa)
    world = World(
        Track([(TRACK_M, clay)], stones),
        LAB if surroundings.disturbed else NONE,
        {"free_body": True} if surroundings.free_body else {},
        dict(surroundings.drives),
    )
    return RecordedRobot(configuration_of(surroundings), world, surroundings.seed)


class SoundWalk:
    """Owns one robot that goes from power-on into a walk, and copies of it at the starts that it has passed."""

    def __init__(self, surroundings: Surroundings) -> None:
        self._surroundings = surroundings
        self._robot = robot_of(surroundings)
        self._passed = {STARTS[0]: copy_of(self._robot)}

    def robot_at(self, start: str) -> RecordedRobot:
        """Return a copy at this start. Raises RuntimeError where a sound robot does not get there."""
        for each in STARTS[len(self._passed) : STARTS.index(start) + 1]:
            self._go_to(each)
            self._passed[each] = copy_of(self._robot)
        return copy_of(self._passed[start])

    def _go_to(self, start: str) -> None:
        robot, loop = self._robot, self._robot.loop
        if start == "idle":
            self._reach(start, lambda: loop.mode is Mode.IDLE and not loop.faults.blocking(robot.forced))
        elif start == "hold":
            loop.request(Request.ARM, robot.now_s, forced=robot.forced)
            self._reach(start, lambda: loop.mode is Mode.HOLD)
        elif start == "path":
            depth_m = self._surroundings.depth_m
            robot.walk(WalkOrder(depth_m, adaptive=depth_m < STUCK_M))
        else:
            self._reach(start, lambda: loop.controller.target.phase in PHASES[start])

    def _reach(self, start: str, is_there: Callable[[], bool]) -> None:
        if not self._robot.run_until(is_there, LONGEST_S):
            loop = self._robot.loop
            raise RuntimeError(f"a sound robot did not reach {start}: {loop.mode.name}, {loop.fault}")


@lru_cache(maxsize=2)
def sound_walk(surroundings: Surroundings) -> SoundWalk:
    """Return the walk that consecutive scenarios share."""
    return SoundWalk(surroundings)
