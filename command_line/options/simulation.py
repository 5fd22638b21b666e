"""Options of the commands that simulate the robot."""

import argparse
from pathlib import Path

from command_line.option_types import depth_cm, folder
from command_line.options.shared import SIMULATED, add_json

Parser = argparse.ArgumentParser


def add_demo(demo: Parser) -> None:
    add_json(demo)
    demo.add_argument("--out", type=folder, default=Path("mudskipper-demo"), metavar="DIR", help="for log and plot")
    _add_seed(demo)
    demo.add_argument("--depth", type=depth_cm, metavar="CM", help="fixed insertion depth (default: adaptive)")
    demo.add_argument("--world", type=Path, metavar="FILE", help="describes the ground (default: three muds)")


def add_simulate(simulate: Parser) -> None:
    simulate.add_argument("--bus", default=SIMULATED, metavar="NAME", help="of the local bus (default: %(default)s)")
    simulate.add_argument("--config", type=Path, metavar="FILE", help="use the buses of this configuration")
    ground = simulate.add_mutually_exclusive_group()
    ground.add_argument("--mud", action="append", metavar="W", help="water content, repeatable: 48.5, 53.1, 45.3")
    ground.add_argument("--world", type=Path, metavar="FILE", help="describes the ground and more")
    ground.add_argument("--on-blocks", action="store_true", help="no mud: the flippers move in air, for the bench")
    _add_seed(simulate)


def _add_seed(parser: Parser) -> None:
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the simulation's noise (default: 1)")
