"""States that the drives of joints at rest report."""

from control.records import DriveState, DriveStates, JointAngles, Torques, same_for_all

NO_TORQUE: Torques = same_for_all(0.0)


def states_at(pose: JointAngles) -> DriveStates:
    return pose.map(lambda angle_rad: DriveState(angle_rad=angle_rad, velocity_rad_s=0.0))
