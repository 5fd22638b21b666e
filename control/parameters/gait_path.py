"""A gait as a file describes it: phases, each with the path of a flipper's tip, its time and what ends it early.

Every flipper follows the same path. A path begins where the phase before ends, and the first one where the last one
ends, so no gait jumps.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from control.bounds import Bounds, Meaning

LONGEST_JSON = 3000  # characters of a gait on its way to the daemon


@dataclass(frozen=True)
class WayPoint:
    """A position of the plate's lower edge. Its depth is stated once: in metres or as a fraction."""

    sweep_deg: Annotated[float, Bounds(-80.0, 80.0), Meaning("of the arm; positive in front of its joint")]
    depth_m: Annotated[float | None, Bounds(-0.2, 0.2), Meaning("below the nominal surface; negative above it")] = None
    depth_fraction: Annotated[
        float | None,
        Bounds(-1.0, 1.0),
        Meaning("in place of depth_m: 1 is the stride's depth, 0 the surface, -1 the height of the level arm"),
    ] = None


@dataclass(frozen=True)
class GaitPhase:
    name: Annotated[
        Literal["insertion", "stance", "extraction", "swing", "pause"],
        Meaning("what the phase is for; the last phase, and no other, is the swing through the air"),
    ]
    way_points: Annotated[tuple[WayPoint, ...], Meaning("of the path, which begins where the phase before ends")] = ()
    curve: Annotated[
        Literal["lines", "half_ellipse"],
        Meaning("lines rest at each way-point; a half ellipse goes through the first way-point to the second one"),
    ] = "lines"
    speed_m_s: Annotated[float | None, Bounds(0.005, 2.0), Meaning("of the plate's lower edge along the path")] = None
    duration_s: Annotated[float | None, Bounds(0.02, 60.0), Meaning("of the path, in place of speed_m_s")] = None
    until_force_n: Annotated[
        float | None, Bounds(0.2, 50.0), Meaning("of the mud on a flipper that ends the phase early; 1 is a contact")
    ] = None
    until_depth_m: Annotated[
        float | None,
        Bounds(-0.2, 0.2),
        Meaning("measured at a flipper on its way down, from which on the phase ends early"),
    ] = None


@dataclass(frozen=True)
class GaitPath:
    phase: Annotated[tuple[GaitPhase, ...], Meaning("the phases of a stride, in order")]
    name: Annotated[str, Meaning("for messages and the log; the file's name by default")] = ""
    depths_m: Annotated[
        tuple[float, ...],
        Meaning("depth of every stride, or of the strides in turn; without it, as ordered or as the mud allows"),
    ] = ()
    right_offset_fraction: Annotated[
        float,
        Bounds(0.0, 0.9),
        Meaning("of a stride by which the right flipper is later, as 0.5; a walk ends with the left one's last stride"),
    ] = 0.0
