"""A coefficient has the same digits in every version of Python, so logs replay alike on any computer."""

import ast
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from itertools import chain
from math import inf, isnan, nan

import pytest

from control.computing.exact_sum import exact_sum
from tests.estimation.coefficient_digits import coefficient_digits
from tests.folders import ROOT
from tests.waiting import LONGEST_S

OTHER_VERSIONS = [f"python3.{minor}" for minor in range(11, 16) if minor != sys.version_info.minor]


@pytest.mark.parametrize("version", OTHER_VERSIONS)
def test_another_python_computes_the_same_digits(version: str) -> None:
    command = [shutil.which(version) or "", "-m", "tests.estimation.coefficient_digits"]
    if not command[0] or subprocess.run([command[0], "-c", ""], capture_output=True, check=False).returncode:
        pytest.skip(f"no {version} on this computer")
    other = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=LONGEST_S)
    assert json.loads(other.stdout) == coefficient_digits()


def test_no_sum_of_floats_depends_on_the_version_of_python() -> None:
    """`sum` may count samples, and may add values that are only tested for being finite."""
    sources = chain((ROOT / "control").rglob("*.py"), (ROOT / "estimation").rglob("*.py"))
    found = [f"{path}: {text}" for path in sources for text in bare_sums(path.read_text(encoding="utf-8"))]
    assert not found, f"use exact_sum, see control/computing/exact_sum.py: {found}"


def bare_sums(source: str) -> Iterator[str]:
    tree = ast.parse(source)
    tested = {id(call.args[0]) for call in calls(tree, "isfinite")}
    for call in calls(tree, "sum"):
        of = call.args[0]
        counts = isinstance(of, ast.GeneratorExp | ast.ListComp) and ast.unparse(of.elt).endswith(".samples")
        if not counts and id(call) not in tested:
            yield ast.unparse(call)


def calls(tree: ast.AST, function: str) -> Iterator[ast.Call]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == function:
            yield node


def test_a_sum_is_rounded_once_and_never_raises() -> None:
    assert exact_sum([0.1] * 10) == 1.0
    assert exact_sum([1e100, 1.0, -1e100]) == 1.0
    assert exact_sum([]) == 0.0
    assert exact_sum([inf, 1.0]) == inf
    assert all(isnan(exact_sum(values)) for values in ([1e308, 1e308], [inf, -inf], [nan, 1.0]))
