"""The methods of choosing depth and gait by their names in the configuration, and what the log says of a choice."""

from __future__ import annotations

from collections.abc import Callable

from control.depth.depth_choice import Adaptation, AdaptationParameters, DepthAdaptation, DepthChoice, Method
from control.depth.gait_choice import GaitAdaptation
from control.depth.paper_choice import PaperAdaptation
from control.gait.gait import GaitParameters
from control.geometry import FlipperGeometry
from firmware_host.configuration.configuration import Configuration

METHODS: dict[Method, Callable[[AdaptationParameters, FlipperGeometry, GaitParameters], Adaptation]] = {
    "default": DepthAdaptation,
    "paper": PaperAdaptation,
    "gait": GaitAdaptation,
}


def adaptation_of(configuration: Configuration) -> Adaptation:
    kind = METHODS[configuration.adaptation.method]
    return kind(configuration.adaptation, configuration.geometry, configuration.gait)


def choice_text(choice: DepthChoice) -> str:
    sweep = f", sweep {choice.gait.sweep_angle_deg:g} degrees" if choice.gait else ""
    return f"depth {choice.depth_m:.4f} m{sweep}: {choice.reason}{', slips' if choice.slips else ''}"
