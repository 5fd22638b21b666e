"""The world of a simulated robot: the ground, the disturbances, and how robot and drives differ from the defaults.

A world is one TOML file; example_world.toml shows every section. Keys are the fields of the parts' own records, which
define unit and bounds. The file leaves out what the robot's configuration fixes (geometry, arm, wiring, a fixed base),
because the daemon knows these and does not know the world.
"""

from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

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
from simulation.body.free_body import BodyShape
from simulation.body.plant import STEP_S
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness.lockstep import FIXED_OF_DRIVE, drives_of, plant_of
from simulation.mud.clay import DRIEST_PERCENT, WETTEST_PERCENT, Clay, clay_of_water
from simulation.mud.disturbances import DRIVE_FIELDS, NONE, Disturbances, drive_changes
from simulation.mud.ground_contact import Ground
from simulation.mud.grounds.sand import Sand
from simulation.mud.grounds.thixotropic_mud import ThixotropicMud
from simulation.mud.grounds.thixotropy import Thixotropy
from simulation.mud.layer import Layer
from simulation.mud.stones import Stone
from simulation.mud.track import LEVEL, UNIFORM, Track
from simulation.mud.unevenness import RandomStrength, Ridges

STRONGEST_PA = 50e3  # of a segment and of its layers: over ten times the paper's stiffest mud
PAVLOV_N_M3 = 1.55e6  # fits plates that were pushed into dry sand (Pavlov 2022)
SAME_POSITION_M = 1e-9

FIXED_OF_ROBOT = frozenset({"rig", "geometry", "arm_mass", "disturbances", "fixed_base"})


@dataclass(frozen=True)
class World:
    """`Lockstep(configuration, world.track, plant=world.plant(configuration), drives=world.drives(configuration))`."""

    track: Track
    disturbances: Disturbances = NONE
    robot_changes: Mapping[str, Any] = field(default_factory=dict)  # fields of PlantParameters
    drive_changes: Mapping[str, Any] = field(default_factory=dict)  # of SimulatedDriveParameters, for all of them
    warnings: tuple[str, ...] = ()  # about keys that the file gives under their former names

    def plant(self, configuration: Configuration) -> PlantParameters:
        """Raise ConfigurationError where the world has a free body and the configuration a fixed base."""
        fixed_base = configuration.estimation.fixed_base
        if fixed_base and self.robot_changes.get("free_body"):
            raise ConfigurationError(["robot.free_body = true: the configuration says estimation.fixed_base = true"])
        changes = {"fixed_base": fixed_base} | dict(self.robot_changes)
        body: BodyShape | None = changes.get("body")
        if body and body.axis_above_belly_m == BodyShape.axis_above_belly_m:  # left out: that of the configuration
            changes["body"] = replace(body, axis_above_belly_m=configuration.geometry.axis_height_m)
        return plant_of(configuration, self.disturbances, **changes)

    def drives(self, configuration: Configuration, **defaults: Any) -> dict[str, SimulatedDriveParameters]:
        """`defaults`: replace the usual values where neither disturbances nor the file set them."""
        return drives_of(configuration, **(defaults | drive_changes(self.disturbances) | dict(self.drive_changes)))


@dataclass(frozen=True)
class SegmentText:
    """One stretch of the track: mud by its water content or its strength, or dry sand."""

    start_m: Annotated[float, Bounds(0.0, 1000.0)]
    end_m: Annotated[float, Bounds(0.0, 1000.0)]
    water_percent: Annotated[float | None, Bounds(DRIEST_PERCENT, WETTEST_PERCENT)] = None
    strength_pa: Annotated[float | None, Bounds(50.0, STRONGEST_PA)] = None
    sand: Literal["generic", "spatial"] | None = None
    stiffness_n_m3: Annotated[float, Bounds(1e4, 5e6)] = PAVLOV_N_M3  # of the sand
    layer: list[Layer] = field(default_factory=list)
    thixotropy: Thixotropy | None = None

    @property
    def clay(self) -> Clay:
        """The clay, named after its water content or else by its strength."""
        if self.strength_pa is None:
            assert self.water_percent is not None
            return clay_of_water(self.water_percent)._replace(layers=tuple(self.layer))
        return Clay(f"{self.strength_pa:g} Pa", self.strength_pa, tuple(self.layer))

    @property
    def ground(self) -> Ground:
        if self.sand:
            return Sand(f"{self.sand} sand", self.stiffness_n_m3, self.sand == "spatial")
        return ThixotropicMud(self.clay, self.thixotropy) if self.thixotropy else self.clay


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
        segments = [(segment.end_m - segment.start_m, segment.ground) for segment in self.segment]
        track = Track(segments, self.stone, self.ridges, self.random_strength)
        return World(track, self.disturbances, self.robot, self.drives)


_READER = RecordReader(WorldText)
FORMER_KEYS = {"drives.repeated_share": "repeated_fraction"}  # of version 0.1, accepted in version 0.2


def load_world(path: Path) -> World:
    """Read a world file. Raises ConfigurationError, also where the file cannot be read."""
    return parse_world(read_text(path), path)


