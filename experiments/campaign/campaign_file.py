"""Reads the file of a campaign: the sections of one walk, and the points at which some of their keys differ.

Every point is checked before the first trial, and both ends of every range.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from control.bounds import Bounds
from control.plate_outline import Corner
from experiments.campaign.planned_walk import SECTIONS, one_mud, plan_walk
from experiments.campaign.plate_file import read_corners
from experiments.campaign.points import Tables, Values, grid_points, random_points, range_ends, with_values
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.toml_records import RecordReader, parse_document, read_text, shown

MOST_TRIALS = 100_000
PLATE_KEY = "configuration.geometry.plate_corners_m"
SHOWN_KEYS = 6  # of a point, in a message


@dataclass(frozen=True)
class CampaignText:
    """The keys and tables of the file."""

    seeds: Annotated[int, Bounds(1, 10_000)] = 1  # walks at each point, by the seed of the simulated robot, from 1
    points: Annotated[int, Bounds(1, MOST_TRIALS)] = 100  # with [random]
    seed: Annotated[int, Bounds(0, 2**31 - 1)] = 1  # of the draws, with [random]
    grid: dict[str, Any] = field(default_factory=dict)
    random: dict[str, Any] = field(default_factory=dict)
    walk: dict[str, Any] = field(default_factory=dict)
    robot: dict[str, Any] = field(default_factory=dict)
    world: dict[str, Any] = field(default_factory=dict)
    configuration: dict[str, Any] = field(default_factory=dict)


class Plates:
    """Owns the corners that were read; a worker on another computer has no such file."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.corners: dict[str, tuple[Corner, ...]] = {}

    def in_configuration(self, tables: Tables) -> Tables:
        """Return the tables with the corners in place of the file's name. Raises ConfigurationError."""
        name = tables["robot"].get("plate", "")
        robot = {key: value for key, value in tables["robot"].items() if key != "plate"}
        corners = {PLATE_KEY: [list(corner) for corner in self._read(name)]} if name else {}
        return with_values(tables | {"robot": robot}, corners)

    def _read(self, name: Any) -> tuple[Corner, ...]:
        if not isinstance(name, str):
            raise ConfigurationError([f"robot.plate = {shown(name)}: must be the name of a file of corners"])
        try:
            if name not in self.corners:
                self.corners[name] = read_corners(self._folder / name)
        except ValueError as problem:
            raise ConfigurationError([f"robot.plate = {name!r}: {problem}"]) from None
        return self.corners[name]


class Campaign(NamedTuple):
    name: str
    identity: dict[str, Any]  # what must be the same when it continues
    points: list[Values]
    seeds: int
    base: Tables  # of a walk, without the values of a point
    plates: Plates


_READER = RecordReader(CampaignText)


def load_campaign(path: Path) -> Campaign:
    """Raises ConfigurationError."""
    document = parse_document(read_text(path), path)
    text = CampaignText(**_READER.read(document))
    _require_one_kind(document, path)
    is_random = "random" in document
    points = list(_points(text, is_random))
    base = {section: getattr(text, section) for section in SECTIONS}
    base["world"] = one_mud(text.world)
    plates = Plates(path.parent)
    for end in range_ends(text.random) if is_random else ():
        _check(points[0] | end, base, plates)
    for number, values in enumerate(points, 1):
        _check(values, base, plates, number)
    identity = document | {"plates": plates.corners}
    return Campaign(path.stem, identity, points, text.seeds, base, plates)


def _require_one_kind(document: Tables, path: Path) -> None:
    """Raises ConfigurationError."""
    if ("grid" in document) == ("random" in document):
        raise ConfigurationError([f"{path}: must have either [grid] or [random]"])
    for key in ("points", "seed"):
        if "grid" in document and key in document:
            raise ConfigurationError([f"{key} = {document[key]}: must be left out with [grid], which draws nothing"])


def _points(text: CampaignText, is_random: bool) -> Iterator[Values]:
    """Raises ConfigurationError where there are too many."""
    drawn = random_points(text.random, text.points, text.seed) if is_random else grid_points(text.grid)
    most = MOST_TRIALS // text.seeds
    yield from islice(drawn, most)
    if next(drawn, None) is not None:
        raise ConfigurationError([f"seeds = {text.seeds}: must give at most {MOST_TRIALS} trials with all points"])


def _check(values: Values, base: Tables, plates: Plates, number: int = 0) -> None:
    """Raises ConfigurationError, which names the point of several."""
    try:
        plan_walk(plates.in_configuration(with_values(base, values)))
    except ConfigurationError as problem:
        point = ", ".join(f"{key} = {shown(value)}" for key, value in list(values.items())[:SHOWN_KEYS])
        where = f"; at point {number}: {point}" if number else ""
        raise ConfigurationError([f"{each}{where}" for each in problem.problems[:1]]) from None
