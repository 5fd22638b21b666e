"""The entry of the program `mudskipper`: Ctrl-C ends it without a traceback also while it imports its modules."""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as in the background of a script
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from command_line.main import main as run_command  # noqa: E402 - the import takes the time


def main() -> int:
    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    return run_command()
