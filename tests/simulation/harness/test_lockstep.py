"""Robot and loop in lockstep: repeatable, at any rate, and silent before every drive was heard."""

import pytest

from control.controller import WalkOrder
from control.modes import Mode
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.devices.motion_capture_parameters import MotionCaptureParameters
from simulation.harness.drive_presets import calibrated
from simulation.harness.lockstep import Lockstep, drives_of, plant_of
from simulation.mud.clay import MUDS
from simulation.mud.disturbances import LAB
from simulation.mud.track import Track

TRACK = Track([(1.0, MUDS["48.5"])])
IMPERFECTIONS = {
    "torque_constant_error": -0.05,
    "cogging_nm": 0.01,
    "current_lag_s": 0.0005,
    "current_noise_a": 0.3,
    "encoder_offset_rad": 0.01,
    "encoder_noise_rad": 0.0002,
    "message_delay_s": 0.001,
    "repeated_fraction": 0.2,
}


def test_the_same_seed_walks_the_same_strides_to_the_last_bit_and_another_one_others(
    configuration: Configuration,
) -> None:
    walks = []
    for seed, seconds in ((5, 1.7), (5, 1.7), (6, 0.1)):
        lockstep = Lockstep(configuration, TRACK, seed, disturbances=LAB)
        lockstep.arm()
        currents_a = {state.current_a for state in lockstep.loop.states}
        lockstep.walk(WalkOrder(0.03))
        lockstep.run_for(seconds)
        walked = repr((lockstep.loop.learning.strides, lockstep.loop.states, lockstep.robot.plant.body_m))
        walks.append((currents_a, walked))
    assert walks[0] == walks[1] and "StrideEstimate" in walks[0][1]
    assert not walks[0][0] & walks[2][0]


@pytest.mark.parametrize(("rate_hz", "imperfections"), [(200.0, {}), (380.0, IMPERFECTIONS), (1000.0, {})])
def test_a_robot_walks_at_any_rate_and_at_its_own_with_everything_that_can_be_wrong(
    configuration: Configuration, rate_hz: float, imperfections: dict[str, float]
) -> None:
    drives = drives_of(configuration, **imperfections)
    cameras = MotionCaptureParameters(rate_hz=120.0, latency_s=0.01, dropouts_per_s=0.3)
    plant = plant_of(configuration, joint_coulomb_nm=0.01)
    lockstep = Lockstep(
        configuration, TRACK, plant=plant, drives=drives, motion_capture=cameras, period_s=1.0 / rate_hz
    )
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03, strides=1))
    faults: set[str] = set()
    while lockstep.now_s < 4.5 and (lockstep.loop.mode is not Mode.HOLD or not lockstep.loop.learning.strides):
        lockstep.step()
        faults.update(fault.name for fault in lockstep.loop.faults.present)
    assert (lockstep.loop.mode, lockstep.loop.drives.refused_commands, faults) == (Mode.HOLD, 0, set())
    assert lockstep.robot.plant.body_m > 0.05


def test_the_drives_send_their_heartbeats_at_the_configured_period(example_text: str) -> None:
    """At twice the rate or more they would look like two drives with one id."""
    node = "node_id = "
    text = calibrated(example_text.replace(node, f"heartbeat_period_s = 0.5\n{node}"))
    lockstep = Lockstep(parse_configuration(text), TRACK)
    lockstep.run_for(3.0)
    lockstep.arm()
