"""Makes the controller and the choice of depth that the configuration describes, and describes a choice for the log."""

from __future__ import annotations

from collections.abc import Callable

from control.controller import Controller
from control.depth.depth_choice import Adaptation, AdaptationParameters, DepthAdaptation, DepthChoice, Method
from control.depth.gait_choice import GaitAdaptation, quickest
from control.depth.paper_choice import PaperAdaptation
from control.gait.gait import GaitParameters
from control.gait.recovery import Recovery
from control.geometry import FlipperGeometry
from firmware_host.configuration.configuration import Configuration

METHODS: dict[Method, Callable[[AdaptationParameters, FlipperGeometry, GaitParameters], Adaptation]] = {
    "default": DepthAdaptation,
    "paper": PaperAdaptation,
    "gait": GaitAdaptation,
}


def make_controller(configuration: Configuration) -> Controller:
    recovery = Recovery(
        configuration.recovery,
        configuration.geometry,
        quickest(configuration.adaptation, configuration.geometry, configuration.gait),
        configuration.joint_ranges,
    )
    return Controller(
        configuration.gait,
        configuration.geometry,
        configuration.gains,
        configuration.arm,
        configuration.motion,
        recovery,
    )


def make_adaptation(configuration: Configuration) -> Adaptation:
    kind = METHODS[configuration.adaptation.method]
    return kind(configuration.adaptation, configuration.geometry, configuration.gait)


def choice_text(choice: DepthChoice) -> str:
    sweep = f", sweep {choice.gait.sweep_angle_deg:g} degrees" if choice.gait else ""
    return f"depth {choice.depth_m:.4f} m{sweep}: {choice.reason}{', slips' if choice.slips else ''}"
