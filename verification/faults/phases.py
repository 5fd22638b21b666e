"""The phases of operation in which failures are injected: at rest, arming, every phase of a stride, stopping."""

from collections.abc import Callable
from dataclasses import replace
from random import Random

from control.controller import WalkOrder
from control.fault_causes import ANSWERED_S
from control.modes import Mode, Request
from control.parameters.fault_bounds import FaultBounds
from control.parameters.recovery_parameters import RecoveryParameters
from control.records import Phase
from drivers.drive import DriveParameters
from drivers.drive_types import DEFAULT
from experiments.trials.trial import WALKING, configuration_of
from firmware_host.configuration.configuration import Configuration
from simulation.mud.clay import MUDS, Clay
from simulation.mud.track import Track
from verification.faults.failing_robot import FaultBench

LENGTH_M = 5.0
HOLDING_CLAY = Clay("9 kPa", 9000.0)  # in which an insertion of 5 cm leaves the flippers stuck
DEEP = WalkOrder(0.05, adaptive=False)
FIRST_DEPTH_M = 0.03
LONGEST_PATH_S = 8.0
STRIDE_TICKS = {  # of the random delay into a phase of the gait: at most about two thirds of it
    Phase.INSERTION: 100,
    Phase.STANCE: 60,
    Phase.EXTRACTION: 20,
    Phase.SWING: 200,
}
SHORT_RECOVERY = RecoveryParameters(attempts=1, grace_s=0.05, pause_s=0.05, attempt_s=0.2)


def bench_for(phase: str, random: Random, hopeless: bool = False, drive: str = DEFAULT) -> FaultBench:
    """Make a robot at power-on. In recovery its flippers are stuck; if `hopeless`, the robot soon gives up."""
    clay = HOLDING_CLAY if phase == "recovery" else random.choice(list(MUDS.values()))
    configuration = real_configuration(drive)
    if hopeless:
        configuration = replace(configuration, recovery=SHORT_RECOVERY)
    return FaultBench(configuration, Track([(LENGTH_M, clay)]), random.getrandbits(31))


def real_configuration(drive_type: str = DEFAULT) -> Configuration:
    """Return one with the bounds of a real robot; those of simulations are wider, for the pauses of a busy computer."""
    usual = configuration_of(WALKING, drive_type)
    return replace(usual, faults=FaultBounds(), drive={joint: _as_real(drive) for joint, drive in usual.drive.items()})


def _as_real(drive: DriveParameters) -> DriveParameters:
    has_number = drive.reports_settings and drive.serial_digits
    serial_number = f"{drive.node_id:0{drive.serial_digits}x}" if has_number else ""
    return replace(drive, serial_number=serial_number, command_delay_s=DriveParameters.command_delay_s)


def enter_phase(bench: FaultBench, phase: str, random: Random) -> None:
    """Operate the robot from power-on into the phase, plus a random number of ticks.

    Every drive has its time to answer first: what it has not said by then is in the log before the failure begins.
    Raises RuntimeError where the robot does not get into the phase.
    """
    loop, answered_s = bench.loop, bench.now_s + ANSWERED_S
    _reach(bench, "answers", lambda: bench.now_s > answered_s)
    match phase:
        case "idle" | "arming":
            _reach(bench, "idle", lambda: loop.mode is Mode.IDLE and not loop.faults.blocking(bench.forced))
            _wait(bench, random, 100)
            if phase == "arming":
                _begin_arming(bench, random)
        case "hold":
            bench.arm()
            _wait(bench, random, 250)
        case "recovery":
            bench.arm()
            bench.walk(DEEP)
            _reach(bench, phase, lambda: loop.controller.target.phase is Phase.RECOVERY)
            if loop.configuration.recovery != SHORT_RECOVERY:
                _wait(bench, random, 400)
        case "stopping":
            _walk_into(bench, random.choice((Phase.INSERTION, Phase.STANCE)), random)
            loop.request(Request.STOP, bench.now_s)
            bench.step()
            _wait(bench, random, 60)
        case _:
            _walk_into(bench, Phase[phase.upper()], random)


def _begin_arming(bench: FaultBench, random: Random) -> None:
    """Stop in a tick before closed loop is requested, or while drives enter it, which takes 1 to 38 ticks."""
    _reach(bench, "arming", lambda: bench.loop.request(Request.ARM, bench.now_s, forced=bench.forced) is None)
    for _ in range(random.randint(0, 8)):
        if bench.loop.mode is not Mode.HOLD:
            bench.step()


def _walk_into(bench: FaultBench, phase: Phase, random: Random) -> None:
    bench.arm()
    bench.walk(WalkOrder(FIRST_DEPTH_M))
    _reach(bench, phase.name.lower(), lambda: bench.loop.controller.target.phase is phase)
    _wait(bench, random, STRIDE_TICKS[phase])


def _reach(bench: FaultBench, phase: str, there: Callable[[], bool]) -> None:
    if not bench.run_until(there, LONGEST_PATH_S):
        raise RuntimeError(f"the robot did not reach {phase}: {bench.loop.mode.name}, {bench.loop.fault}")


def _wait(bench: FaultBench, random: Random, most_ticks: int) -> None:
    for _ in range(random.randint(0, most_ticks)):
        bench.step()
