"""Finds ODrives with firmware 0.5: those that send a heartbeat, report no version, and report counts of their encoder.

Only ids with a heartbeat are asked for counts: with node id 0 that request has the id of a drive in MIT mode.
"""

from collections.abc import Sequence

from drivers.bench.bench_port import BenchPort
from drivers.bench.drive_bench import SetupFacts
from drivers.bench.drive_setup import FoundDrive, NoSetup
from drivers.odrive.bench import CanSimpleBench, ask
from drivers.odrive.codec import GET_VERSION
from drivers.odrive05.codec import GET_ENCODER_COUNT

NAME, FIRMWARE = "odrive05", "0.5"
NO_SETTINGS = "firmware 0.5 has no messages for its settings: use odrivetool over USB, and see docs/how-to/odrive05.md"
UNKNOWN = "it sends a heartbeat, and reports neither a version nor the counts of its encoder"


class Odrive05Bench(CanSimpleBench):
    def find(self, port: BenchPort, heard: set[int]) -> Sequence[FoundDrive]:
        old = sorted(heard - set(ask(port, sorted(heard), GET_VERSION)))
        counted = ask(port, old, GET_ENCODER_COUNT) if old else {}
        return [
            FoundDrive(NAME, node_id, firmware=FIRMWARE, problem="" if node_id in counted else UNKNOWN)
            for node_id in old
        ]

    def open_setup(self, port: BenchPort, facts: SetupFacts) -> NoSetup:
        return NoSetup(FoundDrive(NAME, facts.parameters.node_id, firmware=FIRMWARE), NO_SETTINGS)
