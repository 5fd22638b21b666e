"""The mode that the robot is in after an operator's command, as the command's answer."""

from command_line import exit_codes
from command_line.json_output import Answer
from command_line.screen import complain


def mode_answer(command: str, mode: str, notice: str = "", status: int = exit_codes.OK) -> Answer:
    """Print the daemon's notice, and return the mode; programs read the error of a command that failed."""
    complain(*filter(None, [notice]))
    report = {"command": command, "mode": mode, "notice": notice}
    return Answer(report if status == exit_codes.OK else None, mode, status, "operation")
