"""How long one whole tick takes while the robot walks, and where that time goes.

The simulated robot walks the paper's track adaptively, in step with the daemon's own loop, with four drives on two
buses. The robot computes between the ticks and outside of every figure. Hot ticks wait for no deadline, so processor
and caches are warmer than on a robot; before each cold tick the processor sleeps for a period. Five kinds of
buses carry the frames: python-can's in-process `virtual` interface, our `mock` bus without python-can, the `local`
bus's sockets, and SocketCAN on pairs of sockets, by the socket's own frames (`socketcan`) and by python-can's send and
recv (`python-can`). `--bus` measures only one of them; `--drive` chooses the type of its drives. A rig of one flipper
with two motors on one bus walks in turn with the robot, and `two_motors` compares its ticks.

The work at the end of an insertion and of a stride is spread over ticks: `longest_us` summarises the longest tick of
each of these ends. `serving_us` is the cost of serving the status socket after a tick: without a request, with a
viewer's request for the status, and with one for the largest answer (served_walk.py).

`ratios` hardly depend on the computer. `hot_to_bare_sockets` divides a whole tick by the time in which bare sockets
read and send its frames (bare_sockets.py), in turn with the ticks. The others are divided by a whole tick: cold ticks,
the longest ticks of the ends, the longest tick of all, and serving. All but the longest of all are medians.

Blocks of 1 s alternate between whole ticks and ticks marked at the beginning of every stage. A stage contains the cost
of one mark, some 0.2 us; whole ticks carry one reading of the clock. `--picture FILE` draws the medians of the stages;
it needs matplotlib.
"""

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from drivers.drive_types import DEFAULT
from firmware_host.configuration.configuration import Configuration
from firmware_host.sockets.status_socket import Methods
from verification.example_robot import load_example, load_one_flipper, require_drive
from verification.report import evaluated, run_benchmark, show_progress, summary_us
from verification.speed.bare_sockets import BareSockets, count_frames
from verification.speed.served_walk import ServedWalk
from verification.speed.serving_time import fullest_methods
from verification.speed.tick_pictures import plot_parts, require_matplotlib
from verification.walks.timed_walk import TimedWalk
from verification.walks.wired_walk import open_wiring
from verification.walks.wirings import VARIANTS

BAR_US = 200.0


def measure_variant(variant: str, seconds: int, folder: Path, drive: str, fullest: Methods) -> dict[str, Any]:
    with ExitStack() as stack:
        walks = [
            _walk(stack, configuration, variant, folder / str(len(configuration.drive)))
            for configuration in (load_example(drive), load_one_flipper(drive))
        ]
        bare = BareSockets(count_frames(load_example(drive), folder))
        stack.callback(bare.close)
        served = ServedWalk(walks[0], fullest, folder)
        stack.callback(served.close)
        for second in range(seconds):
            show_progress(second, seconds, f"{variant} bus")
            for walk in walks:
                walk.run_blocks()
            bare.run_block()
            served.run_block()
        report, two_motors = (walk.report() for walk in walks)
        ratio = two_motors["whole_us"]["median"] / report["whole_us"]["median"]
        report |= {"bare_sockets_us": summary_us(bare.durations_s)}
        report |= {"serving_us": served.report()}
        report |= {"ratios": _ratios(report) | served.ratios(report["whole_us"]["median"])}
        return report | {"two_motors": {"whole_us": two_motors["whole_us"], "ratio": round(ratio, 3)}}


def _ratios(report: dict[str, Any]) -> dict[str, float | None]:
    whole_us, ends = report["whole_us"]["median"], report["longest_us"]["ends"]
    return {
        "hot_to_bare_sockets": round(whole_us / report["bare_sockets_us"]["median"], 2),
        "cold_to_hot": round(report["cold_us"]["median"] / whole_us, 2),
        "ends_to_hot": round(report["longest_us"]["median"] / whole_us, 2) if ends else None,
        "longest_to_hot": round(report["whole_us"]["max"] / whole_us, 2),
    }


def _medians_us(report: dict[str, Any]) -> dict[str, float]:
    return {stage: summary["median"] for stage, summary in report["stages_us"].items()}


def _walk(stack: ExitStack, configuration: Configuration, variant: str, folder: Path) -> TimedWalk:
    folder.mkdir()
    wiring, recorder = stack.enter_context(open_wiring(variant, configuration, folder))
    walk = TimedWalk(configuration, wiring, recorder)
    walk.warm_up()
    return walk


def measure(
    folder: Path, *, seconds: int = 20, bus: str = "", drive: str = DEFAULT, picture: str = ""
) -> dict[str, Any]:
    """The verdict is that of the virtual bus, or of the only one that was measured."""
    require_drive(drive)
    if bus and bus not in VARIANTS:
        raise SystemExit(f"--bus {bus}: must be one of {', '.join(VARIANTS)}")
    if picture:
        require_matplotlib()
    measured, fullest = {}, fullest_methods()
    for variant in [bus] if bus else VARIANTS:
        (folder / variant).mkdir()
        measured[variant] = measure_variant(variant, seconds, folder / variant, drive, fullest)
    if picture:
        plot_parts({name: _medians_us(each) for name, each in measured.items()}, Path(picture))
    bus = bus or "virtual"
    report = {"seconds": seconds, "drive": drive, "variants": measured, "bar_us": BAR_US}
    reached = measured[bus]["whole_us"]["median"] <= BAR_US
    return evaluated(report, f"median whole tick over the {bus} bus at most {BAR_US:.0f} us", reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
