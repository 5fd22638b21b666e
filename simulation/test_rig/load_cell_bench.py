"""A bench with a stage, a plate, a load cell and its amplifier, and its own time: the paper's section II-E.

Simulated time passes as fast as the machine computes. Run by itself, this module follows the wall clock:
`python -m simulation.test_rig.load_cell_bench LINK [--mud W] [--position] [--hand]` puts an amplifier at LINK, which
opens as any serial port, and an encoder of the stage at LINK_position. It executes commands from its standard input:
insert, lower, drag, lift, remix [W], turn, hang [G], unplug, plug, quit.
"""

import argparse
import select
import sys
import time
from collections.abc import Callable
from pathlib import Path

from control.geometry import FlipperGeometry
from drivers.load_cell.line_formats import GRAVITY_M_S2
from simulation.mud.clay import clay_of_water
from simulation.test_rig.emulated_instruments import (
    STYLES,
    AmplifierParameters,
    EmulatedAmplifier,
    EmulatedStageEncoder,
    StageEncoderParameters,
)
from simulation.test_rig.load_cell import LoadCell
from simulation.test_rig.plate_stage import CarriedPlate, PlateStage, StageParameters
from simulation.test_rig.stage_motion import ManualMotionParameters

STEP_S = 0.01
RELAXATION = 0.13  # fraction of the load that a hold loses, as in the authors' logs
PAPER_PLATE = FlipperGeometry(plate_width_m=0.03, plate_height_m=0.035, plate_thickness_m=0.004)


def clay_plate(water_percent: float, plate: FlipperGeometry = PAPER_PLATE) -> LoadCell:
    """Raise ValueError where no mud has this water content."""
    return LoadCell(clay_of_water(water_percent), plate, 0.0, 0.0, RELAXATION)


class EmulatedBench:
    """Owns the time."""

    def __init__(
        self,
        plate: CarriedPlate,
        link: Path,
        amplifier: AmplifierParameters | None = None,
        stage: StageParameters | None = None,
        seed: int = 1,
        encoder: StageEncoderParameters | None = None,
    ) -> None:
        """`encoder`: adds a stage encoder, whose link is that of the amplifier with `_position` appended."""
        self.stage = PlateStage(plate, stage)
        self.amplifier = EmulatedAmplifier(self.stage.mean_force_n, amplifier or AmplifierParameters(), link, seed)
        self.encoder: EmulatedStageEncoder | None = None
        if encoder is not None:
            encoder_link = link.with_name(f"{link.name}_position")
            self.encoder = EmulatedStageEncoder(self.stage.travelled_m, encoder, encoder_link, seed + 1)
        self._now_s = 0.0
        self.stage.mean_force_n(0.0)

    def now_s(self) -> float:
        return self._now_s

    def pass_time(self, duration_s: float) -> None:
        end_s = self._now_s + duration_s
        while self._now_s < end_s - 1e-9:
            self._now_s = min(self._now_s + STEP_S, end_s)
            self.amplifier.step(self._now_s)
            if self.encoder is not None:
                self.encoder.step(self._now_s)

    def close(self) -> None:
        self.amplifier.close()
        if self.encoder is not None:
            self.encoder.close()


def execute(bench: EmulatedBench, words: list[str]) -> str:
    """Execute one command of the operator at the emulated bench and return the answer."""
    stage, now_s = bench.stage, bench.now_s()
    number = float(words[1]) if len(words) > 1 else None
    commands: dict[str, Callable[[], None]] = {
        "insert": lambda: stage.insert(now_s, 0.03, number or 0.1, 3.0),
        "lower": lambda: stage.lower(now_s, 0.03),
        "drag": lambda: stage.drag(now_s, 0.2, number or 0.1),
        "lift": lambda: stage.lift(now_s),
        "remix": lambda: stage.move_over(clay_plate(number) if number else stage.plate, False),
        "turn": lambda: stage.move_over(stage.plate, not stage.measures_sideways),
        "hang": lambda: setattr(stage, "hung_weight_n", (number or 0.0) / 1000.0 * GRAVITY_M_S2),
        "unplug": bench.amplifier.unplug,
        "plug": bench.amplifier.plug_in,
    }
    if bench.encoder is not None:
        commands |= {"unplug-position": bench.encoder.unplug, "plug-position": bench.encoder.plug_in}
    if words[0] not in commands:
        return f"unknown command {words[0]}: type one of {', '.join(commands)}, quit"
    commands[words[0]]()
    return f"{words[0]} at {now_s:.1f} s"


def main() -> None:
    parser = argparse.ArgumentParser(description="An emulated load cell on a stage, in real time.")
    parser.add_argument("link", type=Path, help="name of its serial port, which must not exist yet")
    parser.add_argument("--mud", type=float, default=49.5, metavar="W", help="water content in percent")
    parser.add_argument("--style", choices=STYLES, default="counts")
    parser.add_argument("--baud", type=int, default=115200)
    parser.add_argument("--rate", type=float, default=80.0, metavar="HZ")
    parser.add_argument("--position", action="store_true", help="add an encoder at LINK_position, 10 um a count")
    parser.add_argument("--hand", action="store_true", help="the stage is pushed by a hand")
    options = parser.parse_args()
    amplifier = AmplifierParameters(rate_hz=options.rate, style=options.style, baud=options.baud)
    stage = StageParameters(manual=ManualMotionParameters() if options.hand else None)
    encoder = StageEncoderParameters() if options.position else None
    bench = EmulatedBench(clay_plate(options.mud), options.link, amplifier, stage, encoder=encoder)
    bench.amplifier.waits_for_delivery = False  # another process reads at any time
    if bench.encoder is not None:
        bench.encoder.waits_for_delivery = False
    start_s, words = time.monotonic(), [""]
    try:
        while words != ["quit"]:
            bench.pass_time(max(0.0, time.monotonic() - start_s - bench.now_s()))
            if select.select([sys.stdin], [], [], STEP_S)[0]:
                words = sys.stdin.readline().split() or ["quit"]
                print(execute(bench, words) if words != ["quit"] else "", flush=True)
    finally:
        bench.close()


if __name__ == "__main__":
    main()
