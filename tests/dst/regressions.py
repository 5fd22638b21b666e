"""Schedules that once broke a promise, shrunk to the essential events, each with a text about the cause.

They are stored as they were printed and not as seeds alone, because a seed draws another schedule when drawing changes.
"""

from typing import NamedTuple

from tests.dst.scenario import Call, Drift, Failure, Scenario, Surroundings, Suspend, Terminate


class Regression(NamedTuple):
    text: str
    scenario: Scenario


QUICK = Surroundings(configuration=(("motion.path_speed_rad_s", 3.0), ("motion.fade_in_s", 0.1)))
REST = (
    ("motion.fade_in_s", 0.1),
    ("gait.swing_duration_s", 0.4),
    ("gait.insertion_speed_m_s", 0.2),
    ("recovery.attempts", 1),
    ("recovery.attempt_s", 0.3),
)

REGRESSIONS = (
    Regression(
        "an ODrive 0.5 that another program's stop met before it was heard kept the robot in boot without a fault",
        Scenario(
            seed=188,
            surroundings=Surroundings(drive_type="odrive05"),
            start="power-on",
            events=(Failure(at_s=0.056, component="left_adduction.master", kind="stop", for_s=0.015),),
            for_s=0.3,
        ),
    ),
    Regression(
        "a motor with inverted torque presses its joint against the stop while the flippers are raised",
        Scenario(
            seed=115,
            surroundings=Surroundings(strength_pa=1963, depth_m=0.03),
            start="stance",
            events=(
                Failure(at_s=0.188, component="right_adduction.motor", kind="inverted", for_s=0.826),
                Call(at_s=0.189, client="pilot", method="stop"),
            ),
            for_s=1.064,
        ),
    ),
    Regression(
        "a motor with inverted torque is accelerated by its own damping",
        Scenario(
            seed=14,
            surroundings=Surroundings(strength_pa=3760, depth_m=0.026),
            start="idle",
            events=(
                Call(at_s=0.0, client="pilot", method="arm", params={"force": "watchdog_unknown"}),
                Failure(at_s=0.241, component="right_sweep.motor", kind="inverted", for_s=0.876),
                Call(at_s=0.378, client="pilot", method="walk"),
            ),
            for_s=1.367,
        ),
    ),
    Regression(
        "an encoder that freezes at zero speed lets its joint press against the stop",
        Scenario(
            seed=0,
            surroundings=QUICK,
            start="stance",
            events=(Failure(at_s=0.0, component="left_sweep.encoder", kind="frozen", for_s=1.5),),
            for_s=1.5,
        ),
    ),
    Regression(
        "a joint that comes to rest exactly as its torque goes off counts as a stuck encoder until it is moved",
        Scenario(
            seed=616,
            surroundings=Surroundings(disturbed=True, configuration=(("motion.path_speed_rad_s", 1.9), *REST)),
            start="idle",
            events=(
                Call(at_s=0.0, client="pilot", method="arm"),
                Failure(at_s=0.196, component="loop", kind="slow", for_s=0.052),
                Failure(at_s=0.198, component="right_adduction.command", kind="off", for_s=0.096),
            ),
            for_s=0.344,
        ),
    ),
    Regression(
        "a flipper that a disarm lets coast out of the mud counted as a false alarm",
        Scenario(
            seed=1323,
            surroundings=Surroundings(strength_pa=3437, free_body=True),
            start="release",
            events=(Call(at_s=0.009, client="guest", method="disarm"),),
            for_s=0.059,
        ),
    ),
    Regression(
        "a drive that a bus-off kept from going idle stayed in closed loop because it reported to have left it",
        Scenario(
            seed=4487,
            surroundings=Surroundings(),
            start="hold",
            events=(
                Failure(at_s=0.126, component="bus.left", kind="bus-off", for_s=0.032),
                Failure(at_s=0.127, component="left_adduction.error", kind="off", for_s=0.583),
            ),
            for_s=0.76,
        ),
    ),
    Regression(
        "a motor whose current loses its lag catches up with its command faster than the slew rate",
        Scenario(
            seed=4359,
            surroundings=Surroundings(
                seed=272,
                depth_m=0.027,
                drives=(("cogging_nm", 0.003), ("message_delay_s", 0.0005), ("overspeed_fraction", 1.2)),
                configuration=(
                    ("motion.path_speed_rad_s", 2.6),
                    ("motion.fade_in_s", 0.1),
                    ("gait.swing_duration_s", 0.4),
                    ("gait.insertion_speed_m_s", 0.2),
                ),
            ),
            start="extraction",
            events=(Failure(at_s=0.217, component="right_sweep.current", kind="lagging", for_s=0.19),),
            for_s=0.457,
        ),
    ),
    Regression(
        "the loss of rows was not reported in a log that ended while it failed",
        Scenario(
            seed=6360,
            surroundings=Surroundings(configuration=(("log.rest_hz", 0.0), ("log.rest_full_s", 0.3))),
            start="idle",
            events=(Failure(at_s=0.123, component="log", kind="off", for_s=0.072), Terminate(at_s=0.173)),
            for_s=0.245,
        ),
    ),
    Regression(
        "joints that a disarm lets coast in a fast swing were put back before they lay against their stops",
        Scenario(
            seed=10855,
            surroundings=Surroundings(
                seed=0,
                strength_pa=676,
                stone_m=0.058,
                configuration=(
                    ("motion.path_speed_rad_s", 2.1),
                    ("motion.fade_in_s", 0.3),
                    ("gait.insertion_speed_m_s", 0.2),
                ),
            ),
            start="hold",
            events=(Call(at_s=0.0, client="pilot", method="walk"),),
            for_s=0.805,
        ),
    ),
    Regression(
        "an encoder that freezes in a held pose, at zero speed and steady torque, was expected to be detected",
        Scenario(
            seed=13745,
            surroundings=Surroundings(
                seed=0,
                stone_m=0.003,
                configuration=(
                    ("motion.path_speed_rad_s", 2.4),
                    ("motion.fade_in_s", 0.1),
                    ("gait.swing_duration_s", 0.6),
                    ("gait.insertion_speed_m_s", 0.1),
                    ("gains.sweep_stiffness_nm_rad", 7.9),
                    ("gains.adduction_stiffness_nm_rad", 9.8),
                ),
            ),
            start="stance",
            events=(
                Call(at_s=0.058, client="pilot", method="stop"),
                Failure(at_s=0.168, component="right_adduction.encoder", kind="frozen", for_s=0.805),
            ),
            for_s=1.023,
        ),
    ),
    Regression(
        "the torque of another program was counted as ours after a stall of the loop",
        Scenario(
            seed=7310034,
            surroundings=Surroundings(seed=0, drive_type="moteus"),
            start="power-on",
            events=(
                Failure(
                    at_s=0.143, component="left_sweep.master", kind="after every tenth command, unheard", for_s=0.039
                ),
                Suspend(at_s=0.143, for_s=0.006, inside="fault_monitor.update"),
            ),
            for_s=0.232,
        ),
    ),
    Regression(
        "the torque of another program was counted as ours where it had armed a drive that reports an error",
        Scenario(
            seed=9660631,
            surroundings=Surroundings(seed=0, drive_type="moteus"),
            start="idle",
            events=(
                Failure(at_s=0.109, component="right_sweep.error", kind="stuck", for_s=0.138),
                Failure(
                    at_s=0.138, component="right_sweep.master", kind="after every second command, unheard", for_s=0.013
                ),
            ),
            for_s=0.297,
        ),
    ),
    Regression(
        "a lagging current that decays after the watchdog was counted as driven",
        Scenario(
            seed=9661141,
            surroundings=Surroundings(seed=603821, drive_type="moteus"),
            start="extraction",
            events=(
                Suspend(at_s=0.17, for_s=0.174, inside="recorder.put"),
                Failure(at_s=0.17, component="right_sweep.current", kind="lagging", for_s=0.147),
            ),
            for_s=0.65,
        ),
    ),
    Regression(
        "after a stall within a tick, in which nothing was sent, the gate refused the first torque as too large a step",
        Scenario(
            seed=7310363,
            surroundings=Surroundings(seed=0),
            start="idle",
            events=(
                Call(at_s=0.0, client="pilot", method="arm", params={"force": ""}),
                Call(at_s=0.207, client="pilot", method="walk"),
                Suspend(at_s=0.259, for_s=0.031, inside="fault_monitor.update"),
            ),
            for_s=0.34,
        ),
    ),
    Regression(
        "the torque of another program was counted as ours after the loop stood still within a tick",
        Scenario(
            seed=7330031,
            surroundings=Surroundings(seed=0, strength_pa=560, depth_m=0.035, drive_type="mit:AK80-6"),
            start="extraction",
            events=(
                Failure(
                    at_s=0.171,
                    component="right_adduction.master",
                    kind="after every second command, on the bus",
                    for_s=0.2,
                ),
                Suspend(at_s=0.173, for_s=0.071, inside="bus.left"),
            ),
            for_s=0.45,
        ),
    ),
    Regression(
        "the work of the last torque before a stall was counted as work of the damping after it",
        Scenario(
            seed=7320208,
            surroundings=Surroundings(
                seed=0,
                depth_m=0.017,
                drive_type="moteus",
                configuration=(
                    ("motion.path_speed_rad_s", 2.4),
                    ("motion.fade_in_s", 0.1),
                    ("gait.swing_duration_s", 0.6),
                    ("gains.sweep_stiffness_nm_rad", 9.9),
                    ("gains.adduction_stiffness_nm_rad", 10.0),
                    ("limits.torque_nm", 0.6),
                    ("adaptation.motor_force_n", 5.0),
                ),
            ),
            start="stance",
            events=(
                Suspend(at_s=0.269, for_s=0.025, inside="fault_monitor.update"),
                Failure(at_s=0.269, component="loop", kind="stuck", for_s=0.013),
            ),
            for_s=0.344,
        ),
    ),
    Regression(
        "what a strong motor does in a stance, where no torque constant shows, was bounded like its work in air",
        Scenario(
            seed=7330569,
            surroundings=Surroundings(
                seed=458160,
                strength_pa=3967,
                depth_m=0.017,
                disturbed=True,
                drives=(("current_lag_s", 0.001), ("message_delay_s", 0.0005)),
                configuration=(
                    ("motion.path_speed_rad_s", 1.6),
                    ("motion.fade_in_s", 0.3),
                    ("gait.swing_duration_s", 0.6),
                    ("gains.sweep_stiffness_nm_rad", 7.4),
                    ("gains.adduction_stiffness_nm_rad", 11.0),
                ),
            ),
            start="hold",
            events=(
                Call(at_s=0.0, client="pilot", method="walk"),
                Drift(at_s=0.316, joint="left_sweep", values={"torque_constant_error": 2.542}, for_s=0.896, over_s=0.1),
            ),
            for_s=1.05,
        ),
    ),
    Regression(
        "an encoder that freezes at zero speed and full torque was expected to be detected before the torque changes",
        Scenario(
            seed=7330708,
            surroundings=Surroundings(
                seed=458169,
                strength_pa=3579,
                depth_m=0.017,
                drive_type="moteus",
                drives=(("cogging_nm", 0.003), ("message_delay_s", 0.0005)),
                configuration=(
                    ("motion.path_speed_rad_s", 2.7),
                    ("motion.fade_in_s", 0.1),
                    ("gait.swing_duration_s", 0.8),
                ),
            ),
            start="stance",
            events=(
                Call(at_s=0.0, client="pilot", method="walk"),
                Failure(at_s=0.105, component="left_sweep.encoder", kind="frozen", for_s=3.776),
            ),
            for_s=0.9,
        ),
    ),
    Regression(
        "the rest of a tick's torques that left after a stop within it was counted as torque of a silent loop",
        Scenario(
            seed=8100077,
            surroundings=Surroundings(
                seed=506254,
                strength_pa=9000.0,
                depth_m=0.05,
                drive_type="mit:AK80-6",
                configuration=(("motion.path_speed_rad_s", 1.7), ("gait.swing_duration_s", 0.4)),
            ),
            start="stance",
            events=(
                Call(at_s=0.0, client="pilot", method="walk"),
                Suspend(at_s=0.065, for_s=3.434, inside="bus.right"),
            ),
            for_s=3.749,
        ),
    ),
    Regression(
        "no torque, rounded to the code of a drive that another program armed again, was counted as torque",
        Scenario(
            seed=8100450,
            surroundings=Surroundings(seed=0, drive_type="mit:DMH3510"),
            start="hold",
            events=(
                Failure(at_s=0.4, component="right_sweep.master", kind="arming", for_s=0.013),
                Failure(at_s=0.458, component="right_sweep.master", kind="arming", for_s=0.013),
                Terminate(at_s=0.458),
            ),
            for_s=0.521,
        ),
    ),
    Regression(
        "a count that did not fit a garbled position was never asked for again, so arming stayed refused",
        Scenario(
            seed=8301048,
            surroundings=Surroundings(seed=0, drive_type="odrive05"),
            start="power-on",
            events=(Failure(at_s=0.234, component="left_adduction", kind="garbage", for_s=0.553),),
            for_s=1.037,
        ),
    ),
    Regression(
        "a joint that shot out of stiff mud past its target and came to rest counted as oscillating",
        Scenario(
            seed=9630082,
            surroundings=Surroundings(
                seed=601880,
                strength_pa=3273,
                stone_m=0.063,
                drives=(("message_delay_s", 0.0005),),
                configuration=(
                    ("motion.path_speed_rad_s", 2.0),
                    ("gait.swing_duration_s", 0.4),
                    ("gait.insertion_speed_m_s", 0.2),
                    ("gains.sweep_stiffness_nm_rad", 6.8),
                    ("gains.adduction_stiffness_nm_rad", 10.8),
                ),
            ),
            start="stance",
            events=(),
            for_s=0.8,
        ),
    ),
    Regression(
        "so did a joint that a stone threw back and forth until it came to rest",
        Scenario(
            seed=9101688,
            surroundings=Surroundings(
                seed=568855,
                strength_pa=3633,
                depth_m=0.021,
                stone_m=0.039,
                drive_type="odrive05",
                drives=(("message_delay_s", 0.0005),),
                configuration=(
                    ("motion.path_speed_rad_s", 1.5),
                    ("motion.fade_in_s", 0.1),
                    ("gait.swing_duration_s", 0.4),
                ),
            ),
            start="extraction",
            events=(Call(at_s=0.0, client="pilot", method="stop"),),
            for_s=0.8,
        ),
    ),
    Regression(
        "the mud throws a sweep to the speed at which its motor's voltage is used up, which looked like a weak motor",
        Scenario(
            seed=9743012,
            surroundings=Surroundings(
                seed=608938,
                strength_pa=2135,
                depth_m=0.031,
                free_body=True,
                drive_type="mit:DM4340P",
                configuration=(
                    ("motion.path_speed_rad_s", 2.0),
                    ("gait.swing_duration_s", 0.4),
                    ("limits.torque_nm", 0.6),
                    ("adaptation.motor_force_n", 5.0),
                ),
            ),
            start="hold",
            events=(Call(at_s=0.0, client="pilot", method="walk"),),
            for_s=1.6,
        ),
    ),
)
