"""Writes fitted constants to the configuration file, and leaves its comments, order and everything else unchanged.

The operator sees the difference first. See experiments.actuator.file_change.py for what may go wrong then.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.actuator.file_change import Changes, FileChangeError, change_file, lines_of
from experiments.actuator.fit import JointFit
from experiments.robot.bench_errors import BenchError
from experiments.study.session import Ending, Session
from firmware_host.configuration.toml_records import read_text

COPY = "mudskipper.toml"  # of a simulated robot's configuration
LARGEST_UNCERTAINTY = 0.02  # relative, of a torque constant that is written
WRITE = "y"
SET_DRIVES = (
    ". 'systemctl stop mudskipper', set the drives' own constants to the same values ('mudskipper drives setup' "
    "compares them), then 'systemctl start mudskipper'"
)


def find_target(path: Path, text: str, session: Session) -> Path:
    """Return the file to change, a copy for a simulated robot. Raises BenchError where it cannot be changed."""
    if session.simulated:
        copy = session.folder / COPY
        copy.write_text(text, encoding="utf-8")
        return copy
    require_changeable(path, text)
    return path


def require_changeable(path: Path, text: str) -> None:
    """Raises BenchError for a file that is not the configuration that the daemon runs with, or that is not writable."""
    if read_text(path) != text:
        raise BenchError(f"the daemon does not run with {path}: name its file with --config, or restart it")
    if not (os.access(path, os.W_OK) and os.access(path.resolve().parent, os.W_OK)):
        raise BenchError(f"you may not write {path}; run this as a user who may, such as root")


def fitted_changes(fits: Sequence[JointFit], session: Session) -> dict[tuple[str, ...], Any]:
    """Return the new values by configuration key, and report the joints whose constant is too uncertain."""
    changes: dict[tuple[str, ...], Any] = {}
    for numbers, *_ in fits:
        joint, constant_nm_a = numbers["joint"], numbers["torque_constant_nm_a"]
        uncertainty = numbers["torque_constant_error_nm_a"] / constant_nm_a
        if constant_nm_a <= 0.0 or not 0.0 < uncertainty <= LARGEST_UNCERTAINTY:
            name = f"{joint}: the standard error of k_t"
            session.operator.report(f"{name} is {100.0 * uncertainty:.1f} %; k_t is not written.")
            continue
        changes["drive", joint, "torque_constant_nm_a"] = round(constant_nm_a, 5)
        for key, name in (("coulomb_nm", "friction"), ("viscous_nm_s", "viscous")):
            unit = key.partition("_")[2]
            value, error = numbers[f"{name}_{unit}"], numbers[f"{name}_error_{unit}"]
            if value > 2.0 * error:  # only a value that was measured
                changes["friction", joint, key] = round(value, 4)
    return changes


def apply_changes(path: Path, changes: Changes, session: Session) -> tuple[str, Ending]:
    """Show the difference, write it if the operator agrees, and return a message."""
    operator, answers = session.operator, list[str]()
    by_hand = f"To write by hand:\n{lines_of(changes)}"

    def agrees(difference: str) -> bool:
        operator.report(difference)
        answers.append(operator.ask(f"Write this to {path}?", {WRITE: "write it", "": "leave it"}, lambda: None))
        return answers == [WRITE]

    try:
        done = change_file(path, read_text(path), changes, agrees)
    except FileChangeError as problem:
        return f"nothing was applied: {problem}. {by_hand}", Ending.REFUSED
    if answers == [""]:
        return f"{done}; the same command with --out {session.folder} asks again. {by_hand}", Ending.REFUSED
    has_constant = any(name == "torque_constant_nm_a" for *_, name in changes)
    return done + SET_DRIVES * (has_constant and answers == [WRITE]), Ending.DONE
