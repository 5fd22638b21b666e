"""Run the mutants of some modules, or of all: `python -m tests.mutants control.limits`.

Each mutant replaces its module in a fork of this process, where the module's tests then run. The exit status is 1 if a
mutant survives that is not listed as equivalent, or if a listed one is killed or gone (tests/mutants/subjects.py).
"""

import ast
import os
import signal
import sys
from importlib import import_module
from types import ModuleType

import hypothesis
import pytest

from tests.folders import ROOT
from tests.mutants.mutations import mutants_of, parsed, source_of
from tests.mutants.subjects import SUBJECTS, Subject

LONGEST_S = 60.0  # of processor time, so that other work on the machine kills no mutant
NICENESS = 10
PACKAGES = {path.name for path in ROOT.iterdir() if path.is_dir()}
OWN = ("tests.folders", "tests.mutants")


def load_libraries(subject: Subject) -> None:
    """Import what the tests import, and forget our own modules again, so that every fork has the libraries."""
    for path in subject.tests:
        import_module(f"tests.{path.removesuffix('.py').replace('/', '.')}")
    for name in list(sys.modules):
        if name.split(".")[0] in PACKAGES and not name.startswith(OWN):
            del sys.modules[name]


def is_killed(subject: Subject, tree: ast.Module) -> bool:
    """Return whether the tests fail with the mutant; they run in a fork, so that nothing of it stays."""
    child = os.fork()
    if child == 0:
        signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
        os._exit(_run_tests(subject, tree))
    _, status = os.waitpid(child, 0)
    return status != 0


def _run_tests(subject: Subject, tree: ast.Module) -> int:
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    folder, _, name = subject.module.rpartition(".")
    module = ModuleType(subject.module)
    module.__file__ = str(source_of(subject.module))
    sys.modules[subject.module] = module
    setattr(import_module(folder), name, module)
    try:
        exec(compile(tree, module.__file__, "exec"), module.__dict__)  # a mutant of our own file
    except (AttributeError, IndexError, KeyError, NameError, TypeError, ValueError):
        return 1
    options = ["-x", "-q", "-p", "no:cacheprovider", "-k", subject.selected]
    options += [] if subject.has_fixtures else ["--noconftest"]
    return int(pytest.main([*options, *(str(ROOT / "tests" / path) for path in subject.tests)]))


def survivors_of(subject: Subject) -> tuple[int, list[str]]:
    """Return the number of all mutants, and the texts of those that no test notices."""
    total, survivors = 0, []
    for mutant in mutants_of(subject.module, subject.functions):
        total += 1
        if is_killed(subject, mutant.tree):
            continue
        survivors.append(mutant.text)
        if mutant.text not in subject.equivalent:
            print(f"survived  {subject.module}:{mutant.line}: {mutant.text}", flush=True)
    return total, survivors


def check(subject: Subject) -> bool:
    """Print the counts of one module, and return whether every mutant is killed or listed as equivalent."""
    total, survivors = survivors_of(subject)
    unlisted = [text for text in survivors if text not in subject.equivalent]
    stale = subject.equivalent.keys() - set(survivors)
    for text in sorted(stale):
        print(f"listed as equivalent, but killed or gone  {subject.module}: {text}")
    killed, equivalent = total - len(survivors), len(survivors) - len(unlisted)
    print(
        f"{subject.module}: {killed} killed, {equivalent} equivalent, {len(unlisted)} survived, of {total}", flush=True
    )
    return not unlisted and not stale


def main(names: list[str]) -> int:
    os.chdir(ROOT)
    os.nice(NICENESS)
    hypothesis.settings.register_profile("mutants", deadline=None, derandomize=True)
    hypothesis.settings.load_profile("mutants")
    subjects = [subject for subject in SUBJECTS if not names or subject.module in names]
    for subject in subjects:
        load_libraries(subject)
        if is_killed(subject, parsed(subject.module)):
            print(f"The tests of {subject.module} fail without any change.")
            return 2
    return 0 if all([check(subject) for subject in subjects]) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
