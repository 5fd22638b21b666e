"""The single flipper's bench in the simulator: the robot on a fixed base, with the disturbances of a laboratory."""

from collections.abc import Sequence
from pathlib import Path

from control.records import TWO_FLIPPERS, Rig
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.trials.mud_trials import PlannedTrial
from experiments.trials.simulated_bed import CarriedBed, simulated_bench
from experiments.trials.trial import BENCH_CURRENT_A, BENCH_TORQUE_NM
from firmware_host.configuration.configuration import Configuration
from simulation.devices.motion_capture_parameters import AT_EVERY_TICK
from simulation.mud.clay import clay_of_water
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

TRIAL_M = 0.2  # between the trials in one mud: every stroke is in fresh mud
STRIP_M = 100.0  # of each mud

SECTIONS = f"""\
[gait]
protocol = "single_flipper"

[estimation]
fixed_base = true
surface_error_m = {LAB.surface_error_m:.4g}  # as an operator would see it

[limits]
torque_nm = {BENCH_TORQUE_NM}

[recovery]
lead_deg = 12.0  # reaches that torque with the default stiffness
"""
DRIVE = f"current_limit_a = {BENCH_CURRENT_A}"


def bench_configuration(rig: Rig = TWO_FLIPPERS) -> Configuration:
    return simulated_configuration(SECTIONS, DRIVE, rig=rig)


def flipper_bench(
    folder: Path, muds: Sequence[str], seed: int, rig: Rig = TWO_FLIPPERS
) -> tuple[LockstepRobot, CarriedBed]:
    """Make a robot over strips of muds, named after their water content. Raises ValueError for an unknown mud."""
    track = Track([(STRIP_M, clay_of_water(float(mud))) for mud in muds])

    def position_m(trial: PlannedTrial, prepared: int) -> float:
        return STRIP_M * list(muds).index(trial.group) + TRIAL_M * (prepared + 1)

    return simulated_bench(folder, bench_configuration(rig), track, seed, position_m, AT_EVERY_TICK)
