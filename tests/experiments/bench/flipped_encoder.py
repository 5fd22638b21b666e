"""A pytest plugin that reverses one encoder of the simulated bench's robot, and prints the joint's highest speed."""

from __future__ import annotations

from typing import Any

import pytest

from experiments.bench.rig import SimulatedRig

JOINT_INDEX = 2  # in JOINTS
_build = SimulatedRig.__init__
_fastest_rad_s = [0.0]


def _flip(rig: SimulatedRig, *arguments: Any, **named: Any) -> None:
    _build(rig, *arguments, **named)
    drive = rig.robot.drives[JOINT_INDEX]
    measure = drive.measure

    def measure_backwards(angle_rad: float, velocity_rad_s: float) -> None:
        _fastest_rad_s[0] = max(_fastest_rad_s[0], abs(velocity_rad_s))
        measure(-angle_rad, -velocity_rad_s)

    drive.measure = measure_backwards  # type: ignore[method-assign]


def pytest_configure() -> None:
    SimulatedRig.__init__ = _flip  # type: ignore[method-assign, assignment]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    terminalreporter.write_line(f"fastest: {_fastest_rad_s[0]:.2f} rad/s")
