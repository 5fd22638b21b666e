"""Reasons for which an experiment ends early. Each text says what happened and what to do."""


class BenchError(Exception):
    """The experiment cannot continue."""


class DaemonLostError(BenchError):
    """The daemon does not answer."""


class AccessDeniedError(BenchError):
    """The daemon refuses this user."""


class RobotInUseError(BenchError):
    """Another program operates the robot."""


class EndedError(Exception):
    """The operator ends the experiment, or is absent; the text says how it continues."""
