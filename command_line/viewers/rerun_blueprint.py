"""The views of a log in Rerun: the robot in 3D, joints, forces, and tables of strides and events.

Rerun reads the standard messages of `mudskipper log export --ros`. The tables below name what each view shows.
"""

from pathlib import Path
from typing import Any, NamedTuple

from control.records import FLIPPERS


class Field(NamedTuple):
    """A number within a message, for a message that Rerun does not plot by itself."""

    topic: str
    message: str  # type of the message
    path: str  # within it
    name: str


WRENCH = "geometry_msgs/WrenchStamped"
SCALARS = {  # view -> topic and field of a message whose numbers Rerun plots by name
    "Angle (rad)": ("/joint_states", "position"),
    "Velocity (rad/s)": ("/joint_states", "velocity"),
    "Torque command (N·m)": ("/joint_states", "effort"),
}
FORCES = [
    Field(f"/{flipper}/force", WRENCH, f"wrench.force.{axis}", f"{flipper} {axis}")
    for flipper in FLIPPERS
    for axis in ("x", "z")
]
SPATIAL = ("/tf", "/left/pose", "/right/pose")
TABLES = {"Strides": "/stride", "Events": "/event", "Diagnostics": "/diagnostics"}


def blueprint() -> Any:
    """Raises ModuleNotFoundError without rerun."""
    import rerun.blueprint as rrb

    plots = [
        rrb.TimeSeriesView(name=name, origin=f"{topic}/{field}", contents="$origin/**")
        for name, (topic, field) in SCALARS.items()
    ]
    tables = [rrb.DataframeView(name=name, origin=topic) for name, topic in TABLES.items()]
    robot = rrb.Spatial3DView(name="Robot", origin="/", contents=[f"+ {topic}/**" for topic in SPATIAL])
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(robot, rrb.Tabs(*tables)), rrb.Vertical(*plots, _force_view())),
        collapse_panels=True,
    )


def _force_view() -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    overrides: dict[str, list[Any]] = {}
    for field in FORCES:
        mapping = rrb.encodings.VisualizerComponentMapping(
            "Scalars:scalars",
            rrb.encodings.ComponentSourceKind.SourceComponent,
            source_component=f"{field.message.replace('/', '.msg.')}:message",
            selector=f".{field.path}",
        )
        lines = rr.SeriesLines(names=field.name).visualizer(mappings=[mapping])
        overrides.setdefault(field.topic, []).append(lines)
    return rrb.TimeSeriesView(name="Force of the mud (N)", origin="/", contents=list(overrides), overrides=overrides)


def write_recording(log: Path, recording: Path) -> None:
    """Writes a log with standard messages and these views as a file of Rerun."""
    import rerun as rr

    rr.init("mudskipper")
    rr.save(recording, default_blueprint=blueprint())
    rr.log_file_from_path(log)
    rr.disconnect()
