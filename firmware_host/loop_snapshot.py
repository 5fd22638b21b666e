"""The state of the loop between two ticks, as one immutable record.

`Loop.snapshot` builds it on demand; the status socket, the checks before arming, experiments and tests read it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from control.faults import Fault
from control.limits import LimitedTorques
from control.modes import Mode
from control.mud_estimate import MudEstimate
from control.records import BodyPose, DriveStates, Joints, Phase
from drivers.can.can_port import BusState, CanPort
from drivers.drive import DriveHealth
from drivers.pose.pose_port import PoseReport
from firmware_host.log.recorder import LogReport
from firmware_host.mud_learning import ClosedStride


class PresentFault(NamedTuple):
    fault: Fault
    age_s: float  # since it was detected first


class BusReport(NamedTuple):
    """The state of one CAN bus, and its counts since the start."""

    name: str
    state: BusState
    last_error: str
    error_frames: int
    failed_sends: int
    lost_frames: int


class FrameCounts(NamedTuple):
    """What the drives' messages and commands came to, since the start."""

    unknown_frames: int  # of ids that belong to none of the drives
    malformed_frames: int  # of a drive, with a payload that cannot be decoded
    refused_commands: int  # by the transmit gate


class LoopSnapshot(NamedTuple):
    mode: Mode
    forced: bool  # armed by force against a present fault
    moving: bool  # joints are on their way to a pose that was requested
    may_be_in_mud: bool  # the held pose interrupted a walk
    fault: Fault | None  # the worst present fault that is more than a warning
    faults: tuple[PresentFault, ...]
    blocking: tuple[Fault, ...]  # the faults that block arming, unless it is forced
    notice: str  # why the robot stopped, until it is moved again
    unlogged_requests: int
    lease_holder: str | None
    phase: Phase  # that was commanded while `states` were measured
    stride: int
    depth_m: float  # commanded in this stride
    states: DriveStates
    drives: Joints[DriveHealth]
    buses: tuple[BusReport, ...]
    frames: FrameCounts
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


def bus_reports(ports: Mapping[str, CanPort]) -> tuple[BusReport, ...]:
    return tuple(
        BusReport(
            name=name,
            state=port.state,
            last_error=port.last_error,
            error_frames=port.error_frames,
            failed_sends=port.failed_sends,
            lost_frames=port.lost_frames,
        )
        for name, port in ports.items()
    )
