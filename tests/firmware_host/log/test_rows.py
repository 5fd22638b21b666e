"""Every value of a tick and of a stride is in the field that has its name."""

from control.limits import LimitedTorques
from control.modes import Mode
from control.records import (
    STANCES,
    BodyPose,
    DriveState,
    Estimate,
    FlipperLoad,
    GaitTarget,
    Joints,
    Phase,
    Rig,
    StrideEstimate,
)
from firmware_host.log.rows import STRIDE, stride_row, tick_kind, tick_row
from firmware_host.ticker import Tick

RIG = Rig(("right",))


def test_a_tick() -> None:
    states = [
        DriveState(
            angle_rad=number + 0.25,
            velocity_rad_s=number + 0.5,
            angle_stamp_s=10.0 - number,
            current_a=number + 0.75,
            current_stamp_s=20.0 - number,
            temperature_c=number,
            bus_voltage_v=number + 20.0,
            bus_current_a=number + 0.125,
        )
        for number in (1.0, 2.0)
    ]
    row = tick_row(
        tick_kind(RIG),
        Tick(now_s=30.0, late_s=0.5, number=(1 << 32) + 7, missed=1),  # after 130 days
        0.25,
        states=Joints(*states),
        sent=LimitedTorques(torques_nm=Joints(3.0, 4.0), limited=True, finite=True),
        loads=[
            FlipperLoad(sweep_torque_nm=5.0, adduction_torque_nm=6.0, force_x_n=7.0, force_z_n=8.0, depth_m=9.0),
        ],
        target=GaitTarget(
            phase=Phase.STANCE,
            stride=3,
            sweep_rad=11.0,
            sweep_velocity_rad_s=12.0,
            depth_m=13.0,
            depth_velocity_m_s=14.0,
        ),
        stride_depth_m=15.0,
        body=BodyPose(x_m=16.0),
        missed_ticks=17,
        mode=Mode.WALKING,
        power_cut=True,
    )
    assert tick_kind(RIG).decode(row) == {
        "stamp_s": 30.0,
        "wake_late_s": 0.5,
        "tick_s": 0.25,
        "angle_rad": (1.25, 2.25),
        "velocity_rad_s": (1.5, 2.5),
        "current_a": (1.75, 2.75),
        "angle_age_s": (21.0, 22.0),
        "current_age_s": (11.0, 12.0),
        "torque_command_nm": (3.0, 4.0),
        "sweep_load_nm": (5.0,),
        "adduction_load_nm": (6.0,),
        "force_x_n": (7.0,),
        "force_z_n": (8.0,),
        "depth_m": (9.0,),
        "depth_command_m": 13.0,
        "stride_depth_m": 15.0,
        "body_x_m": 16.0,
        "temperature_c": (1.0, 2.0),
        "bus_voltage_v": (21.0, 22.0),
        "bus_current_a": (1.125, 2.125),
        "tick": 7,
        "missed_ticks": 17,
        "stride": 3,
        "mode": Mode.WALKING,
        "phase": Phase.STANCE,
        "limited": True,
        "power_cut": True,
    }


def test_a_stride() -> None:
    estimates = [
        Estimate(
            value=number,
            std_error=number + 0.5,
            samples=int(number),
            valid=number > 1,
            at_least=number > 2,
            repeatability=number + 0.25,
            depth_m=number + 0.125,
            speed_m_s=number + 0.0625,
        )
        for number in (1.0, 2.0, 3.0)
    ]
    stride = StrideEstimate(
        flipper="right",
        index=4,
        t_start_s=5.0,
        t_end_s=5.5,
        insertion_s=6.0,
        stance_s=7.0,
        extraction_s=8.0,
        k_p=estimates[0],
        k_s=estimates[1],
        k_e=estimates[2],
        surface_m=9.0,
        depth_m=10.0,
        released=True,
        insertion_force_n=11.0,
        stance_force_n=12.0,
        extraction_force_n=13.0,
        step_m=14.0,
        surface_std_error_m=15.0,
        other_surface_m=16.0,
        position_m=17.0,
        tare_n=18.0,
        tare_drift_n=19.0,
        extraction_torque_nm=20.0,
        stance="mixed",
        yield_force_n=24.0,
        yield_force_std_error_n=25.0,
    )
    values = STRIDE.decode(stride_row(21.0, stride, 22.0, 23.0))
    assert {name: values.pop(name) for name in ("stamp_s", "chosen_depth_m", "supply_min_v", "flipper")} == {
        "stamp_s": 21.0,
        "chosen_depth_m": 22.0,
        "supply_min_v": 23.0,
        "flipper": 1,
    }
    for name, estimate in zip(("k_p", "k_s", "k_e"), estimates, strict=True):
        own = estimate._asdict()
        assert values.pop(name) == own.pop("value") and own.pop("reason") == ""
        assert {part: values.pop(f"{name}_{part}") for part in own} == own
    assert values.pop("stance") == STANCES.index("mixed")
    assert values == {name: getattr(stride, name) for name in values}
