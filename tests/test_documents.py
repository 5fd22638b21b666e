"""The links of the documents at the top lead to files, and the generated references are whole and valid."""

import re
import tomllib
from collections.abc import Mapping
from typing import Any

import pytest
import tomlkit

from command_line.init.key_reference import configuration_keys
from command_line.json_output import SCHEMAS
from docs.generate.pages import TABLES, sections
from drivers.drive_types import DRIVE_TYPES
from experiments.study.catalogue import study_texts
from firmware_host.configuration.loading import parse_configuration
from tests.folders import EXAMPLE_CONFIGURATION, ROOT


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_local_links_lead_to_files(name: str) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)", (ROOT / name).read_text(encoding="utf-8"))
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_no_text_asks_pip_for_the_package_by_its_name() -> None:
    """The package of that name on PyPI is another project's."""
    asks = re.compile(r"pip install (-\S+ )*[\"']?mudskipper\b(?!/)")
    found = [path.relative_to(ROOT) for kind in ("md", "py") for path in ROOT.glob(f"*/**/*.{kind}")]
    ours = [path for path in found if path.parts[0] not in (".venv", "build")]
    assert [path for path in ours if asks.search((ROOT / path).read_text(encoding="utf-8"))] == []


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
    for drive_type in DRIVE_TYPES.values():
        keys = configuration_keys(drive_type.parameters, "drive.NAME")
        assert all(f"{key.name}` |" in texts["configuration"] for key in keys)


NEEDED = {"safety": {"motion": {"longest_hold_s": 1800.0}}}  # by an example: the bound for which it gives a reason


def test_each_example_of_a_section_is_accepted_by_the_daemon() -> None:
    whole = tomllib.loads(EXAMPLE_CONFIGURATION.read_text(encoding="utf-8"))
    texts = re.findall(r"```toml\n(.*?)\n```", "\n".join(sections()), re.DOTALL)
    names = dict.fromkeys(key.section for key in configuration_keys())
    examples = dict(zip(names, map(tomllib.loads, texts), strict=True))
    for name, example in examples.items():
        copied = _merged(whole, _merged(example, NEEDED.get(name, {})))
        for each in examples:
            if each.startswith(f"{name}."):  # [pose] needs [pose.natnet]
                copied = _merged(copied, examples[each])
        parse_configuration(tomlkit.dumps(copied))


def _merged(into: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return `into` with the keys of `given`, table by table."""
    both = {
        key: _merged(into[key], value) if isinstance(value, dict) and key in into else value
        for key, value in given.items()
    }
    return {**into, **both}
