"""Runs `mudskipper gait`: checks a gait file as the daemon does, draws its path, and walks it in the simulation."""

from collections.abc import Sequence
from functools import partial
from math import degrees
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.operation.operation import Adaptive, Depths
from command_line.screen import complain
from command_line.shared_options import Seed
from control.gait.stride_table import crutching_parameters, stride_table
from control.modes import Mode
from control.parameters.gait_path import GaitPath
from experiments.reports.style import save_picture
from experiments.reports.text_tables import number, table
from experiments.robot.lockstep_robot import CALLER, simulated_configuration
from experiments.study.option import Option
from experiments.study.values import picture
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_checks import depth_problem, gait_problems
from firmware_host.configuration.gait_file import as_json, gait_document, read_gait
from firmware_host.configuration.loading import load_configuration
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.rpc import RefusedError
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.disturbances import TRACKWAY
from simulation.mud.track import Track

LONGEST_STRIDE_S = 3600.0  # a phase may take a minute; a robot that is stuck ends by a fault
TRACK_M = 100.0

Gait: TypeAlias = Annotated[str, Option("a gait file, or the name of a gait that ships", metavar="FILE")]
Robot: TypeAlias = Annotated[Path | None, Option("of the robot (default: the simulated robot)")]


def check(
    gait: Gait,
    *,
    config: Robot = None,
    out: Annotated[
        Path | None, Option("draw the path over the ground", metavar="PNG", parse=picture(".png", ".svg", ".pdf"))
    ] = None,
) -> int:
    """Check reach, ranges, speeds and currents of a gait before a robot walks it, and print its phases."""
    configuration = _configuration(config)
    path = read_gait(gait_document(gait))
    depth_m = max(path.depths_m, default=configuration.adaptation.initial_depth_m)
    depth_problems = (depth_problem(configuration, each_m) for each_m in path.depths_m)
    problems = [f"{path.name}: depths_m: {problem}" for problem in depth_problems if problem]
    if problems := [*problems, *gait_problems(path, configuration, path.depths_m)]:
        raise ConfigurationError(problems)
    print(table(_phases(path, configuration, depth_m)))
    adapts = f" at {100.0 * depth_m:g} cm; without --depth its depth adapts to the mud" * (not path.depths_m)
    print("\nthe crutching gait" + adapts if crutching_parameters(path) else "\naccepted" + adapts)
    if out:
        from experiments.pictures.gait_picture import draw_gait  # matplotlib is slow to import

        save_picture(partial(draw_gait, path, configuration.geometry, depth_m), out)
        print(f"written  {out}")
    return exit_codes.OK


def _configuration(config: Path | None) -> Configuration:
    return load_configuration(config) if config else simulated_configuration()


def _phases(path: GaitPath, configuration: Configuration, depth_m: float) -> list[Sequence[str]]:
    rows: list[Sequence[str]] = [("phase", "seconds", "sweep (degrees)", "depth (cm)", "for the estimator")]
    for row in stride_table(path, configuration.geometry, depth_m):
        fractions = (0.0, 0.5, 1.0) if row.sweep_bulge_rad or row.depth_bulge_m else (0.0, 1.0)
        sweep = " to ".join(f"{degrees(row.at(fraction)[0]):z.1f}" for fraction in fractions)
        depth = " to ".join(f"{100.0 * row.at(fraction)[1]:z.2f}" for fraction in fractions)
        rows.append((path.phase[row.number].name, f"{row.duration_s:.3f}", sweep, depth, row.phase.name.lower()))
    return rows


def simulate(
    gait: Gait,
    *,
    config: Robot = None,
    mud: Annotated[str, Option("water content", metavar="W", choices=tuple(MUDS))] = "53.1",
    depth: Depths = (),
    adaptive: Adaptive = False,
    strides: Annotated[int, Option("number of strides", low=1, high=1000)] = 5,
    seed: Seed = 1,
) -> int:
    """Walk a gait in simulated mud, as fast as it computes; print the advance of each stride, what stuck and faults."""
    configuration, track = _configuration(config), Track([(TRACK_M, MUDS[mud])])
    fixed_base = configuration.estimation.fixed_base
    lockstep = Lockstep(configuration, track, seed, disturbances=TRACKWAY, fixed_base=fixed_base)
    calls = OperatorCalls(lockstep.loop, [], lambda: lockstep.now_s)
    document = gait_document(gait, adaptive=adaptive)
    try:
        lockstep.arm(forced="uncalibrated,watchdog_unknown")  # an emulated drive is as configured
        depths = {"depths_m": [each / 100.0 for each in depth]} if depth else {}
        calls.methods["walk"]({"gait": as_json(document), "strides": strides, **depths}, CALLER)
    except RefusedError as problem:
        raise ConfigurationError([str(problem)]) from None
    except RuntimeError as problem:
        raise CommandError(str(problem)) from None
    loop = lockstep.loop
    lockstep.step()  # takes the order
    lockstep.run_until(lambda: loop.target.stride >= 0 or loop.mode is not Mode.WALKING, LONGEST_STRIDE_S)
    walked = [_stride(lockstep, stride) for stride in range(strides) if loop.mode is Mode.WALKING]
    print(table([("stride", "cm", "s", "cm/s", "attempts to free a flipper"), *map(_cells, walked)]))
    advance_m, duration_s = sum(each["m"] for each in walked), sum(each["s"] for each in walked)
    if walked:  # else a fault came before the first stride
        print(f"\n{100.0 * advance_m:z.1f} cm in {duration_s:.1f} s, {100.0 * advance_m / duration_s:z.2f} cm/s")
    if fault := loop.fault:
        complain(fault.message)
    return exit_codes.UNHEALTHY if fault else exit_codes.OK


def _stride(lockstep: Lockstep, stride: int) -> dict[str, Any]:
    """Walk a stride to its end, or to a fault."""
    loop, from_s, from_m, attempts = lockstep.loop, lockstep.now_s, lockstep.loop.body.x_m, 0

    def is_over() -> bool:
        nonlocal attempts
        attempts = max(attempts, loop.controller.recovery.attempt)
        return loop.mode is not Mode.WALKING or loop.target.stride > stride

    lockstep.run_until(is_over, LONGEST_STRIDE_S)
    return {"stride": stride, "m": loop.body.x_m - from_m, "s": lockstep.now_s - from_s, "attempts": attempts}


def _cells(stride: dict[str, Any]) -> Sequence[str]:
    advance_cm, duration_s = 100.0 * stride["m"], stride["s"]
    speed = number(advance_cm / duration_s, 2)
    return str(stride["stride"]), number(advance_cm, 2), number(duration_s, 2), speed, str(stride["attempts"] or "-")
