"""The documents at the top of the project stay short, and the targets of their links exist."""

from __future__ import annotations

import re

import pytest

from command_line.init.key_reference import configuration_keys
from command_line.json_output import SCHEMAS
from docs.generate.pages import TABLES
from experiments.study.catalogue import study_texts
from tests.folders import ROOT

LONGEST_README = 9000  # bytes


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= LONGEST_README


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_local_links_lead_to_files(name: str) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)", (ROOT / name).read_text(encoding="utf-8"))
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_reference_describes_every_json_shape() -> None:
    text = (ROOT / "docs" / "reference" / "json.md").read_text(encoding="utf-8")
    headings = {*re.findall(r"^## ([\w-]+)/(\d+)$", text, re.MULTILINE), ("experiment-NAME", "1")}
    shapes = {(name, str(version)) for name, version in SCHEMAS.items()}
    assert headings == shapes | {("experiment-NAME", "1")}
    assert all(f"`{name}`" in text for name in study_texts())


def test_every_generated_table_has_lines_and_the_configuration_all_keys() -> None:
    texts = {name: "\n".join(lines()) for name, lines in TABLES.items()}
    assert all(text.count("\n") > 5 for text in texts.values())
    assert all(f"| `{key.name}` |" in texts["configuration"] for key in configuration_keys())
