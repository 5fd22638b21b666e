"""What may be believed of a drive in the daemon's status: values of a drive that fell silent are not those of now."""

from typing import Any

POWER_CUT = "power cut"
STALE_S = 0.1  # a drive sends position and current every 2 ms
HEARTBEAT_STALE_S = 0.6  # and a heartbeat every 100 ms; after 0.5 s without it is a fault


def is_stale(drive: dict[str, Any]) -> bool:
    age_s = drive["angle_age_s"]
    return age_s is None or age_s > STALE_S


def mode_word(report: dict[str, Any]) -> str:
    """Return the mode of the robot, or that its motors have no power."""
    return POWER_CUT if report["power_cut"] else str(report["mode"])


def supply_text(report: dict[str, Any]) -> str:
    """Return the lowest voltage of all drives, their currents together, and the lowest voltage of the last stride."""
    drives = [drive for drive in report["drives"] if not is_stale(drive)]
    voltages_v = [drive["bus_voltage_v"] for drive in drives if drive["bus_voltage_v"] is not None]
    currents_a = [drive["bus_current_a"] for drive in drives if drive["bus_current_a"] is not None]
    parts = [f"{min(voltages_v):.1f} V"] if voltages_v else ["voltage unknown"]
    parts += [f"{sum(currents_a):.1f} A"] if currents_a else []
    stride_v = report["stride_supply_min_v"]
    return ", ".join([*parts, f"lowest {stride_v:.1f} V in the last stride"] if stride_v is not None else parts)


def torque_state(drive: dict[str, Any]) -> str:
    """Return on, off, or unknown: a drive that is not heard may have torque even if it last reported none."""
    age_s = drive["heartbeat_age_s"]
    if age_s is None or age_s > HEARTBEAT_STALE_S:
        return "unknown"
    return "on" if drive["closed_loop"] else "off"
