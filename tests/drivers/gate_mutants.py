"""Mutants of the transmit gate: each changes one place of its source, and its tests must notice.

Run by `make mutants`. A mutant turns a comparison round or moves its boundary, exchanges `and` with `or`, plus with
minus, times with division, min with max; changes a constant; takes `not` or a sign away; makes a condition true or
false; returns nothing; or leaves a statement out. It replaces the module in a fork of this process, where the tests
of the gate then run. Names, annotations and texts for readers of the source are left alone.
"""

from __future__ import annotations

import ast
import os
import signal
import sys
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from types import ModuleType

import hypothesis
import pytest

from drivers.can import mock_bus
from drivers.odrive import axis as odrive_axis
from tests.folders import ROOT

MODULES = ("drivers.transmit_gate", "drivers.odrive.gate_tables")
TESTS = ROOT / "tests" / "drivers" / "test_transmit_gate.py"
LONGEST_S = 60
COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
EXCHANGED = {"min": "max", "max": "min"}
Change = tuple[str, Callable[[], None]]


def changes_of(node: ast.AST) -> Iterator[Change]:
    """What may be done to one node, each as a text and a deed."""
    match node:
        case ast.Compare(ops=operators):
            for place, operator in enumerate(operators):
                for other in COMPARISONS[type(operator)]:
                    yield f"{type(operator).__name__} to {other.__name__}", _setter(operators, place, other())
        case ast.BoolOp(op=operator):
            other_operator = ast.Or() if isinstance(operator, ast.And) else ast.And()
            yield f"to {type(other_operator).__name__}", lambda: setattr(node, "op", other_operator)
        case ast.BinOp(op=operator) if type(operator) in OPERATORS:
            exchanged = OPERATORS[type(operator)]()
            yield f"to {type(exchanged).__name__}", lambda: setattr(node, "op", exchanged)
        case ast.UnaryOp():
            yield (
                "sign or not taken away",
                lambda: (
                    setattr(node, "op", ast.UAdd())
                    if isinstance(node.op, ast.USub)
                    else setattr(node, "operand", ast.UnaryOp(ast.Not(), node.operand))
                ),
            )
        case ast.Constant(value=value) if value is not None and value is not ...:
            yield f"{value!r} to {_other(value)!r}", lambda: setattr(node, "value", _other(value))
        case ast.Call(func=ast.Name(id=name)) if name in EXCHANGED:
            yield f"{name} to {EXCHANGED[name]}", lambda: setattr(node, "func", ast.Name(EXCHANGED[name], ast.Load()))
        case ast.If() | ast.IfExp():
            yield "always", lambda: setattr(node, "test", ast.Constant(True))
            yield "never", lambda: setattr(node, "test", ast.Constant(False))
        case ast.Return(value=value) if value is not None:
            yield "returns nothing", lambda: setattr(node, "value", ast.Constant(None))


def _setter(items: list[ast.cmpop], place: int, item: ast.cmpop) -> Callable[[], None]:
    return lambda: items.__setitem__(place, item)


def _other(value: object) -> object:
    match value:
        case bool():
            return not value
        case int() | float():
            return value + 1
        case bytes():
            return value + b"\1"
        case _:
            return f"XX{value}"


def omissions_of(node: ast.AST) -> Iterator[Change]:
    """Statements that may be left out of a body."""
    for body in (getattr(node, name, None) for name in ("body", "orelse")):
        if isinstance(body, list):
            for place, statement in enumerate(body):
                if _is_text(statement):
                    continue
                if isinstance(statement, ast.Assign | ast.AugAssign | ast.Expr | ast.Return | ast.For | ast.If):
                    yield f"without `{ast.unparse(statement).splitlines()[0]}`", _leaver(body, place)


def _leaver(body: list[ast.stmt], place: int) -> Callable[[], None]:
    return lambda: body.__setitem__(place, ast.Pass())


def _nodes(tree: ast.Module) -> Iterator[ast.AST]:
    """Of code that runs: no imports, no annotations, no texts for readers."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom) or _is_text(node):
            continue
        yield node
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns"):
                continue
            waiting += [each for each in (value if isinstance(value, list) else [value]) if isinstance(each, ast.AST)]


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def source_of(module: str) -> Path:
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


def parsed(module: str) -> ast.Module:
    return ast.parse(source_of(module).read_text(encoding="utf-8"))


def mutants(module: str) -> Iterator[tuple[str, ast.Module]]:
    """Each with the line and what was done to it."""
    original = parsed(module)
    nodes = list(_nodes(original))
    for number, node in enumerate(nodes):
        for kind in (changes_of, omissions_of):
            for place, (text, _) in enumerate(kind(node)):
                tree = deepcopy(original)
                copied = list(_nodes(tree))[number]
                _, change = list(kind(copied))[place]
                change()
                line = getattr(node, "lineno", 0)
                yield (
                    f"line {line}: {text} in `{ast.unparse(node).splitlines()[0][:90]}`",
                    ast.fix_missing_locations(tree),
                )


def is_killed(module: str, tree: ast.Module) -> bool:
    """Whether the gate's tests fail with it; a fork, so that nothing of the mutant stays."""
    child = os.fork()
    if child == 0:
        signal.alarm(LONGEST_S)
        os._exit(_run_tests(module, tree))
    _, status = os.waitpid(child, 0)
    return status != 0


def _run_tests(name: str, tree: ast.Module) -> int:
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    module = ModuleType(name)
    module.__file__ = str(source_of(name))
    sys.modules[name] = module
    try:
        exec(compile(tree, module.__file__, "exec"), module.__dict__)  # a mutant of our own file
    except (AttributeError, IndexError, KeyError, NameError, TypeError, ValueError):
        return 1
    skipped = "not every_branch and not kernel and not on_a_port"
    options = ["-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=1", "-k", skipped]
    return int(pytest.main([*options, str(TESTS)]))


def main() -> int:
    os.chdir(ROOT)
    assert hypothesis and mock_bus and odrive_axis  # loaded once, for all forks
    killed, survivors = 0, []
    for module in MODULES:
        if is_killed(module, parsed(module)):
            print("The tests fail without any change.")
            return 2
        for text, tree in mutants(module):
            if is_killed(module, tree):
                killed += 1
            else:
                survivors.append(text)
                print(f"survived  {module}, {text}", flush=True)
    print(f"{killed} of {killed + len(survivors)} mutants killed")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
