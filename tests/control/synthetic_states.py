"""What drives tell of joints at rest."""

from __future__ import annotations

from control.records import DriveState, DriveStates, JointAngles, Joints


def states_at(pose: JointAngles) -> DriveStates:
    a, b, c, d = (DriveState(angle_rad=angle, velocity_rad_s=0.0) for angle in pose)
    return Joints(a, b, c, d)
