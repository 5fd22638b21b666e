"""The simulated bench of the walks: fresh copies of the trackway along one track, and then the soft muds."""

from math import fsum
from pathlib import Path

from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.trials.mud_trials import MOST_ATTEMPTS, PlannedTrial
from experiments.trials.simulated_bed import CarriedBed, simulated_bench
from experiments.walk.measurement import WalkTrials
from simulation.mud.clay import clay_of_water
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

TAIL_M = 0.5  # the last mud is longer, so that no stride meets the next copy
SOFT_WALK_M, STRIP_M = 2.0, 1000.0  # length for a walk in soft mud, length of each soft mud
SECTIONS = f"[estimation]\nsurface_error_m = {LAB.surface_error_m:.4g}  # as an operator would see it\n"


def walking_bench(folder: Path, plan: WalkTrials, seed: int) -> tuple[LockstepRobot, CarriedBed]:
    """Make a robot over the plan's muds, named after their water content. Raises ValueError for an unknown mud."""
    lengths_m = [mud.length_m for mud in plan.muds]
    lengths_m[-1] += TAIL_M
    trackway = [(length_m, clay_of_water(float(mud.name))) for length_m, mud in zip(lengths_m, plan.muds, strict=True)]
    copies = MOST_ATTEMPTS * plan.trials
    soft = [(STRIP_M, clay_of_water(float(mud))) for mud in plan.soft]

    def position_m(trial: PlannedTrial, prepared: int) -> float:
        if trial.key.startswith("walk/"):
            return prepared * fsum(lengths_m)
        strip = next(i for i, mud in enumerate(plan.soft) if trial.key.startswith(f"soft {mud} "))
        return copies * fsum(lengths_m) + STRIP_M * strip + SOFT_WALK_M * (prepared + 1)

    return simulated_bench(folder, simulated_configuration(SECTIONS), Track(trackway * copies + soft), seed, position_m)
