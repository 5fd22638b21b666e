"""`mudskipper experiment faults`: its plan from the command line."""

import argparse

from command_line.experiments.conduct import conduct, refuse
from command_line.experiments.workers import workers_of
from drivers.fault_injection.failure_table import PHASES
from verification.faults import matrix
from verification.faults.text import faults_finding


def run_faults(options: argparse.Namespace) -> int:
    if not options.simulated:
        return refuse("failures are injected into a simulated robot: this experiment runs with --simulated only")
    try:
        plan = matrix.Plan(
            faults=tuple(dict.fromkeys(options.fault or matrix.FAULTS)),
            phases=tuple(dict.fromkeys(options.phase or PHASES)),
            seeds=options.seeds,
            drive=options.drive,
        )
    except ValueError as problem:
        return refuse(str(problem))
    if not plan.cells:
        return refuse("none of these faults can occur in these phases")
    return conduct(
        options, "cells", lambda show: faults_finding(matrix.run(plan, show, workers_of(options))), matrix.__name__
    )
