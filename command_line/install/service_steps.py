"""The steps of `mudskipper install`: writing files, making links, removing files, running commands.

The text of a step is printed before the step is done.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

COMMAND_TIMEOUT_S = 120.0  # stopping the service may take 20 s


class Outcome(NamedTuple):
    status: int
    text: str


Run = Callable[[Sequence[str]], Outcome]


class StepError(Exception):
    """A step failed; the text gives the reason."""


class WriteFile(NamedTuple):
    path: Path
    text: str

    def __str__(self) -> str:
        return f"write {self.path}"


class MakeLink(NamedTuple):
    path: Path
    target: Path

    def __str__(self) -> str:
        return f"link {self.path} to {self.target}"


class Remove(NamedTuple):
    path: Path

    def __str__(self) -> str:
        return f"remove {self.path}{'/' if self.path.is_dir() else ''}"


class Command(NamedTuple):
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"run {shlex.join(self.words)}"


Step = WriteFile | MakeLink | Remove | Command


def perform(step: Step, run: Run) -> None:
    """Raises StepError, and OSError."""
    match step:
        case WriteFile(path, text):
            temporary = _temporary_path(path)
            temporary.write_text(text, encoding="utf-8")
            temporary.chmod(0o644)
            temporary.replace(path)
        case MakeLink(path, target):
            temporary = _temporary_path(path)
            temporary.symlink_to(target)
            temporary.replace(path)
        case Remove(path) if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        case Remove(path):
            path.unlink(missing_ok=True)
        case Command(words):
            outcome = run(words)
            if outcome.status != 0:
                last_line = outcome.text.strip().rpartition("\n")[2]
                raise StepError(last_line or f"exit status {outcome.status}")


def _temporary_path(path: Path) -> Path:
    """Returns an unused path in the same folder, which it makes; removes the rest of an interrupted installation."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.unlink(missing_ok=True)
    return temporary


def run_command(words: Sequence[str]) -> Outcome:
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=COMMAND_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        return Outcome(124, f"took longer than {COMMAND_TIMEOUT_S:g} s")
    except FileNotFoundError:
        return Outcome(127, f"{words[0]} is not installed")
    return Outcome(done.returncode, done.stdout + done.stderr)
