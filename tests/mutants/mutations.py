"""Mutants of a module: each changes one position of its source, and the module's tests must notice.

A mutant inverts a comparison or moves its boundary, exchanges `and` with `or`, plus with minus, times with division,
min with max; changes a constant; removes `not` or a sign; makes a condition true or false; returns nothing; or leaves a
statement out. Names, annotations and messages are left alone.
"""

import ast
from collections.abc import Callable, Collection, Iterator
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple

from tests.folders import ROOT

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


class Mutant(NamedTuple):
    line: int
    text: str  # the change and its source, without the line, which moves
    tree: ast.Module


def changes_of(node: ast.AST) -> Iterator[Change]:
    """Yield the changes of one node, each as a text and a function that applies it."""
    match node:
        case ast.Compare(ops=operators):
            for position, operator in enumerate(operators):
                for other in COMPARISONS[type(operator)]:
                    yield f"{type(operator).__name__} to {other.__name__}", _setter(operators, position, other())
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
        case ast.Return(value=value) if value is not None and not _is_nothing(value):
            yield "returns nothing", lambda: setattr(node, "value", ast.Constant(None))


def _setter(items: list[ast.cmpop], position: int, item: ast.cmpop) -> Callable[[], None]:
    return lambda: items.__setitem__(position, item)


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
    """Yield the changes that leave a statement out of a body."""
    for body in (getattr(node, name, None) for name in ("body", "orelse")):
        if isinstance(body, list):
            for position, statement in enumerate(body):
                if _is_text(statement) or _ends_anyway(node, statement):
                    continue
                if isinstance(statement, ast.Assign | ast.AugAssign | ast.Expr | ast.Return | ast.For | ast.If):
                    yield f"without `{ast.unparse(statement).splitlines()[0]}`", _leaver(body, position)


def _ends_anyway(node: ast.AST, statement: ast.stmt) -> bool:
    """Return whether a statement returns nothing at the end of its function."""
    last = isinstance(node, ast.FunctionDef) and statement is node.body[-1]
    return last and isinstance(statement, ast.Return) and (statement.value is None or _is_nothing(statement.value))


def _leaver(body: list[ast.stmt], position: int) -> Callable[[], None]:
    return lambda: body.__setitem__(position, ast.Pass())


def _nodes(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes of code that runs: no imports, no annotations, no messages."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Import | ast.ImportFrom | ast.JoinedStr) or _is_text(node) or _is_message(node):
            continue
        yield node
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list"):
                continue
            waiting += [each for each in (value if isinstance(value, list) else [value]) if isinstance(each, ast.AST)]


def _is_message(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value


def _is_nothing(value: ast.expr) -> bool:
    """Return whether a caller that tests for truth or for None cannot distinguish the value from nothing."""
    return isinstance(value, ast.Constant) and (value.value is None or value.value is False)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def source_of(module: str) -> Path:
    return ROOT.joinpath(*module.split(".")).with_suffix(".py")


def parsed(module: str) -> ast.Module:
    return ast.parse(source_of(module).read_text(encoding="utf-8"))


def lines_of(tree: ast.Module, functions: Collection[str]) -> set[int]:
    nodes = [each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef) and each.name in functions]
    assert len(nodes) == len(functions)
    return {line for each in nodes for line in range(each.lineno, (each.end_lineno or each.lineno) + 1)}


def mutants_of(module: str, functions: Collection[str] = ()) -> Iterator[Mutant]:
    """Yield the mutants of some functions, or of the whole module."""
    original = parsed(module)
    lines = lines_of(original, functions)
    parents = {child: node for node in ast.walk(original) for child in ast.iter_child_nodes(node)}
    for number, node in enumerate(_nodes(original)):
        if functions and getattr(node, "lineno", 0) not in lines:
            continue
        for kind in (changes_of, omissions_of):
            for position, (text, _) in enumerate(kind(node)):
                tree = deepcopy(original)
                copied = list(_nodes(tree))[number]
                _, change = list(kind(copied))[position]
                change()
                shown = parents[node] if isinstance(node, ast.Constant) else node
                source = ast.unparse(shown).splitlines()[0][:90]
                line = getattr(node, "lineno", 0)
                yield Mutant(line, f"{text} in `{source}`", ast.fix_missing_locations(tree))
