"""`mudskipper install` and `uninstall`: print the planned steps, do them, and report how many were done."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, TypeAlias

from command_line import exit_codes
from command_line.install.service_plan import (
    Command,
    MakeLink,
    Outcome,
    Plan,
    Remove,
    Run,
    Step,
    System,
    WriteFile,
    plan_installation,
    plan_removal,
    require_interfaces,
)
from command_line.screen import complain
from experiments.study.option import Option
from firmware_host.configuration.service_file import CONFIGURATION, service_configuration

HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # ProtectHome= and PrivateTmp= of the unit hide them
COMMAND_TIMEOUT_S = 120.0  # stopping the service may take 20 s
Find = Callable[[str], str | None]  # returns the path of a program
NEXT = """\
Next: edit {root}etc/mudskipper/mudskipper.toml (your geometry, your drives), then
  mudskipper install                 again, so that the service waits for your buses
  adduser YOU mudskipper             an operator; takes effect at the next login
  systemctl start mudskipper
  mudskipper doctor; mudskipper check"""


class StepError(Exception):
    """A step failed; the text gives the reason."""


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
    """Return an unused path in the same folder, which it makes, without the rest of an interrupted installation."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.unlink(missing_ok=True)
    return temporary


def run_command(words: Sequence[str], timeout_s: float | None = COMMAND_TIMEOUT_S) -> Outcome:
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=timeout_s, check=False)
    except subprocess.TimeoutExpired:
        return Outcome(124, f"took longer than {timeout_s:g} s")
    except FileNotFoundError:
        return Outcome(127, f"{words[0]} is not installed")
    return Outcome(done.returncode, done.stdout + done.stderr)


DryRun: TypeAlias = Annotated[bool, Option("only show what would be done")]
Root: TypeAlias = Annotated[Path, Option("root folder of another system", metavar="DIR")]


def install(
    *, dry_run: DryRun = False, root: Root = Path("/"), run: Run = run_command, find: Find = shutil.which
) -> int:
    system = _system(root, run)
    refusal = location_problem((system.prefix, Path(__file__).resolve().parent)) if system.live else ""
    if refusal:
        complain(refusal)
        return exit_codes.REFUSED
    require_interfaces(service_configuration(system.root))
    plan = plan_installation(system)
    status = _carry_out(plan, system, dry_run, find)
    is_new = any(isinstance(step, WriteFile) and step.path == system.root / CONFIGURATION for step in plan.steps)
    if is_new and status == exit_codes.OK and not dry_run:
        print(NEXT.format(root=str(system.root).rstrip("/") + "/"))
    return status


def uninstall(
    *,
    purge: Annotated[bool, Option("remove configuration, logs and user too")] = False,
    dry_run: DryRun = False,
    root: Root = Path("/"),
    run: Run = run_command,
    find: Find = shutil.which,
) -> int:
    system = _system(root, run)
    return _carry_out(plan_removal(system, purge), system, dry_run, find)


def _system(root: Path, run: Run) -> System:
    root, prefix = root.resolve(), Path(sys.prefix)
    if prefix.is_relative_to(root):
        prefix = Path("/") / prefix.relative_to(root)
    return System(root, prefix, run, live=root == Path("/"))


def location_problem(folders: Sequence[Path]) -> str:
    """Return why the service could not be started from these folders, or an empty text."""
    for folder in folders:
        if any(folder.is_relative_to(hidden) for hidden in HIDDEN):
            return (
                f"{folder} is hidden from the service; install into an environment below /opt: docs/how-to/install.md"
            )
    if not (folders[0] / "bin" / "mudskipperd").exists():
        return f"there is no mudskipperd in {folders[0]}/bin: install the package there with pip first"
    return ""


def _carry_out(plan: Plan, system: System, dry_run: bool, find: Find) -> int:
    if system.live and os.geteuid() != 0 and not dry_run:
        complain("this changes the system: run it with sudo, or print the steps with --dry-run")
        return exit_codes.NOT_PERMITTED
    for note in plan.notes:
        print(f"note: {note}")
    if not plan.steps:
        print("nothing to do")
        return exit_codes.OK
    if dry_run:
        print("\n".join(("would:", *(f"  {step}" for step in plan.steps))))
        return exit_codes.OK
    programs = {step.words[0]: None for step in plan.steps if isinstance(step, Command)}
    missing = [program for program in programs if find(program) is None]
    if missing:
        complain(f"{', '.join(missing)}: not installed. This needs systemd with udev and systemd-networkd")
        return exit_codes.UNHEALTHY
    print("\n".join(("will:", *(f"  {step}" for step in plan.steps))), flush=True)
    return _perform_all(plan, system.run)


def _perform_all(plan: Plan, run: Run) -> int:
    os.umask(0o022)  # everyone may read the installed files
    for number, step in enumerate(plan.steps):
        try:
            perform(step, run)
        except (StepError, OSError) as problem:
            complain(f"could not {step}: {getattr(problem, 'strerror', None) or problem}")
            complain(f"done before that: {number} of {len(plan.steps)} steps. Fix it and run this command again")
            return exit_codes.UNHEALTHY
    print("done")
    return exit_codes.OK
