"""How well a campaign uses a second worker: its speed with two workers over twice the speed with one.

Each round runs the same campaign with one worker and then with two, with notebook, Parquet file and report as the
command does. The efficiency of a round is the elapsed time with one worker over twice that with two. Another busy
program lowers it: on two processors, two workers and the command already compete for them. `quiet` is the processor
time of the campaign over the elapsed time of its workers: near 1 nothing else computed there. `work_ratio` is the
processor time with one worker over that with two. It shows what the second worker costs also on a busy computer, but
not how long a worker waits.
"""

import os
import sys
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from experiments.campaign.campaign import run_campaign
from experiments.campaign.campaign_file import Campaign, load_campaign
from experiments.robot.prompt import AutomaticOperator
from experiments.study.workers import LocalWorkers
from experiments.trials.session import Session
from verification.report import evaluated, run_benchmark, show_progress

BAR = 0.85
TEXT = """
seeds = {seeds}
[walk]
strides = {strides}
[grid]
world.segment.strength_pa = [1000.0, 3000.0]
"""


def elapsed_s(campaign: Campaign, folder: Path, workers: LocalWorkers) -> tuple[float, float]:
    """Return the elapsed time of the campaign, and the processor time of this process and its workers."""
    folder.mkdir()
    session = Session(folder, AutomaticOperator(lambda _: None), lambda done, total: None)
    begun_s, used_s = perf_counter(), _used_s()
    run_campaign(campaign, session, workers)
    return perf_counter() - begun_s, _used_s() - used_s


def _used_s() -> float:
    return sum(os.times()[:4])


def measure(folder: Path, *, rounds: int = 3, seeds: int = 8, strides: int = 4) -> dict[str, Any]:
    path = folder / "campaign.toml"
    path.write_text(TEXT.format(seeds=seeds, strides=strides), encoding="utf-8")
    campaign, measured = load_campaign(path), []
    for number in range(rounds):
        show_progress(number, rounds, "walking")
        one_s, one_used_s = elapsed_s(campaign, folder / f"{number}-one", LocalWorkers(1))
        two_s, two_used_s = elapsed_s(campaign, folder / f"{number}-two", LocalWorkers(2))
        measured.append(
            {
                "one_s": round(one_s, 2),
                "two_s": round(two_s, 2),
                "efficiency": round(one_s / (2.0 * two_s), 3),
                "work_ratio": round(one_used_s / two_used_s, 3),
                "quiet_one": round(one_used_s / one_s, 3),
                "quiet_two": round(two_used_s / (2.0 * two_s), 3),
            }
        )
    efficiency = median(each["efficiency"] for each in measured)
    work_ratio = median(each["work_ratio"] for each in measured)
    report = {
        "walks": len(campaign.trials),
        "rounds": measured,
        "efficiency": efficiency,
        "work_ratio": work_ratio,
        "bar": BAR,
    }
    return evaluated(report, f"at least {BAR:.0%} of twice the speed with two workers", efficiency >= BAR)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
