"""Prints the mode that the robot is in after an operator's command, for people or for programs."""

import argparse

from command_line.json_output import print_json
from command_line.screen import complain


def print_mode(options: argparse.Namespace, mode: str, notice: str = "", reached: bool = True) -> None:
    """Prints the mode and the daemon's notice. `reached`: the command succeeded; else its error follows as JSON."""
    if not options.json:
        print(mode)
    elif reached:
        print_json("operation", {"command": options.command, "mode": mode, "notice": notice})
    complain(*filter(None, [notice]))
