"""One trial of a campaign: a simulated walk in lockstep with the daemon's loop, described as the catalogue does a log.

The rows that the loop would log stay in memory, and the catalogue's own code reads them.
"""

from hashlib import sha256
from typing import Any

import numpy as np

from control.modes import Mode
from experiments.campaign.planned_walk import PlannedWalk, plan_walk
from experiments.campaign.points import Tables
from firmware_host.configuration.configuration import Configuration
from firmware_host.log.recorder import NullRecorder
from firmware_host.log.rows import EVENT_KIND, STRIDE_KIND, TICK_KIND, row_kinds
from logs.catalogue.entry import LogEntry, values_of_entry
from logs.catalogue.log_contents import entry_of_log
from logs.files.log_reader import Log
from logs.files.tick_array import divide_ticks
from simulation.harness.lockstep import Lockstep

WHOLE, BROKEN = "whole", "broken"  # a walk, and a robot that did not start


class MemoryRecorder(NullRecorder):
    """A Recording. Owns the rows of each kind."""

    def __init__(self) -> None:
        self.rows: tuple[list[bytes], list[bytes], list[bytes]] = ([], [], [])

    def put(self, number: int, row: bytes) -> bool:
        self.rows[number].append(row)
        return True

    def log(self, configuration: Configuration) -> Log:
        tick, stride, event = row_kinds(configuration.rig)
        stored = np.frombuffer(b"".join(self.rows[TICK_KIND]), np.dtype((np.void, tick.layout.size)))
        return Log(
            metadata={
                "robot": configuration.robot.name,
                "configuration_sha256": sha256(configuration.text.encode()).hexdigest(),
            },
            configuration_text=configuration.text,
            ticks=divide_ticks(tick, stored),
            strides=[stride.decode(row) for row in self.rows[STRIDE_KIND]],
            events=[event.decode(row) for row in self.rows[EVENT_KIND]],
            complete=True,
            rig=configuration.rig,
        )


def run_walk(tables: Tables, seed: int) -> dict[str, Any]:
    """Return the columns of the catalogue, as JSON has them. They depend on nothing but the arguments."""
    planned, recorder = plan_walk(tables), MemoryRecorder()
    entry = LogEntry(file="", state=WHOLE, reason="", bytes=0, changed_ns=0)
    try:
        _walk(planned, recorder, seed)
    except RuntimeError as problem:  # of a robot that is not armed, or does not walk
        entry = entry._replace(state=BROKEN, reason=str(problem))
    entry = entry_of_log(entry, recorder.log(planned.configuration))
    return values_of_entry(entry)


def _walk(planned: PlannedWalk, recorder: MemoryRecorder, seed: int) -> None:
    configuration, world = planned.configuration, planned.world
    lockstep = Lockstep(
        configuration,
        world.track,
        seed,
        recorder,
        plant=world.plant(configuration),
        drives=world.drives(configuration),
    )
    knows_watchdogs = all(drive.knows_watchdog for drive in configuration.drive.values())
    lockstep.arm(forced="" if knows_watchdogs else "watchdog_unknown")
    lockstep.walk(planned.order)
    strides = planned.limits.strides * len(configuration.rig.flippers)
    rows, loop = recorder.rows[STRIDE_KIND], lockstep.loop
    lockstep.run_until(lambda: len(rows) >= strides or loop.mode is not Mode.WALKING, planned.limits.longest_s)
