"""A simulated robot on a busy computer: ticks are missed, or emulated drives run late, at random with a seed.

A late drive executes the waiting commands in their order and then catches up with the missed time, like the process
that emulates drives in real time.
"""

from random import Random

from control.rate import PERIOD_S
from experiments.bench.rig import SimulatedRig
from firmware_host.configuration.configuration import Configuration
from firmware_host.ticker import Tick


class LateRig(SimulatedRig):
    """A rig that runs on time until `begin`."""

    def __init__(self, configuration: Configuration) -> None:
        self._missing_fraction = self._waiting_fraction = 0.0  # of ticks that begin a delay
        self._longest = self._waits = 0  # ticks
        self._random = Random()
        super().__init__(configuration)

    def begin(self, missing_fraction: float, waiting_fraction: float, longest: int, seed: int) -> None:
        self._missing_fraction, self._waiting_fraction, self._longest = missing_fraction, waiting_fraction, longest
        self._random.seed(seed)

    def wait(self) -> Tick:
        missed = self._some(self._missing_fraction)
        self._tick_number += 1 + missed
        for other in self.others:
            other(self)
        self._waits = self._waits - 1 if self._waits > 0 else self._some(self._waiting_fraction)
        if not self._waits:
            self.robot.advance(self.now_s)
        return Tick(self.now_s, missed * PERIOD_S, self._tick_number, missed)

    def _some(self, fraction: float) -> int:
        return self._random.randint(1, self._longest) if self._random.random() < fraction else 0
