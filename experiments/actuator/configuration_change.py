"""Writes fitted constants to the configuration file, and leaves its comments, order and everything else unchanged.

The operator sees the difference first. The new text must be a configuration that the daemon accepts. The file is
replaced atomically, so a power cut leaves the old or the new one, and the old one stays next to it as `.before`.
"""

import os
import tomllib
from collections.abc import Mapping, MutableMapping, Sequence
from difflib import unified_diff
from itertools import takewhile
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import Table

from experiments.actuator.fit import JointFit
from experiments.robot.bench_errors import BenchError
from experiments.robot.prompt import Operator
from experiments.trials.session import Ending, Session
from firmware_host.configuration.file_problems import why_not
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import ConfigurationError, read_text
from firmware_host.log.whole_files import whole_file

COPY = "mudskipper.toml"  # of a simulated robot's configuration
LARGEST_UNCERTAINTY = 0.02  # relative, of a torque constant that is written
WRITE, LEAVE = "y", ""
Changes = Mapping[tuple[str, ...], float]  # the key's path, and its new value
BACKUP = ".before"


def find_target(path: Path, text: str, session: Session, simulated: bool) -> Path:
    """Return the file to change, a copy for a simulated robot. Raises BenchError where it cannot be changed."""
    if simulated:
        copy = session.folder / COPY
        copy.write_text(text, encoding="utf-8")
        return copy
    if read_text(path) != text:
        raise BenchError(f"the daemon does not run with {path}: name its file with --config, or restart it")
    if not (os.access(path, os.W_OK) and os.access(path.resolve().parent, os.W_OK)):
        raise BenchError(f"--apply: you may not write {path}; run this as a user who may, such as root")
    return path


def apply_fits(path: Path, fits: Sequence[JointFit], session: Session) -> tuple[str, Ending]:
    """Write the constants if the operator agrees; return a message. A failure does not cost the report."""
    try:
        return _apply(path, fits, session.operator), Ending.DONE
    except BenchError as problem:
        return f"nothing was applied: {problem}", Ending.REFUSED


def _apply(path: Path, fits: Sequence[JointFit], operator: Operator) -> str:
    before = read_text(path)
    changes = {key: value for fit in fits for key, value in changes_of(fit).items()}
    for fit in fits:
        if not changes_of(fit):
            uncertainty = 100.0 * fit.constant_error_nm_a / fit.constant_nm_a
            operator.report(f"{fit.joint}: the standard error of k_t is {uncertainty:.1f} %; k_t is not written.")
    after = changed_text(before, changes)
    if after == before:
        return f"{path} needs no change"
    changes_shown = unified_diff(before.splitlines(), after.splitlines(), str(path), f"{path}, changed", lineterm="")
    operator.report("\n".join(changes_shown))
    if operator.ask(f"Write this to {path}?", {WRITE: "write it", LEAVE: "leave it"}, lambda: None) != WRITE:
        return f"{path} was left as it is"
    backup = replace_file(path, before, after)
    return (
        f"{path} is changed; the old file is {backup.name}. Set odrv0.axis0.config.motor.torque_constant of the drives"
        " to the same values, then 'systemctl restart mudskipper'"
    )


def changes_of(fit: JointFit) -> dict[tuple[str, ...], float]:
    """Return new values by configuration key; none where the constant is too uncertain."""
    constant_nm_a, error_nm_a = fit.constant_nm_a, fit.constant_error_nm_a
    if not 0.0 < error_nm_a <= LARGEST_UNCERTAINTY * constant_nm_a:
        return {}
    changes: dict[tuple[str, ...], float] = {("drive", fit.joint, "torque_constant_nm_a"): round(constant_nm_a, 5)}
    for name, (value, error) in (("coulomb_nm", fit.friction_nm), ("viscous_nm_s", fit.viscous_nm_s)):
        if value > 2.0 * error:  # only a value that was measured
            changes["friction", fit.joint, name] = round(value, 4)
    return changes


def changed_text(text: str, changes: Changes) -> str:
    """Raises BenchError where the result is no configuration, or differs in anything but the changes."""
    try:
        document = tomlkit.parse(text)
        for path, value in changes.items():
            _set(document, path, value)
        changed = tomlkit.dumps(document)
        parse_configuration(changed)
    except TOMLKitError as problem:
        raise BenchError(f"the configuration cannot be changed: {problem}") from problem
    except ConfigurationError as problem:
        raise BenchError(
            f"the configuration stays as it is, since changed it would be invalid: {problem}. Fix that, restart the "
            "daemon, and run the same command again: the measurements are saved"
        ) from problem
    if tomllib.loads(changed) != _expected(text, changes):
        raise BenchError(
            "the configuration stays as it is: its tables are written in a way that cannot be changed here"
        )
    return changed


def _expected(text: str, changes: Changes) -> dict[str, Any]:
    document = tomllib.loads(text)
    for path, value in changes.items():
        table = document
        for name in path[:-1]:
            table = table.setdefault(name, {})
        table[path[-1]] = value
    return document


def _set(document: MutableMapping[str, Any], path: tuple[str, ...], value: float) -> None:
    """Put a new key below the last one of its table, above comments on the next table."""
    table = document
    for depth, name in enumerate(path[:-1]):
        if name not in table:
            table[name] = tomlkit.table(is_super_table=depth < len(path) - 2)
        table = table[name]
    body = table.value.body if isinstance(table, Table) and path[-1] not in table else []
    trailing = list(reversed([*takewhile(lambda item: item[0] is None, reversed(body))]))
    del body[len(body) - len(trailing) :]
    table[path[-1]] = value
    body.extend(trailing)


def replace_file(path: Path, before: str, after: str) -> Path:
    """Return the path of the backup. Raises BenchError where the file changed meanwhile, or may not be written."""
    try:
        path = path.resolve(strict=True)  # a link stays one
        if read_text(path) != before:
            raise BenchError(f"{path} was changed during this experiment: run the command again")
        backup = path.with_name(path.name + BACKUP)
        _write(backup, before, path)
        _write(path, after, path)
    except OSError as problem:
        raise BenchError(
            f"{why_not(problem, path)}; nothing was changed. Run the same command as a user who may write it, such as"
            " root: the measurements are saved"
        ) from problem
    return backup


def _write(path: Path, text: str, like: Path) -> None:
    """Write atomically, with the owner and the permissions of another file."""
    status = like.stat()
    with whole_file(path) as hidden, hidden.open("w", encoding="utf-8", newline="") as file:
        os.fchmod(file.fileno(), status.st_mode & 0o777)
        if (os.geteuid(), os.getegid()) != (status.st_uid, status.st_gid):
            os.fchown(file.fileno(), status.st_uid, status.st_gid)
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
