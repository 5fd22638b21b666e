"""The list of modules to compile names only modules that may be compiled."""

from __future__ import annotations

import ast
import tomllib

import pytest

from tests.folders import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
MODULES: list[str] = PROJECT["tool"]["mudskipper"]["compiled"]


def test_every_module_is_named_once() -> None:
    assert len(set(MODULES)) == len(MODULES)


@pytest.mark.parametrize("module", MODULES)
def test_no_compiled_class_has_bounds(module: str) -> None:
    """The compiler drops `Annotated`, so values beyond the bounds would pass."""
    tree = ast.parse((ROOT / module).read_text(encoding="utf-8"))
    assert "Annotated" not in {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
