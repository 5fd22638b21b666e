"""How a walking robot comes to its insertion depth: one depth for all strides, or chosen by a method of adaptation.

A constant depth and the method "paper" are walked by the paper's robot, with the paper's estimator. Every other method
is walked by this project's robot with all of its features.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple, cast, get_args

from control.controller import WalkOrder
from control.parameters.adaptation_parameters import Method
from control.parameters.recovery_parameters import RecoveryParameters
from experiments.trackway.walk import Walk, WalkedStride, walk_in
from experiments.trials.trial import WALKING, configuration_of
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.toml_records import parse_document
from simulation.harness.lockstep import Lockstep, plant_of
from simulation.mud.clay import MUDS
from simulation.mud.disturbances import TRACKWAY, Disturbances
from simulation.mud.track import Track

METHODS: tuple[Method, ...] = get_args(Method)
PAPER = "paper"


class DepthRule(NamedTuple):
    name: str
    depth_m: float  # of every stride; of the first stride where a method chooses
    method: str = ""  # empty: constant

    @property
    def order(self) -> WalkOrder:
        return WalkOrder(self.depth_m, adaptive=bool(self.method))


def constant_depth(depth_m: float) -> DepthRule:
    return DepthRule(f"{100.0 * depth_m:g} cm", depth_m)


def rule_of(depth_m: float, method: str) -> DepthRule:
    """Return the rule of a method of adaptation, or of a constant depth where none is named."""
    return chosen_by(method) if method else constant_depth(depth_m)


def chosen_by(method: str) -> DepthRule:
    return DepthRule(method, configuration_of(WALKING).adaptation.initial_depth_m, method)


def walking_world() -> dict[str, Any]:
    """Return what walks depend on besides their parameters, as it was read."""
    return {
        "configuration": parse_document(configuration_of(WALKING).text),
        "disturbances": asdict(TRACKWAY),
        "muds": [[clay.name, clay.strength_pa] for clay in MUDS.values()],
    }


def arm_m() -> float:
    """Return the length of the walking robot's flippers."""
    return configuration_of(WALKING).geometry.flipper_length_m


def configuration_for(rule: DepthRule) -> Configuration:
    configuration = configuration_of(WALKING)
    if not rule.method:
        return _papers_robot(configuration)
    adaptation = replace(configuration.adaptation, method=cast(Method, rule.method))
    configuration = replace(configuration, adaptation=adaptation)
    return _papers_robot(configuration) if rule.method == PAPER else configuration


def _papers_robot(configuration: Configuration) -> Configuration:
    """Use the paper's estimator, and a gait that does not wait for a flipper stuck in the mud."""
    return replace(
        configuration,
        estimation=replace(configuration.estimation, method="paper"),
        recovery=RecoveryParameters(attempts=0),
    )


def walk_by(
    rule: DepthRule,
    track: Track,
    seed: int,
    done: Callable[[Sequence[WalkedStride]], bool],
    disturbances: Disturbances = TRACKWAY,
    **plant: Any,
) -> Walk:
    """Walk until `done`, with the disturbances of mud and drives on the trackway. `plant` changes parameters."""
    configuration = configuration_for(rule)
    changed = plant_of(configuration, disturbances, **plant)
    lockstep = Lockstep(configuration, track, seed, disturbances=disturbances, plant=changed)
    return walk_in(lockstep, track, rule.order, done)
