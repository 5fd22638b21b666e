"""Why an experiment ends before its end. Each text says what was in the way, and what to do."""

from __future__ import annotations


class BenchError(Exception):
    """The experiment cannot go on."""


class DaemonLostError(BenchError):
    """The daemon does not answer: nothing more can be asked of the robot."""


class AccessDeniedError(BenchError):
    """The daemon does not do this for whoever calls."""


class RobotInUseError(BenchError):
    """Somebody else operates the robot."""


class EndedError(Exception):
    """A person ends the experiment; the text says how it goes on."""
