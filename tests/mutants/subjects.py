"""The modules that are tested by mutation, the tests of each, and the mutants that change nothing."""

from typing import NamedTuple

EVERY_MUTANT = "not every_branch and not kernel and not on_a_port"  # the others need a subprocess or a kernel
ODRIVE = "not every_axis or odrive"  # of the tests of every axis those with these drives


class Subject(NamedTuple):
    module: str
    tests: tuple[str, ...]  # in the order in which they run, below tests/
    selected: str = ""  # pytest's expression of the tests that run
    functions: tuple[str, ...] = ()  # of the module; none: all of it
    has_fixtures: bool = False  # of conftest.py, which cost a second each time
    equivalent: dict[str, str] = {}  # the text of a mutant that behaves the same, and why


A_TEXT = "a text of the diagram"
CONTINUOUS = "it has the same value there from both sides"
ONE_EACH = "each of them has one value for each joint"
NO_STRIDE = "no stride has either number, nor the one before a stride"
NO_NUMBER = "neither of them is finite either"
NEAR_LARGEST = "the largest binary32 is a little beyond it"
MORE_OFTEN = "the same counters are only read more often"
ROUNDED = "a sum of such times never is exactly the bound"
SAME = "the same value replaces itself"
REPORTED = "the report tests the exact bound again"
CONVERGED = "the bisection ends at the same stiffness"
SPEED = "the rest then computes the same from nothing"
SUBJECTS = (
    Subject(
        "drivers.transmit_gate",
        ("drivers/test_transmit_gate.py", "drivers/test_gate_tables.py"),
        EVERY_MUTANT,
        equivalent={
            "Lt to LtE in `torque_nm < 0.0`": "zero has passed before",
            "Gt to GtE in `torque_nm > 0.0`": "zero has passed before",
        },
    ),
    Subject(
        "drivers.odrive.gate_table",
        ("drivers/test_transmit_gate.py", "drivers/test_gate_tables.py"),
        EVERY_MUTANT,
    ),
    Subject("drivers.moteus.gate_table", ("drivers/test_gate_tables.py",)),
    Subject("drivers.moteus.codec", ("drivers/test_gate_tables.py",), functions=("decode_torque",)),
    Subject("drivers.mit.gate_table", ("drivers/test_gate_tables.py",)),
    Subject("drivers.mit.codec", ("drivers/test_gate_tables.py",), functions=("decode_torque", "_decode")),
    Subject(
        "drivers.can.reopening_port",
        ("drivers/can/test_reopening_port.py",),
        equivalent={
            "always in `if self._failed_before + port.failed_sends != self.failed_sends:`": MORE_OFTEN,
            "to Sub in `self._failed_before + port.failed_sends`": MORE_OFTEN,
        },
    ),
    Subject(
        "control.limits",
        ("control/test_limits.py",),
        equivalent={
            "True to False in `strict=True`": ONE_EACH,
            "to Sub in `wanted + state.angle_rad`": NO_NUMBER,
            "to Sub in `wanted + state.angle_rad + state.velocity_rad_s`": NO_NUMBER,
            "GtE to Gt in `velocity_rad_s >= limit_rad_s`": CONTINUOUS,
            "Gt to GtE in `velocity_rad_s > fade_rad_s`": CONTINUOUS,
            "Lt to LtE in `velocity_rad_s < -fade_rad_s`": CONTINUOUS,
            "Lt to LtE in `value < low`": CONTINUOUS,
            "Gt to GtE in `value > high`": CONTINUOUS,
        },
    ),
    Subject(
        "control.modes",
        ("control/test_modes.py",),
        equivalent={
            "'raised' to 'XXraised' in `_is('raised', lambda health: health.raised)`": A_TEXT,
            "'walk' to 'XXwalk' in `Cause('walk', lambda request, health:"
            " request is Request.WALK and health.reaction < Reacti`": A_TEXT,
            "'_' to 'XX_' in `reaction.name.lower().replace('_', ' ')`": A_TEXT,
            "5 to 6 in `CLEAR = 5`": "a request's number is never read, and no log contains it",
        },
    ),
    Subject(
        "control.fault_latch",
        ("control/test_fault_latch.py",),
        equivalent={
            "without `if not present and (not self._present):` in"
            " `def update(self, present: Sequence[Fault], energised: bool, clearing: bool=False, ticks: i`": SPEED,
            "never in `if not present and (not self._present):`": SPEED,
            "without `return` in `if not present and (not self._present):`": SPEED,
            "without `if not self._present:` in `def blocking(self, forced: str='') -> list[Fault]:`": SPEED,
            "never in `if not self._present:`": SPEED,
            "without `return []` in `if not self._present:`": SPEED,
            "'' to 'XX' in `self, forced: str=''`": "no fault has that name either",
            "0 to 1 in `self._tick = 0`": "only differences of ticks count",
        },
    ),
    Subject(
        "control.monitors.joint_monitor",
        (
            "control/monitors/test_joint_monitor.py",
            "control/monitors/test_joint_silence.py",
        ),
        equivalent={
            "always in `if state.bus_voltage_v < self._bounds.voltage_low_v or self._low_s:`": MORE_OFTEN,
            "Lt to LtE in `state.bus_voltage_v < self._bounds.voltage_low_v`": MORE_OFTEN,
            "LtE to Lt in `facts.dt_s <= MOST_SEEN_S`": SAME,
        },
    ),
    Subject(
        "control.monitors.encoder_monitor",
        ("control/monitors/test_encoder_monitor.py", "control/monitors/test_speed_monitor.py"),
        equivalent={
            "0.0 to 1.0 in `self, state: DriveState, dt_s: float, torque_nm: float=0.0`": "a torque that never changes",
            "without `self._reset_frozen()` in `def reset(self) -> None:`": "the first message does the same",
            "without `self._begin_interval()` in `def reset(self) -> None:`": "the first message does the same",
            "Gt to GtE in `stamp_s > before_s`": "the same stamp has returned before",
            "Gt to GtE in `gap_s > 0.0`": "no stamp goes back",
            **{
                f"{change} in `{step}`": REPORTED
                for change, step in (
                    ("always", "if not -self._jump_rad <= step_rad - path_rad <= self._jump_rad:"),
                    ("LtE to Lt", "-self._jump_rad <= step_rad - path_rad <= self._jump_rad"),
                    ("sign or not taken away", "-self._jump_rad"),
                )
            },
            "always in `if self._repeated:`": SPEED,
            "False to True in `self._repeated = False`": SPEED,
            "Gt to GtE in `self._interval_s > 0.0`": ROUNDED,
            "GtE to Gt in `self._interval_s >= INTERVAL_S`": ROUNDED,
            "Gt to GtE in `self._ignored_s > YIELDS_S`": ROUNDED,
            "Lt to LtE in `torque_nm < self._lowest_nm`": SAME,
            "Gt to GtE in `torque_nm > self._highest_nm`": SAME,
        },
    ),
    Subject(
        "control.monitors.motion_monitor",
        ("control/monitors/test_motion_monitor.py",),
        equivalent={
            "Gt to GtE in `abs(self._error_rad) > self._following_rad`": REPORTED,
            "LtE to Lt in `self.unexplained_j <= self._runaway_j`": REPORTED,
            "Gt to GtE in `self.away_rad > AWAY_RAD`": REPORTED,
            "always in `if not following or not explained or self.away_rad > AWAY_RAD:`": REPORTED,
            "Gt to GtE in `unexplained_j > 0.0`": CONTINUOUS,
            "Gt to GtE in `away_rad > 0.0`": CONTINUOUS,
            "without `self._target_rad = self._error_rad = UNKNOWN` in `def reset(self) -> None:`": "a sample sets it",
            "Gt to GtE in `torque_nm > 0.0`": "no torque presses that is zero",
            "Gt to GtE in `target_back_rad > 0.0`": "it subtracts nothing",
            "GtE to Gt in `self._pressed_s >= (DRIVEN_BACK_S if self.driven_back < PROBED else PROBE_S)`": ROUNDED,
            "Gt to GtE in `self._back_rad > DRIVEN_BACK_RAD_S * self._pressed_s`": ROUNDED,
            "LtE to Lt in `abs(self._back_rad - as_before_rad) <= most_rad`": ROUNDED,
            "Lt to LtE in `self._rock_s < PROBE_S`": ROUNDED,
            "Lt to LtE in `self._rock_s < DRIVEN_BACK_S`": ROUNDED,
            "Lt to LtE in `abs(step_rad) < SLOW_RAD_S * elapsed_s`": CONTINUOUS,
            "Lt to LtE in `-PRESSING_NM < torque_nm < PRESSING_NM`": CONTINUOUS,
            "Lt to LtE in `self._back_rad < -STEADY_RAD`": CONTINUOUS,
            "Lt to LtE in `error_rad * self._error_rad < 0.0`": CONTINUOUS,
            "Gt to GtE in `lag_rad > self._excursion_rad`": SAME,
            "GtE to Gt in `self._excursion_rad >= STABLE_FRACTION * self._excursion_before_rad`": CONTINUOUS,
            "Lt to LtE in `self.driven_back < PROBED`": "a joint that turns back in its probe ends the count there too",
        },
    ),
    Subject("firmware_host.lease", ("firmware_host/test_lease.py",)),
    Subject(
        "firmware_host.daemon",
        ("firmware_host/test_daemon.py",),
        "not foreground",
        functions=("update", "request", "step", "end_safely"),
        has_fixtures=True,
    ),
    Subject(
        "firmware_host.loop",
        ("firmware_host/test_loop.py",),
        "lease or slew or no_torque or finite or forced",
        functions=("_end_lost_lease", "_limit", "_pop_request"),
        has_fixtures=True,
    ),
    Subject(
        "drivers.mit.axis",
        ("drivers/mit/test_axis.py", "drivers/test_every_axis.py"),
        equivalent={
            "Lt to LtE in `NEVER_S < asked_s < now_s`": SAME,
            "always in `if self.closed_loop:`": "what an idle drive measures is forgotten with its answer",
            "always in `if flags != self._error_flags:`": SPEED,
            "without `return` in `if register == SUPPLY_V:`": "the settings only store it, and no check reads it",
        },
    ),
    Subject(
        "drivers.moteus.axis",
        ("drivers/moteus/test_axis.py", "drivers/test_every_axis.py"),
        equivalent={
            "Lt to LtE in `self._read_s - self._disturbed_s < STOPPING_S`": ROUNDED,
            "Lt to LtE in `-LARGEST_FLOAT < torque_nm < LARGEST_FLOAT`": NEAR_LARGEST,
        },
    ),
    Subject(
        "drivers.odrive.axis",
        ("drivers/odrive/test_drives.py", "drivers/odrive/test_axis.py", "drivers/test_every_axis.py"),
        ODRIVE,
        equivalent={
            "always in `if (flags, disarm_reason) != (self._error_flags, self.disarm_reason):`": SPEED,
        },
    ),
    Subject(
        "drivers.odrive05.axis",
        ("drivers/odrive05/test_axis.py", "drivers/test_every_axis.py"),
        ODRIVE,
        equivalent={
            "always in `if flags != self._part_errors[part]:`": SPEED,
            "always in `if not self._counts_known:`": SPEED,
            "always in `if problem != self._counts_problem:`": SPEED,
            "Gt to GtE in `now_s - self._angle_stamp_s > RESTART_SILENCE_S`": ROUNDED,
            "Lt to LtE in `0.0 < elapsed_s < LONGEST_GAP_S`": ROUNDED,
            "b'' to b'\\x01' in `self._measured_data = b''`": "a current has four bytes",
            "without `self._version_answered = False` in `def reset(self) -> None:`": "a version sets it",
            "False to True in `self._version_answered = False`": "a version sets it",
        },
    ),
    Subject(
        "drivers.drives",
        ("drivers/odrive/test_drives.py", "drivers/moteus/test_axis.py", "drivers/test_every_axis.py"),
        equivalent={
            "Lt to LtE in `now_s - self._disarmed_s < REPEAT_S`": ROUNDED,
            "LtE to Lt in `0.0 <= now_s - stamp_s < LONGEST_IN_QUEUE_S`": SAME,
            "never in `if not self._other_protocols:`": SPEED,
            "without `if not self._other_protocols:` in `@property`": SPEED,
            "without `return health` in `if not self._other_protocols:`": SPEED,
            "True to False in `strict=True`": ONE_EACH,
            "Lt to LtE in `now_s - self._armed_s < REPEAT_S`": ROUNDED,
        },
    ),
    Subject(
        "control.joint_pd",
        ("control/test_velocity_prediction.py", "control/test_joint_pd.py"),
        equivalent={
            "True to False in `strict=True`": ONE_EACH,
            "GtE to Gt in `phase_margin_rad(middle, damping_nm_s_rad, inertia_kg_m2) >= LEAST_MARGIN_RAD`": CONVERGED,
            "60 to 61 in `range(60)`": CONVERGED,
            "2 to 3 in `LOOP_DELAY_S ** 2`": CONVERGED,
        },
    ),
    Subject("control.controller", ("control/test_controller.py",)),
    Subject(
        "firmware_host.fault_monitor",
        ("firmware_host/test_fault_monitor.py",),
        has_fixtures=True,
        equivalent={
            "True to False in `strict=True`": ONE_EACH,
            "Gt to GtE in `state.temperature_c > warm_c`": CONTINUOUS,
            "LtE to Lt in `joint.winding.temperature_c <= warm_c`": CONTINUOUS,
            "Gt to GtE in `tick.now_s - monitor_input.mode_since_s > ARMING_S`": ROUNDED,
            "Lt to LtE in `CUT_S < max(silent_s) < min(silent_s) + CUT_S`": ROUNDED,
            "Gt to GtE in `tick.missed * self._period_s > STALL_S`": ROUNDED,
            "Lt to LtE in `tick.now_s - self._held_back_s[joint] < CATCH_UP_S`": ROUNDED,
            "Gt to GtE in `now_s - self._pose_stamp_s > POSE_FORGOTTEN_S`": ROUNDED,
            "without `if not (found or self._broken):` in"
            " `def _check_trust(self, found: list[Fault], mode: Mode) -> None:`": SPEED,
            "never in `if not (found or self._broken):`": SPEED,
            "without `return` in `if not (found or self._broken):`": SPEED,
            "always in `Joints(*(joint not in blind for joint in self._rig.joints))"
            " if blind else self._all_truste`": SPEED,
            "always in `if health is not self._sound[health.joint]:`": SPEED,
            "without `self._sound[health.joint] = health if len(found) == before else None` in"
            " `if health is not self._sound[health.joint]:`": SPEED,
            "never in `health if len(found) == before else None`": SPEED,
            "1 to 2 in `-1`": NO_STRIDE,
            "9 to 10 in `-9`": NO_STRIDE,
        },
    ),
    Subject(
        "drivers.odrive.cansimple_axis",
        ("drivers/odrive/test_drives.py", "drivers/odrive/test_axis.py", "drivers/test_every_axis.py"),
        ODRIVE,
        equivalent={
            **{
                f"Gt to GtE in `now_s - self._{stamp}_stamp_s > RESTART_SILENCE_S`": ROUNDED
                for stamp in ("angle", "current", "heartbeat")
            },
            "Gt to GtE in `self._read_before_s - heard_s > RESTART_SILENCE_S`": ROUNDED,
            "Lt to LtE in `-LARGEST_FLOAT < torque_nm < LARGEST_FLOAT`": NEAR_LARGEST,
            "to Sub in `turns + turns_s`": NO_NUMBER,
            "always in `if busy_state != self.busy_state:`": SPEED,
            "to Div in `self._sign * parameters.current_sign`": "both are 1 or -1",
            "3.4e+38 to 3.4e+38 in `LARGEST_FLOAT = 3.4e+38`": NEAR_LARGEST,
            "without `self.reset()` in `def __init__(self, joint: str, parameters: OdriveParameters, outlet: Outlet,"
            " settings: Dri`": "the drives reset all of them at the start",
        },
    ),
)
