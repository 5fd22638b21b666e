"""The entry of `mudskipper`, in a process of its own."""

import signal
import subprocess
import sys

IMPORT = """
import builtins, os, signal, sys
plain = builtins.__import__
def interrupted(name, *rest):
    if name == "command_line.main":
        os.kill(os.getpid(), signal.SIGINT)
    return plain(name, *rest)
builtins.__import__ = interrupted
import command_line.entry
"""
CALL = """
import signal, command_line.entry
command_line.entry.run_command = lambda: signal.getsignal(signal.SIGINT) is signal.default_int_handler
print(command_line.entry.main())
"""


def test_an_interrupt_of_the_imports_ends_the_program_without_a_traceback() -> None:
    ended = subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (-signal.SIGINT, b"", b"")


def test_a_command_gets_interrupts_as_exceptions_again() -> None:
    assert subprocess.check_output([sys.executable, "-c", CALL]) == b"True\n"