def parse_world(text: str, file: Path | None = None) -> World:
    """Read a world. Raises ConfigurationError, which names the file."""
    document = parse_document(text, file)
    try:
        return read_world(document)
    except ConfigurationError as problem:
        raise problem.of(file) if file else problem from None


def read_world(document: dict[str, Any]) -> World:
    """Read a world from the tables of its file.

    Raises ConfigurationError with all problems of single keys, or else with all contradictions between them.
    """
    warnings = tuple(rename_former_keys(document, FORMER_KEYS))
    text = WorldText(**_READER.read(document))
    problems = list(_contradictions(text))
    if problems:
        raise ConfigurationError(problems)
    return replace(text.world, warnings=warnings)


def _contradictions(text: WorldText) -> Iterator[str]:
    """Yield contradictions between fields."""
    if not text.segment:
        yield "segment = []: must be at least one"
    expected_m, where = 0.0, "where the track begins"
    for number, segment in enumerate(text.segment, 1):
        key, start_m, end_m = f"segment {number}", segment.start_m, segment.end_m
        if abs(start_m - expected_m) > SAME_POSITION_M:
            wrong = "overlap" if start_m < expected_m else "gap"
            yield f"{key}.start_m = {start_m:g}: must be {expected_m:g}, {where}, without {wrong}"
        if end_m <= start_m:
            yield f"{key}.end_m = {end_m:g}: must be more than start_m = {start_m:g}"
        yield from _mud_problems(key, segment)
        expected_m, where = end_m, f"where segment {number} ends"
    yield from _stone_problems(text)
    yield from _robot_problems(text.robot)
    for source, names in DRIVE_FIELDS.items():
        disturbance = getattr(text.disturbances, source)
        for name in text.drives.keys() & set(names) if disturbance else ():
            conflicting = f"disturbances.{source} = {disturbance:g}"
            yield f"drives.{name} = {shown(text.drives[name])}: cannot be combined with {conflicting}"


def _mud_problems(key: str, segment: SegmentText) -> Iterator[str]:
    water, strength, sand = segment.water_percent, segment.strength_pa, segment.sand
    if not sand and segment.stiffness_n_m3 != PAVLOV_N_M3:
        yield f"{key}.stiffness_n_m3 = {segment.stiffness_n_m3:g}: belongs to sand; remove it, or name the sand"
    if sand:
        for name in ("water_percent", "strength_pa", "layer", "thixotropy"):
            if getattr(segment, name):
                yield f"{key}.{name}: cannot be combined with sand = {shown(sand)}; remove one of them"
    elif water is None and strength is None:
        yield f"{key}: water_percent, strength_pa or sand is missing"
    elif water is None or strength is None:
        yield from _layer_problems(key, segment.layer, segment.clay.strength_pa)
    else:
        wrong = f"cannot be combined with strength_pa = {strength:g}; remove one of them"
        yield f"{key}.water_percent = {water:g}: {wrong}"


def _layer_problems(key: str, layers: list[Layer], strength_pa: float) -> Iterator[str]:
    last_m = 0.0
    for number, (top_m, bottom_m, factor) in enumerate(map(astuple, layers), 1):
        if top_m < last_m:
            yield f"{key}.layer {number}.top_m = {top_m:g}: must be at least {last_m:g}, where layer {number - 1} ends"
        if bottom_m <= top_m:
            yield f"{key}.layer {number}.bottom_m = {bottom_m:g}: must be more than top_m = {top_m:g}"
        if factor * strength_pa > STRONGEST_PA:
            most = f"at most {STRONGEST_PA / strength_pa:.3g} in mud of {strength_pa:.0f} Pa"
            yield f"{key}.layer {number}.factor = {factor:g}: must be {most}"
        last_m = bottom_m


def _robot_problems(changes: Mapping[str, Any]) -> Iterator[str]:
    """Yield a damping that would stop the body in less than a step of the integrator."""
    mass_kg, damping_n_s_m = (
        changes.get(name, getattr(PlantParameters, name)) for name in ("body_mass_kg", "rail_damping_n_s_m")
    )
    if damping_n_s_m > mass_kg / STEP_S:
        most = f"must be at most {mass_kg / STEP_S:g} for robot.body_mass_kg = {mass_kg:g}"
        yield f"robot.rail_damping_n_s_m = {damping_n_s_m:g}: {most}"


def _stone_problems(text: WorldText) -> Iterator[str]:
    last_m, amplitude_m = -1.0, text.ridges.amplitude_m
    for number, (start_m, end_m, top_m) in enumerate(map(astuple, text.stone), 1):
        if start_m <= last_m:
            yield f"stone {number}.start_m = {start_m:g}: must be more than {last_m:g}, where stone {number - 1} ends"
        if end_m <= start_m:
            yield f"stone {number}.end_m = {end_m:g}: must be more than start_m = {start_m:g}"
        if top_m < amplitude_m:
            yield f"stone {number}.top_m = {top_m:g}: must be at least {amplitude_m:g}, ridges.amplitude_m"
        last_m = end_m
