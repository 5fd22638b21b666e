"""The log's rows from the loop's records: values in the order of the tables in log_rows."""

from __future__ import annotations

from typing import NamedTuple

from control.limits import LimitedTorques
from control.modes import Mode
from control.records import BodyPose, DriveStates, GaitTarget, StrideEstimate
from estimation.mud import MudReading
from firmware_host.log.rows import STRIDE, TICK
from firmware_host.ticker import Tick


class Moment(NamedTuple):
    """All that one tick knew and did."""

    tick: Tick
    tick_s: float
    missed_ticks: int
    mode: Mode
    target: GaitTarget  # that was commanded while the states came about
    stride_depth_m: float
    states: DriveStates
    reading: MudReading
    body: BodyPose
    sent: LimitedTorques


def tick_row(moment: Moment) -> bytes:
    tick, target, sent = moment.tick, moment.target, moment.sent
    a, b, c, d = moment.states
    left, right = moment.reading.left, moment.reading.right
    now_s = tick.now_s
    return TICK.encode(
        now_s, tick.late_s, moment.tick_s,
        a.angle_rad, b.angle_rad, c.angle_rad, d.angle_rad,
        a.velocity_rad_s, b.velocity_rad_s, c.velocity_rad_s, d.velocity_rad_s,
        a.current_a, b.current_a, c.current_a, d.current_a,
        now_s - a.angle_stamp_s, now_s - b.angle_stamp_s, now_s - c.angle_stamp_s, now_s - d.angle_stamp_s,
        now_s - a.current_stamp_s, now_s - b.current_stamp_s, now_s - c.current_stamp_s, now_s - d.current_stamp_s,
        *sent.torques_nm,
        left.sweep_torque_nm, right.sweep_torque_nm, left.adduction_torque_nm, right.adduction_torque_nm,
        left.force_x_n, right.force_x_n, left.force_z_n, right.force_z_n, left.depth_m, right.depth_m,
        target.depth_m, moment.stride_depth_m, moment.body.x_m,
        a.temperature_c, b.temperature_c, c.temperature_c, d.temperature_c,
        tick.number, moment.missed_ticks, target.stride, moment.mode, target.phase, sent.limited,
    )  # fmt: skip


def stride_row(now_s: float, stride: StrideEstimate, chosen_depth_m: float) -> bytes:
    k_p, k_s, k_e = stride.k_p, stride.k_s, stride.k_e
    return STRIDE.encode(
        now_s, stride.t_start_s, stride.insertion_s, stride.stance_s, stride.extraction_s,
        k_p.value, k_p.std_error, k_s.value, k_s.std_error, k_e.value, k_e.std_error,
        stride.surface_m, stride.surface_std_error_m, stride.depth_m,
        stride.insertion_force_n, stride.stance_force_n, stride.extraction_force_n,
        stride.step_m, stride.position_m, stride.tare_n, stride.tare_drift_n, stride.extraction_torque_nm,
        chosen_depth_m,
        stride.index, k_p.samples, k_s.samples, k_e.samples,
        0 if stride.flipper == "left" else 1,
        k_p.valid, k_s.valid, k_e.valid, k_p.at_least, k_s.at_least, k_e.at_least, stride.released,
    )  # fmt: skip
