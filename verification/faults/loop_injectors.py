"""Injectors of failures in the loop and around it: modelled heat, bugs, stalls, lease, log, daemon."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import nan
from typing import Any

from control.computing.bounded_work import finished
from control.modes import Mode, Request
from control.records import Estimate, StrideEstimate
from estimation.mud import Sampled
from verification.faults.bench import FaultBench
from verification.faults.injectors import Injector, once


@once
def lease_hung_up(bench: FaultBench, joint: str) -> None:
    """Close the connection of the lease holder; where torque is off, right after a request to arm."""
    bench.loop.lease.renew("operator", bench.now_s, 10.0)
    if bench.loop.mode is Mode.IDLE:
        bench.loop.request(Request.ARM, bench.now_s, forced=bench.forced)
    bench.loop.lease.hang_up("operator")


def writer_reports(**changes: Any) -> Injector:
    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        before = bench.rows.reported
        bench.rows.reported = before._replace(**changes)
        yield
        bench.rows.reported = before

    return inject


@once
def writer_lost_rows(bench: FaultBench, joint: str) -> None:
    bench.rows.dropped += 3


@once
def port_lost_frames(bench: FaultBench, joint: str) -> None:
    """Lose frames in the port below the one that injects failures."""
    port = bench.loop.drives.ports[bench.loop.configuration.drive[joint].bus]
    vars(port).get("_port", port).lost_frames += 3


def heated(temperature_c: float) -> Injector:
    """Set the modelled temperature, which then falls at the model's own rate."""

    @once
    def inject(bench: FaultBench, joint: str) -> None:
        bench.winding(joint).temperature_c = temperature_c

    return inject


@contextmanager
def gains_of_nan(bench: FaultBench, joint: str) -> Iterator[None]:
    controller = bench.loop.controller
    before = controller.gains
    controller.gains = replace(before, sweep_stiffness_nm_rad=nan, adduction_damping_nm_s_rad=nan)
    yield
    controller.gains = before


@once
def five_newton_metres(bench: FaultBench, joint: str) -> None:
    """Send a torque past every limit of the loop, as a bug would."""
    bench.loop.drives.send_torque(joint, 5.0)


def loop_stalled(ticks: int) -> Injector:
    @once
    def inject(bench: FaultBench, joint: str) -> None:
        bench.stalled_steps = ticks

    return inject


@once
def absurd_stride(bench: FaultBench, joint: str) -> None:
    """Make the next sample close a stride with a coefficient of 10²⁰ N/m³."""
    estimator = bench.loop.learning.estimator
    true_add = estimator.add
    wild = Estimate(1e20, 1.0, 100, True)
    stride = StrideEstimate(
        "left", 0, 0.0, 1.0, 0.4, 0.3, 0.1, wild, wild, wild, 0.0, 0.03, True, 1.0, 1.0, -1.0, 0.1
    )  # fmt: skip

    def add(*arguments: Any) -> Sampled:
        del estimator.__dict__["add"]  # once
        return true_add(*arguments)._replace(closing=finished((stride,)))

    estimator.__dict__["add"] = add


# the daemon


@once
def killed(bench: FaultBench, joint: str) -> None:
    bench.dead = True


@once
def nothing(bench: FaultBench, joint: str) -> None:
    """Inject no failure: the control group."""


class DeliberateBugError(Exception):
    pass


def bug_in(path: str) -> Injector:
    """Make the next call of a method of the loop raise. `path` is the dotted name of the method."""

    @once
    def inject(bench: FaultBench, joint: str) -> None:
        *owners, method = path.split(".")
        part: Any = bench.loop
        for owner in owners:
            part = getattr(part, owner)

        def broken(*arguments: Any, **options: Any) -> Any:
            raise DeliberateBugError(path)

        setattr(part, method, broken)

    return inject
