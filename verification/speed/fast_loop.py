"""How many ticks the daemon's loop misses at rates above its own 380 Hz.

Three processes, as on a robot: the simulated robot, the daemon, which walks it, and this one, which asks the daemon.
The robot and its messages keep their own rates. A bare loop, which only waits, takes turns with the daemon at the same
rate: the ticks that it misses are lost by the machine, not by the daemon. A tick is missed when it begins a whole
period late or more. `compiled` says which form of the tick ran. `--rate-hz` measures one rate only, for a machine
that is too slow for 4 kHz.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from firmware_host.computer.realtime import prepare_loop
from firmware_host.configuration.loading import load_configuration
from firmware_host.software_version import is_compiled
from verification.local_robot import LocalRobot
from verification.report import evaluated, run_benchmark, show_progress
from verification.speed.loop_jitter import Report, processors_awake, summary_of, time_bare_loop, time_daemon

TURN_S = 30.0
BARS = {1000.0: 0.0, 4000.0: 0.001}  # fraction of the ticks that may be missed, by the rate in Hz
ANY_BAR = 0.001  # at any other rate


def run_turns(robot: LocalRobot, rate_hz: float, turn_s: float, turns: int) -> Report:
    """Returns the ticks of the daemon and of the bare loop at one rate."""
    daemon: list[Report] = []
    bare: list[Report] = []
    for turn in range(turns):
        show_progress(turn, turns, f"walking at {rate_hz:g} Hz")
        daemon.append(time_daemon(robot, turn_s, rate_hz))
        bare.append(time_bare_loop(turn_s, 1.0 / rate_hz))
    return {
        "loop": with_fraction([each["loop"] for each in daemon]),
        "bare": with_fraction(bare),
        "faults": sum(each["mode"] != "walking" for each in daemon),
        "dropped_rows": sum(each["log"]["dropped"] for each in daemon),
    }


def with_fraction(turns: Sequence[Report]) -> Report:
    total = summary_of(turns)
    return total | {"missed_fraction": total["missed_ticks"] / max(1, total["ticks"] + total["missed_ticks"])}


def measure(folder: Path, *, seconds: float = 120.0, rate_hz: float = 0.0) -> Report:
    """`rate_hz` 0: each rate that has a bar."""
    turn_s = min(TURN_S, seconds)
    bars = {rate_hz: BARS.get(rate_hz, ANY_BAR)} if rate_hz else BARS
    robot = LocalRobot(folder)
    try:
        options = load_configuration(robot.configuration).loop
        warnings = prepare_loop(options.priority, options.cpu, options.lock_memory)
        with processors_awake(robot, held=True) as refused:
            rates = {rate_hz: run_turns(robot, rate_hz, turn_s, max(1, round(seconds / turn_s))) for rate_hz in bars}
    finally:
        robot.end()
    report: Report = {f"{rate_hz:g}": each for rate_hz, each in rates.items()}
    report |= {"turn_s": turn_s, "compiled": is_compiled(), "warnings": warnings + refused}
    reached = all(
        rates[rate_hz]["loop"]["missed_fraction"] <= bar and not rates[rate_hz]["faults"]
        for rate_hz, bar in bars.items()
    )
    text = " and ".join(
        f"at most {100.0 * bar:g} % of the ticks missed at {rate_hz:g} Hz" for rate_hz, bar in bars.items()
    )
    return evaluated(report, f"{text}, without a fault", reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
