"""The whole screen as lines: at home in 80 columns and 24 rows; larger ones show more strides and longer curves."""

from collections.abc import Sequence
from dataclasses import dataclass

from command_line.operation.confirmation import TORQUE_UNKNOWN
from command_line.watch.header_panel import header
from command_line.watch.history import History
from command_line.watch.lines import Line, aged, fit
from command_line.watch.machine_panel import drive_lines, loop_lines, machine_line
from command_line.watch.mud_panel import COEFFICIENTS, coefficient_lines, force_lines, strip_lines
from command_line.watch.walk_panel import stride_lines, walk_lines

FIXED_ROWS = 20  # of a screen of 24 rows: everything but the strides
FEWEST_STRIDES = 3
ROOMY_ROWS = 36  # from here on the panels are apart, and the strip has a row for each coefficient
HELP = """\
space   stop: end the walk, raise the flippers, hold the pose
d       disarm: switch torque off at once; the joints sink
a       arm: switch torque on; the robot holds its pose
w       walk with a depth that adapts to the mud, until a stop
c       clear faults whose cause is gone
?       this help
q       leave; the robot goes on with what it does

Space and d act at once; the others ask first.
No key is an emergency stop: that is the switch of the motors' power.

≥ marks a lower bound: the mud did not yield.
↗ ↘ →  the last stride against the one before, beyond their errors
▁▄█    forces of the last seconds; k of the last strides;
       mud along the way on a logarithmic scale, ▲ is the robot
Values in italics are old. Torque is unknown where a drive is silent."""
KEYS = (("space", "stop"), ("d", "disarm"), ("a", "arm"), ("w", "walk"), ("c", "clear"), ("?", "help"), ("q", "leave"))


@dataclass
class Footer:
    """What the last line shows: a question, else a message, else the keys."""

    question: str = ""
    message: str = ""

    def line(self) -> Line:
        if self.question:
            return ((f"{self.question} ", "busy"), (" y", "title"), (": yes, any other key: no", ""))
        if self.message:
            return ((self.message, "alarm" if self.message.startswith(TORQUE_UNKNOWN) else "warn"),)
        return tuple(piece for key, text in KEYS for piece in ((f"{key} ", "title"), (f"{text}  ", "dim")))


def screen_lines(
    history: History, now_s: float, width: int, height: int, footer: Footer, help_shown: bool
) -> list[Line]:
    """Return exactly `height` lines of exactly `width` characters."""
    if not history.status:
        lines: list[Line] = [((f"no answer yet: {history.problem}", "warn"),)]
    elif help_shown:
        lines = [*header(history, now_s, width), (), *(((row, ""),) for row in HELP.splitlines())]
    else:
        heard = not history.silence_s(now_s)
        body = _body(history, width, height, heard)
        lines = [*header(history, now_s, width), *(body if heard else map(aged, body))]
    lines = [*lines, *((),) * height][: height - 1]
    return [fit(line, width) for line in [*lines, footer.line()]][:height]


def _body(history: History, width: int, height: int, heard: bool) -> Sequence[Line]:
    if height < ROOMY_ROWS:
        strides = max(FEWEST_STRIDES, height - FIXED_ROWS)
        return [
            *walk_lines(history),
            *coefficient_lines(history, width),
            *force_lines(history, width),
            *strip_lines(history, width),
            *stride_lines(history, strides),
            *drive_lines(history, heard),
            machine_line(history),
        ]
    machine = [(), *drive_lines(history, heard), (), *loop_lines(history)]
    panels = [
        *walk_lines(history),
        (),
        *coefficient_lines(history, width),
        (),
        *force_lines(history, width),
        (),
        *strip_lines(history, width, COEFFICIENTS),
        (),
    ]
    return [*panels, *stride_lines(history, height - 4 - len(panels) - len(machine)), *machine]
