"""Prints the mode that the robot is in after an operator's command, for people or for programs."""

from command_line.json_output import print_json
from command_line.screen import complain


def print_mode(command: str, as_json: bool, mode: str, notice: str = "", reached: bool = True) -> None:
    """Print the mode and the daemon's notice. `reached`: the command succeeded; else its error follows as JSON."""
    if not as_json:
        print(mode)
    elif reached:
        print_json("operation", {"command": command, "mode": mode, "notice": notice})
    complain(*filter(None, [notice]))
