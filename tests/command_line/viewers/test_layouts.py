"""Every path in a layout names a field of our logs, or of a message of `mudskipper live`, that a viewer can show."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from command_line.live.standard_messages import TOPICS
from command_line.viewers.open_log import LAYOUTS
from firmware_host.log.rows import ROW_KINDS
from firmware_host.log.schema import TEXT
from tests.folders import ROOT

FIELDS = {kind.topic: {field.name: field for field in kind.fields} for kind in ROW_KINDS}
FOXGLOVE = re.compile(r"(?P<topic>/\w+)(?:\{(?P<filter>\w+)==\d+\})?\.(?P<field>\w+)(?:\[(?P<index>\d+)\])?")
PLOTJUGGLER = re.compile(r"(?P<topic>/\w+)/(?P<field>\w+)(?:\[(?P<index>\d+)\])?")


@pytest.fixture(scope="module")
def foxglove() -> dict[str, Any]:
    return dict(json.loads((LAYOUTS / "foxglove.json").read_text(encoding="utf-8")))


def problem_of(path: str, grammar: re.Pattern[str], numeric: bool) -> str:
    """Return why a path shows no value; empty if it shows one."""
    found = grammar.fullmatch(path)
    if not found or found["topic"] not in FIELDS:
        return f"{path}: no topic of ours"
    fields = FIELDS[found["topic"]]
    wanted = [found["field"], *filter(None, [found.groupdict().get("filter")])]
    if not fields.keys() >= set(wanted):
        return f"{path}: no such field"
    field = fields[found["field"]]
    index = None if found["index"] is None else int(found["index"])
    if (index is None) != (field.length == 0) or (index is not None and index >= field.length):
        return f"{path}: {field.length} values"
    return f"{path}: text" if numeric and field.kind == TEXT else ""


def test_foxglove_shows_fields_of_the_log(foxglove: dict[str, Any]) -> None:
    panels = foxglove["configById"].values()
    paths = [path["value"] for panel in panels for path in panel.get("paths", [])]
    paths += [panel["topicPath"] for panel in panels if "topicPath" in panel]
    problems = [problem_of(path, FOXGLOVE, numeric=path != "/event.text") for path in paths]
    assert problems and not any(problems)


def test_plotjuggler_shows_fields_of_the_log() -> None:
    curves = ElementTree.parse(LAYOUTS / "plotjuggler.xml").iter("curve")
    problems = [problem_of(curve.attrib["name"], PLOTJUGGLER, numeric=True) for curve in curves]
    assert problems and not any(problems)


def panels_in(layout: Any) -> Iterator[str]:
    if isinstance(layout, str):
        yield layout
    else:
        yield from panels_in(layout["first"])
        yield from panels_in(layout["second"])


def test_every_panel_of_foxglove_is_placed_and_described(foxglove: dict[str, Any]) -> None:
    tabs = foxglove["configById"][foxglove["layout"]]["tabs"]
    placed = {panel for tab in tabs for panel in panels_in(tab["layout"])}
    assert placed | {foxglove["layout"]} == foxglove["configById"].keys()


def test_the_standard_topics_of_foxglove_are_served_live(foxglove: dict[str, Any]) -> None:
    panels = foxglove["configById"]
    assert {*panels["3D!robot"]["topics"], panels["DiagnosticSummary!state"]["topicToRender"]} <= TOPICS.keys()


def test_plotjuggler_and_foxglove_can_decode_our_definitions() -> None:
    """The definitions use only the field types of ROS 2."""
    for kind in ROW_KINDS:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(kind.definition, kind.schema_name))
        assert [name for name, _ in store.fielddefs[kind.schema_name][1]] == [field.name for field in kind.fields]


def test_layouts_are_installed() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert '"command_line.viewers" = ["layouts/*"]' in project
    assert {path.name for path in Path(LAYOUTS).iterdir()} == {"foxglove.json", "plotjuggler.xml"}
