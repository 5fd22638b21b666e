"""The world of a simulated robot: the ground, the disturbances, and how robot and drives differ from the defaults.

A world is one TOML file; example_world.toml shows every section. Keys are the fields of the parts' own records, which
define unit and bounds. The file leaves out what the robot's configuration fixes (geometry, arm, wiring, a fixed base),
because the daemon knows these and does not know the world.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path
from typing import Annotated, Any

from control.bounds import Bounds
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.toml_records import (
    ChangesOf,
    RecordReader,
    parse_document,
    read_text,
    rename_former_keys,
    shown,
)
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness.lockstep import drives_of, plant_of
from simulation.mud.clay import DRIEST_PERCENT, WETTEST_PERCENT, Clay, clay_of_water
from simulation.mud.disturbances import DRIVE_FIELDS, NONE, Disturbances, drive_changes
from simulation.mud.layer import Layer
from simulation.mud.stones import Stone
from simulation.mud.track import LEVEL, UNIFORM, Track
from simulation.mud.unevenness import RandomStrength, Ridges

STRONGEST_PA = 50e3  # of a segment and of its layers: ten times the paper's stiffest mud
SAME_POSITION_M = 1e-9

FIXED_OF_ROBOT = frozenset({"rig", "geometry", "arm_mass", "disturbances", "fixed_base"})
FIXED_OF_DRIVE = frozenset(
    {"type", "node_id", "sign", "zero_turn", "torque_constant_nm_a", "current_limit_a", "model", "torque_range_nm"}
)


@dataclass(frozen=True)
class World:
    """`Lockstep(configuration, world.track, plant=world.plant(configuration), drives=world.drives(configuration))`."""

    track: Track
    disturbances: Disturbances = NONE
    robot_changes: Mapping[str, Any] = field(default_factory=dict)  # fields of PlantParameters
    drive_changes: Mapping[str, Any] = field(default_factory=dict)  # of SimulatedDriveParameters, for all of them
    warnings: tuple[str, ...] = ()  # about keys that the file gives under their former names

    def plant(self, configuration: Configuration) -> PlantParameters:
        """Raises ConfigurationError where the world has a free body and the configuration a fixed base."""
        fixed_base = configuration.estimation.fixed_base
        if fixed_base and self.robot_changes.get("free_body"):
            raise ConfigurationError(["robot.free_body = true: the configuration says estimation.fixed_base = true"])
        return plant_of(configuration, self.disturbances, **({"fixed_base": fixed_base} | dict(self.robot_changes)))

    def drives(self, configuration: Configuration, **defaults: Any) -> dict[str, SimulatedDriveParameters]:
        """`defaults`: replace the usual values where neither disturbances nor the file set them."""
        return drives_of(configuration, **(defaults | drive_changes(self.disturbances) | dict(self.drive_changes)))


@dataclass(frozen=True)
class SegmentText:
    """One stretch of the track, with its water content or its strength."""

    start_m: Annotated[float, Bounds(0.0, 1000.0)]
    end_m: Annotated[float, Bounds(0.0, 1000.0)]
    water_percent: Annotated[float | None, Bounds(DRIEST_PERCENT, WETTEST_PERCENT)] = None
    strength_pa: Annotated[float | None, Bounds(50.0, STRONGEST_PA)] = None
    layer: list[Layer] = field(default_factory=list)

    @property
    def clay(self) -> Clay:
        """The clay, named after its water content or else by its strength."""
        if self.strength_pa is None:
            assert self.water_percent is not None
            return clay_of_water(self.water_percent)._replace(layers=tuple(self.layer))
        return Clay(f"{self.strength_pa:g} Pa", self.strength_pa, tuple(self.layer))


@dataclass(frozen=True)
class WorldText:
    """The sections of the file."""

    segment: list[SegmentText]
    stone: list[Stone] = field(default_factory=list)
    ridges: Ridges = LEVEL
    random_strength: RandomStrength = UNIFORM
    disturbances: Disturbances = NONE
    robot: Annotated[dict[str, Any], ChangesOf(PlantParameters, FIXED_OF_ROBOT)] = field(default_factory=dict)
    drives: Annotated[dict[str, Any], ChangesOf(SimulatedDriveParameters, FIXED_OF_DRIVE)] = field(default_factory=dict)

    @property
    def world(self) -> World:
        segments = [(segment.end_m - segment.start_m, segment.clay) for segment in self.segment]
        track = Track(segments, self.stone, self.ridges, self.random_strength)
        return World(track, self.disturbances, self.robot, self.drives)


_READER = RecordReader(WorldText)
FORMER_KEYS = {"drives.repeated_share": "repeated_fraction"}  # of version 0.1, accepted in version 0.2


def load_world(path: Path) -> World:
    """Reads a world file. Raises ConfigurationError, also where the file cannot be read."""
    return parse_world(read_text(path), path)


def parse_world(text: str, file: Path | None = None) -> World:
    """Reads a world. Raises ConfigurationError with all problems at once."""
    return read_world(parse_document(text, file))


def read_world(document: dict[str, Any]) -> World:
    """Reads a world from the tables of its file. Raises ConfigurationError with all problems at once."""
    warnings = tuple(rename_former_keys(document, FORMER_KEYS))
    problems = _READER.problems(document) + list(_contradictions(document))
    if problems:
        raise ConfigurationError(problems)
    return replace(WorldText(**_READER.read(document)).world, warnings=warnings)


def _contradictions(document: Mapping[str, Any]) -> Iterator[str]:
    """Yields contradictions between fields. A value that is not a number contradicts nothing."""
    segments = _tables(document, "segment")
    if document.get("segment") == []:
        yield "segment = []: must be at least one"
    yield from _border_problems(segments)
    for number, segment in enumerate(segments, 1):
        yield from _mud_problems(f"segment {number}", segment)
        yield from _layer_problems(f"segment {number}", segment)
    yield from _stone_problems(document)
    yield from _drive_problems(document)


def _tables(table: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    """Returns the tables of an array; any other item counts as an empty table, so that the numbering stays."""
    array = table.get(key)
    return [item if isinstance(item, dict) else {} for item in array] if isinstance(array, list) else []


def _number(table: Mapping[str, Any], key: str) -> float:
    """Returns NaN, with which no comparison is true, where there is no number."""
    value = table.get(key)
    try:
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else nan
    except OverflowError:  # a whole number beyond all floats
        return nan


def _border_problems(segments: list[dict[str, Any]]) -> Iterator[str]:
    expected_m, where = 0.0, "where the track begins"
    for number, segment in enumerate(segments, 1):
        start_m, end_m = _number(segment, "start_m"), _number(segment, "end_m")
        if abs(start_m - expected_m) > SAME_POSITION_M:
            wrong = "overlap" if start_m < expected_m else "gap"
            yield f"segment {number}.start_m = {start_m:g}: must be {expected_m:g}, {where}, without {wrong}"
        if end_m <= start_m:
            yield f"segment {number}.end_m = {end_m:g}: must be more than start_m = {start_m:g}"
        expected_m, where = end_m, f"where segment {number} ends"


def _mud_problems(key: str, segment: dict[str, Any]) -> Iterator[str]:
    if "water_percent" in segment and "strength_pa" in segment:
        yield (
            f"{key}.water_percent = {shown(segment['water_percent'])}: cannot be combined with"
            f" strength_pa = {shown(segment['strength_pa'])}; remove one of them"
        )
    if "water_percent" not in segment and "strength_pa" not in segment:
        yield f"{key}: water_percent or strength_pa is missing"


def _layer_problems(key: str, segment: dict[str, Any]) -> Iterator[str]:
    strength_pa, last_m = _strength_pa(segment), 0.0
    for number, layer in enumerate(_tables(segment, "layer"), 1):
        top_m, bottom_m, factor = (_number(layer, name) for name in ("top_m", "bottom_m", "factor"))
        if top_m < last_m:
            yield f"{key}.layer {number}.top_m = {top_m:g}: must be at least {last_m:g}, where layer {number - 1} ends"
        if bottom_m <= top_m:
            yield f"{key}.layer {number}.bottom_m = {bottom_m:g}: must be more than top_m = {top_m:g}"
        if factor * strength_pa > STRONGEST_PA:
            yield (
                f"{key}.layer {number}.factor = {factor:g}: must be at most {STRONGEST_PA / strength_pa:.3g}"
                f" in mud of {strength_pa:.0f} Pa"
            )
        last_m = bottom_m


def _strength_pa(segment: dict[str, Any]) -> float:
    water_percent = _number(segment, "water_percent")
    if DRIEST_PERCENT <= water_percent <= WETTEST_PERCENT:
        return clay_of_water(water_percent).strength_pa
    return _number(segment, "strength_pa")


def _stone_problems(document: Mapping[str, Any]) -> Iterator[str]:
    ridges = document.get("ridges")
    amplitude_m = _number(ridges, "amplitude_m") if isinstance(ridges, dict) else 0.0
    last_m = -1.0
    for number, stone in enumerate(_tables(document, "stone"), 1):
        start_m, end_m, top_m = (_number(stone, name) for name in ("start_m", "end_m", "top_m"))
        if start_m <= last_m:
            yield f"stone {number}.start_m = {start_m:g}: must be more than {last_m:g}, where stone {number - 1} ends"
        if end_m <= start_m:
            yield f"stone {number}.end_m = {end_m:g}: must be more than start_m = {start_m:g}"
        if 0.0 <= top_m < amplitude_m:
            yield f"stone {number}.top_m = {top_m:g}: must be at least {amplitude_m:g}, ridges.amplitude_m"
        last_m = end_m


def _drive_problems(document: Mapping[str, Any]) -> Iterator[str]:
    """Yields the fields of the drives that a disturbance sets too."""
    disturbances, drives = document.get("disturbances"), document.get("drives")
    if not isinstance(disturbances, dict) or not isinstance(drives, dict):
        return
    for source, names in DRIVE_FIELDS.items():
        if _number(disturbances, source) > 0.0:
            for name in drives.keys() & set(names):
                conflicting = f"disturbances.{source} = {disturbances[source]}"
                yield f"drives.{name} = {shown(drives[name])}: cannot be combined with {conflicting}"
