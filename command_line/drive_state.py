"""What may be believed of a drive in the daemon's status: values of a drive that fell silent are not those of now."""

from typing import Any

STALE_S = 0.1  # a drive sends position and current every 2 ms
HEARTBEAT_STALE_S = 0.6  # and a heartbeat every 100 ms; after 0.5 s without it is a fault


def is_stale(drive: dict[str, Any]) -> bool:
    age_s = drive["angle_age_s"]
    return age_s is None or age_s > STALE_S


def torque_state(drive: dict[str, Any]) -> str:
    """Return on, off, or unknown: a drive that is not heard may have torque even if it last reported none."""
    age_s = drive["heartbeat_age_s"]
    if age_s is None or age_s > HEARTBEAT_STALE_S:
        return "unknown"
    return "on" if drive["closed_loop"] else "off"
