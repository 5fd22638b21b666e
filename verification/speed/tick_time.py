"""How long one whole tick takes while the robot walks, as a multiple of bare sockets, and where that time goes.

The simulated robot walks the paper's track adaptively, in step with the daemon's own loop, with four drives on two
buses (timed_walk.py): over our `mock` bus, and over SocketCAN on pairs of sockets. `--bus` measures one of them;
`--drive` chooses the type of the drives. Blocks of 1 s alternate between whole ticks, bare sockets, cold ticks, and
ticks marked at the beginning of every stage.

`ratios` depend less on the computer than times do. `hot_to_bare_sockets` divides a whole tick by the time in which
bare sockets read and send its frames; cold ticks and the longest ticks at the ends of insertions and strides are
divided by a whole tick. All are medians. `--against FOLDER` compares with another working tree: both measure their
whole tick over the mock bus in turns, as processes of their own. `--picture FILE` draws the medians of the stages; it
needs matplotlib.
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from statistics import median

from drivers.drive_types import DEFAULT
from verification.benchmark import (
    Report,
    evaluated,
    measure_in_turns,
    paired_ratio,
    run_benchmark,
    show_progress,
)
from verification.example_robot import load_example, require_drive
from verification.speed.timed_walk import open_timed_walk
from verification.wiring import BUSES

BAR_TO_BARE_SOCKETS = 3.6
PAIR_S = 4  # of walking in each turn of `--against`
PARTS = {  # of a tick, with their stages and colours
    "reading": (("read", "pose"), "#0072b2"),
    "estimate": (("estimate", "adapt"), "#e69f00"),
    "monitors": (("mode",), "#c44e52"),
    "command": (("controller", "limits", "command"), "#009e73"),
    "log": (("learn", "record"), "#999999"),
}


def measure_bus(bus: str, seconds: int, folder: Path, drive: str) -> Report:
    with open_timed_walk(load_example(drive), bus, folder) as walk:
        for second in range(seconds):
            show_progress(second, seconds, f"{bus} bus")
            walk.run_blocks()
        report = walk.report()
    whole_us, ends = report["whole_us"]["median"], report["longest_us"]["count"]
    return report | {
        "ratios": {
            "hot_to_bare_sockets": round(whole_us / report["bare_sockets_us"]["median"], 2),
            "cold_to_hot": round(report["cold_us"]["median"] / whole_us, 2),
            "ends_to_hot": round(report["longest_us"]["median"] / whole_us, 2) if ends else None,
        }
    }


def compare_trees(other: Path, pairs: int) -> Report:
    """Return the whole tick of this tree over that of another one, measured in turns."""

    def whole_us(tree: Path) -> float:
        options = ["--json", "--seconds", str(PAIR_S), "--bus", "mock"]
        command = [sys.executable, "-m", "verification.speed.tick_time", *options]
        done = subprocess.run(command, cwd=tree, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"--against {tree}: {done.stderr.strip().splitlines()[-1]}")
        found: float = json.loads(done.stdout)["variants"]["mock"]["whole_us"]["median"]
        return found

    own = Path(__file__).parents[2]
    found = measure_in_turns({"this tree": lambda: whole_us(own), "other tree": lambda: whole_us(other)}, pairs)
    medians_us = {name: median(each) for name, each in found.items()}
    return {"pairs": pairs, "medians_us": medians_us} | paired_ratio(found["this tree"], found["other tree"])


def plot_parts(stages_us: Mapping[str, Mapping[str, Mapping[str, float]]], path: Path) -> None:
    """Draw a bar for each kind of bus, of the medians of its stages."""
    from matplotlib.figure import Figure  # slow to import

    figure = Figure(figsize=(8.0, 0.9 + 0.5 * len(stages_us)), layout="constrained")
    panel = figure.add_subplot()
    for bus, own_us in reversed(list(stages_us.items())):
        left, whole_us = 0.0, sum(each["median"] for each in own_us.values())
        for part, (stages, colour) in PARTS.items():
            fraction = sum(own_us[stage]["median"] for stage in stages) / whole_us
            bar = panel.barh(bus, fraction, left=left, color=colour)
            panel.bar_label(bar, [f"{part}\n{fraction:.0%}"], label_type="center", size=7, color="white")
            left += fraction
    panel.set(xlim=(0.0, 1.0), xlabel="fraction of a tick")
    panel.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)


def measure(
    folder: Path,
    *,
    seconds: int = 20,
    bus: str = "",
    drive: str = DEFAULT,
    picture: str = "",
    against: str = "",
    pairs: int = 8,
) -> Report:
    require_drive(drive)
    if bus and bus not in BUSES:
        raise SystemExit(f"--bus {bus}: must be one of {', '.join(BUSES)}")
    if picture and not find_spec("matplotlib"):
        raise SystemExit("--picture needs matplotlib: 'make setup' installs it")
    if against:
        report = compare_trees(Path(against), pairs)
        return evaluated(report, "no slower than the other tree", report["ratio"] <= 1.0 + (report["std_error"] or 0.0))
    measured = {each: measure_bus(each, seconds, folder, drive) for each in ([bus] if bus else BUSES)}
    if picture:
        plot_parts({name: each["stages_us"] for name, each in measured.items()}, Path(picture))
    worst = max(each["ratios"]["hot_to_bare_sockets"] for each in measured.values())
    report = {"seconds": seconds, "drive": drive, "variants": measured, "bar_to_bare_sockets": BAR_TO_BARE_SOCKETS}
    bar = f"a hot tick at most {BAR_TO_BARE_SOCKETS:g} times bare sockets"
    return evaluated(report, bar, worst <= BAR_TO_BARE_SOCKETS)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
