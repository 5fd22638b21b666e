"""The simulated bench of the actuator calibration: a flipper over the edge of a table, and imperfect motors.

The motor's true constant is 8.27/KV of the R60, while the configuration has the paper's 60/(2π KV); the calibration
must find the true one. The imperfections are those of direct-drive motors of this size, as far as they are public:

    cogging     0.026 N·m from peak to peak of a gimbal-class motor without current, measured with a torque transducer
                (J. Pieper, "Measuring torque ripple", jpieper.com/tag/torque), 168 periods a turn by the R60's 24 slots
                and 28 magnets (motor_config_R60.h on os.mbed.com, users/adimmit)
    friction    no figure is public; the paper neglects it, so it is set to the cogging's amplitude
    current     noise of 0.1 to 0.3 A in the authors' logs (simulation/mud/disturbances.py)
    encoder     14 bits, as of the R60's public ODrive settings (YaelBenShalom/Motorized-Prosthetic-Arm)

The position of the hook varies from one weight to the next by an estimate. Calibration weights of class M1 are more
accurate than all of this.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

from experiments.actuator.fit import JointFit
from experiments.actuator.plan import WeighingPlan, WeighingStep
from experiments.actuator.weighing import WeightHandler
from experiments.bench.rig import on_bench
from experiments.reports.value_text import miss_text
from experiments.robot.lockstep_robot import LockstepRobot, simulated_configuration
from experiments.study.prompt import GO_ON, AutomaticOperator, Operator
from experiments.trials.trial import BENCH_CURRENT_A
from firmware_host.configuration.configuration import Configuration
from simulation.body.bench_mount import BenchMount
from simulation.harness.file_recorder import FileRecorder
from simulation.harness.lockstep import Lockstep, drives_of, plant_of
from simulation.mud.track import paper_track

TRUE_CONSTANT_NM_A = 8.27 / 115.0
COGGING_NM, COGGING_PER_TURN = 0.013, 168
COULOMB_NM = 0.013
CURRENT_NOISE_A = 0.2
ENCODER_NOISE_RAD = 1e-4  # a quarter of a count
BENCH_TORQUE_NM = 1.4  # what BENCH_CURRENT_A give by either constant
HANGING_S, HANGING_PARTS = 1.0, 20  # until a weight hangs quietly, and in how many steps it comes down
LEVER_SD_M = 0.0003


def bench_configuration() -> Configuration:
    """Return the simulated robot's configuration, with the current limit of the authors' single flipper."""
    sections = f"[limits]\ntorque_nm = {BENCH_TORQUE_NM}\n\n[recovery]\nattempts = 0  # no mud holds a flipper here\n"
    return simulated_configuration(sections, drive=f"current_limit_a = {BENCH_CURRENT_A}")


def truth_rows(fits: Sequence[JointFit]) -> list[dict[str, str]]:
    """List the true constants of the simulated motors, and the errors of the fitted ones."""
    return [
        {
            "joint": fit.numbers["joint"],
            "true k_t (N·m/A)": f"{TRUE_CONSTANT_NM_A:.5f}",
            "k_t error": miss_text(fit.numbers["torque_constant_nm_a"], TRUE_CONSTANT_NM_A),
            "true dry friction (N·m)": f"{COULOMB_NM:.4f}",
            "dry friction error": miss_text(fit.numbers["friction_nm"], COULOMB_NM),
        }
        for fit in fits
    ]


class BuiltRobot(NamedTuple):
    """The robot that is simulated, as opposed to the one that a configuration describes."""

    configuration: Configuration
    constant_nm_a: float = TRUE_CONSTANT_NM_A  # of its motors; its drives believe in the configured one


def simulated_bench(
    configuration: Configuration,
    joint: str,
    plan: WeighingPlan,
    seed: int,
    log: Path,
    built: BuiltRobot | None = None,
    operator: Operator | None = None,
) -> tuple[LockstepRobot, SimulatedWeights]:
    """Make a robot with a flipper over the bench's edge, and the handler of its weights.

    `log` must be new. With an `operator` the weights wait for their answers.
    """
    built = built or BuiltRobot(configuration)
    random = Random(f"bench {seed} {joint}")
    recorder = FileRecorder(log, configuration)
    plant = plant_of(built.configuration, fixed_base=True, joint_coulomb_nm=COULOMB_NM)
    drives = {
        name: drives_of(
            built.configuration,
            torque_constant_error=built.constant_nm_a / drive.torque_constant_nm_a - 1.0,
            cogging_nm=COGGING_NM,
            cogging_per_turn=COGGING_PER_TURN,
            cogging_phase_deg=random.uniform(-180.0, 180.0),
            current_noise_a=CURRENT_NOISE_A,
            encoder_noise_rad=ENCODER_NOISE_RAD,
        )[name]
        for name, drive in built.configuration.drive.items()
    }
    lockstep = Lockstep(on_bench(configuration), paper_track(), seed, recorder, plant=plant, drives=drives)
    operator = operator or AutomaticOperator(lambda message: None)
    return LockstepRobot(lockstep, recorder), SimulatedWeights(operator, plan, joint, lockstep, seed)


class SimulatedWeights(WeightHandler):
    """Moves the mounts of the simulated arms as each prompt asks for, once it is answered."""

    handling_s = 0.0

    def __init__(self, operator: Operator, plan: WeighingPlan, joint: str, lockstep: Lockstep, seed: int) -> None:
        super().__init__(operator, plan, joint)
        self._lockstep, self._random = lockstep, Random(f"hand {seed}")
        self._arms = lockstep.robot.plant.arms
        self._mounts = [BenchMount(on_side=joint.endswith("sweep"), held=True) for _ in self._arms]
        for arm, mount in zip(self._arms, self._mounts, strict=True):
            arm.mount = mount
            arm.put_back()
        self.mount = self._mounts[lockstep.loop.configuration.rig.joints.index(joint) // 2]

    def hold_level(self, meanwhile: Callable[[], None]) -> None:
        self.mount.take_off()
        for arm, mount in zip(self._arms, self._mounts, strict=True):
            arm.put_back()
            mount.held = True
        super().hold_level(meanwhile)

    def release(self, meanwhile: Callable[[], None]) -> None:
        super().release(meanwhile)
        for mount in self._mounts:
            mount.held = False

    def hang(self, step: WeighingStep, meanwhile: Callable[[], None]) -> str:
        """Lower the weight in steps, since a dropped one swings the arm to its end."""
        answer = super().hang(step, meanwhile)
        if answer == GO_ON:
            before_kg, lever_m = self.mount.mass_kg, self.plan.lever_m + self._random.gauss(0.0, LEVER_SD_M)
            for part in range(1, HANGING_PARTS + 1):
                more_kg = (step.weight_g / 1000.0 - before_kg) * part / HANGING_PARTS
                self.mount.hang(before_kg + more_kg, lever_m)
                self._lockstep.run_for(HANGING_S / HANGING_PARTS)
        return answer

    def take_off(self) -> None:
        super().take_off()
        self.mount.take_off()
