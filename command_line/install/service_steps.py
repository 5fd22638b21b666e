"""What `mudskipper install` does to a system: files written, links made, things removed, commands run; each shows
itself before it is done.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

PATIENCE_S = 120.0  # with one command: stopping the service may take 20 s


class Outcome(NamedTuple):
    status: int
    text: str


Run = Callable[[Sequence[str]], Outcome]


class StepError(Exception):
    """A step that could not be done; the text says why."""


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
    """Raises StepError."""
    try:
        _perform(step, run)
    except OSError as problem:
        raise StepError(problem.strerror or str(problem)) from problem


def _perform(step: Step, run: Run) -> None:
    match step:
        case WriteFile(path, text):
            path.parent.mkdir(parents=True, exist_ok=True)
            beside = _beside(path)
            beside.write_text(text, encoding="utf-8")
            beside.chmod(0o644)
            beside.replace(path)
        case MakeLink(path, target):
            path.parent.mkdir(parents=True, exist_ok=True)
            beside = _beside(path)
            beside.symlink_to(target)
            beside.replace(path)
        case Remove(path):
            _remove(path)
        case Command(words):
            outcome = run(words)
            if outcome.status != 0:
                last_line = outcome.text.strip().rpartition("\n")[2]
                raise StepError(last_line or f"exit status {outcome.status}")


def _beside(path: Path) -> Path:
    """A name of its own, free of what a power cut may have left."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.unlink(missing_ok=True)
    return beside


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def run_command(words: Sequence[str]) -> Outcome:
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    except subprocess.TimeoutExpired:
        return Outcome(124, f"took longer than {PATIENCE_S:g} s")
    except FileNotFoundError:
        return Outcome(127, f"{words[0]} is not installed")
    return Outcome(done.returncode, done.stdout + done.stderr)
