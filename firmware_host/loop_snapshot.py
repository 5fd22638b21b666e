"""The state of the loop between two ticks, as one immutable record.

`take_snapshot` builds it on demand; the status socket, the checks before arming, experiments and tests read it.
"""

from collections.abc import Mapping
from typing import NamedTuple

from control.fault_causes import AgedFault
from control.faults import Fault
from control.gait.gait import full_step_m
from control.limits import LimitedTorques
from control.modes import Mode
from control.mud_estimate import MudEstimate
from control.records import BodyPose, DriveStates, FlipperLoad, Joints, Phase
from drivers.can.port_health import BusState
from drivers.drive import DriveHealth
from drivers.pose.pose_port import PoseReport
from firmware_host.log.recorder import LogReport
from firmware_host.loop import Loop
from firmware_host.mud_learning import ClosedStride


class BusReport(NamedTuple):
    """The state of one CAN bus, and its counts since the start, under the names that the port gives them."""

    name: str
    state: BusState
    last_error: str
    error_frames: int
    failed_sends: int
    lost_frames: int


class FrameCounts(NamedTuple):
    """Counts of rejected frames and commands of all drives, since the start."""

    unknown_frames: int  # with an id that no drive has
    malformed_frames: int  # from a drive, with a payload that cannot be decoded
    refused_commands: int  # by the transmit gate


class LoopSnapshot(NamedTuple):
    mode: Mode
    forced: bool  # armed by force against a present fault
    moving: bool  # joints are on their way to a pose that was requested
    fault: Fault | None  # the worst present fault that is more than a warning
    faults: tuple[AgedFault, ...]
    blocking: tuple[Fault, ...]  # the faults that block arming, unless it is forced
    notice: str  # why the robot stopped, until it is moved again
    unlogged_requests: int
    lease_holder: str | None
    lease_until_s: float  # infinite without a holder
    phase: Phase  # commanded while `states` were measured
    stride: int
    depth_m: float  # commanded in this stride
    next_depth_m: float
    depth_reason: str  # why the next depth was chosen
    full_step_m: float  # the body's step in one stride if nothing slips
    states: DriveStates
    drives: Joints[DriveHealth]
    buses: tuple[BusReport, ...]
    frames: FrameCounts
    loads: Mapping[str, FlipperLoad]  # by flipper
    body: BodyPose
    pose: PoseReport
    sent: LimitedTorques
    winding_temperatures_c: Joints[float]  # measured or estimated
    strides: tuple[ClosedStride, ...]  # the latest ones
    strides_closed: int  # since the start
    mud: MudEstimate
    rate_hz: float
    missed_ticks: int  # since the start
    log: LogReport


def take_snapshot(loop: Loop) -> LoopSnapshot:
    """The state of the loop since its last tick."""
    faults, learning, drives = loop.faults, loop.learning, loop.drives
    return LoopSnapshot(
        mode=loop.mode,
        forced=loop.forced,
        moving=loop.controller.moving,
        fault=loop.fault,
        faults=tuple(AgedFault(fault, faults.age_ticks(fault) * loop.period_s) for fault in faults.present),
        blocking=tuple(faults.blocking()),
        notice=loop.events.notice,
        unlogged_requests=loop.events.requests.unlogged,
        lease_holder=str(loop.lease.holder) if loop.lease.held else None,
        lease_until_s=loop.lease.until_s,
        phase=loop.target.phase,
        stride=loop.target.stride,
        depth_m=loop.stride_depth_m,
        next_depth_m=loop.controller.gait.next_depth_m,
        depth_reason=learning.depth_reason,
        full_step_m=full_step_m(loop.controller.gait.next_parameters, loop.configuration.geometry),
        states=loop.states,
        drives=drives.health,
        buses=tuple(
            BusReport(name, *(getattr(port, count) for count in BusReport._fields[1:]))
            for name, port in drives.ports.items()
        ),
        frames=FrameCounts(drives.unknown_frames, drives.malformed_frames, drives.refused_commands),
        loads=dict(zip(loop.configuration.rig.flippers, learning.loads, strict=True)),
        body=loop.body,
        pose=loop.pose.report(),
        sent=loop.sent,
        winding_temperatures_c=loop.fault_monitor.winding_temperatures_c,
        strides=tuple(learning.strides),
        strides_closed=learning.strides_closed,
        mud=learning.estimator.mud_estimate,
        rate_hz=loop.timing.rate_hz,
        missed_ticks=loop.missed_ticks,
        log=loop.recorder.report(),
    )
