"""Requires a reason for bounds of protection that are far weaker than their defaults.

The defaults follow from what a joint can do within the time. A bound beyond twice its default may be right for a bench,
but must not be set in passing: the file has to say why, and every program shows it while it is in force.
"""

from collections.abc import Iterator
from dataclasses import replace
from operator import attrgetter

from control.parameters.fault_bounds import FaultBounds
from control.parameters.joint_limits import JointLimits
from control.parameters.motion_parameters import MotionParameters
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError

MOST_TIMES = 2.0  # the default
DEFAULTS = {"faults": FaultBounds(), "limits": JointLimits(), "motion": MotionParameters()}
BOUNDS = (  # of protection; larger ones, or angles farther from zero, protect less
    *(f"faults.{name}" for name in ("late_s", "quiet_s", "silence_s", "jump_rad", "fast_s", "lag_s", "crawl_s")),
    *(f"faults.{name}" for name in ("lag_fraction", "longest_watchdog_s")),
    *(f"limits.{name}_deg" for name in ("sweep_min", "sweep_max", "adduction_min", "adduction_max", "position_margin")),
    "motion.longest_hold_s",
)
NEVER = ("motion.longest_hold_s",)  # where 0 switches the protection off
LONGEST_REASON = 200


def require_reason(configuration: Configuration) -> Configuration:
    """Return the configuration with a warning about its weakened bounds. Raises ConfigurationError."""
    reason, weak = configuration.safety.weakened, dict(_weakened_bounds(configuration))
    if not reason.strip():
        remedy = "or [safety] weakened must give the reason"
        problems = [f"{given}: must be {bound}, twice its default, {remedy}" for given, bound in weak.items()]
    else:
        problems = _reason_problems(reason, bool(weak))
    if problems:
        raise ConfigurationError(problems)
    shown = [f"protection is weakened ({reason}): {', '.join(weak)}"] * bool(weak)
    return replace(configuration, warnings=(*configuration.warnings, *shown))


def _weakened_bounds(configuration: Configuration) -> Iterator[tuple[str, str]]:
    """Yield each bound beyond twice its default: the key with its value, and what it must be."""
    for key in BOUNDS:
        value = attrgetter(key)(configuration)
        section, _, name = key.partition(".")
        most = MOST_TIMES * getattr(DEFAULTS[section], name)
        if abs(value) > abs(most):
            yield f"{key} = {value}", f"at {'most' if most > 0.0 else 'least'} {most:.4g}"
        elif key in NEVER and value == 0.0:
            yield f"{key} = {value}", f"more than 0 and at most {most:.4g}"


def _reason_problems(reason: str, is_needed: bool) -> list[str]:
    given = f"safety.weakened = {reason[:LONGEST_REASON]!r}"
    if len(reason) > LONGEST_REASON or not reason.isprintable():
        return [f"{given}: must be a reason of at most {LONGEST_REASON} printable characters"]
    if not is_needed:
        return [f"{given}: must be left out where no bound is beyond twice its default"]
    return []
