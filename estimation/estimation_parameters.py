"""The method of the estimator, and what it knows of the rig."""

from dataclasses import dataclass
from typing import Annotated, Literal

from control.bounds import Bounds, Meaning

Method = Literal["default", "paper"]


@dataclass(frozen=True)
class PaperEstimationParameters:
    """Parameters of the method `paper` alone."""

    compensation: Annotated[bool, Meaning("add the body's drag to the thrust while the body advances")] = False


@dataclass(frozen=True)
class EstimationParameters:
    """The method, and what is known of the base and of the height of the mud."""

    method: Annotated[Method, Meaning("default regresses in torque space; paper is the published method")] = "default"
    fixed_base: Annotated[bool, Meaning("the flippers hang from a bench: all their travel shears mud")] = False
    free_body: Annotated[
        bool, Meaning("no rail or bench holds the body down: its flippers may lift it (adaptation.body_mass_kg)")
    ] = False
    surface_error_m: Annotated[
        float, Bounds(0.0001, 0.05), Meaning("std_error of the mud's nominal height at one stride")
    ] = 0.001
    paper: PaperEstimationParameters = PaperEstimationParameters()
