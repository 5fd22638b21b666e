"""`mudskipper experiment lablogs`: its plan from the command line."""

import argparse

from command_line.experiments.conduct import conduct, refuse
from experiments.lablogs.lablogs import Plan, evaluate
from experiments.lablogs.log_choice import GroupRule, find_logs
from experiments.lablogs.text import lablogs_finding


def lablogs(options: argparse.Namespace) -> int:
    missing = [str(path) for path in options.folders if not path.exists()]
    if missing:
        return refuse(f"{missing[0]}: no such folder")
    rules = tuple(GroupRule(pattern, name) for pattern, name in options.group or ())
    plan = Plan(find_logs(options.folders), rules, tuple(options.air or ()), options.vertical)
    if not plan.logs:
        return refuse(f"{options.folders[0]}: holds no log: no file whose name ends with .csv, .csv.gz or .mcap")
    if unmatched := plan.unmatched():
        return refuse(f"pattern {unmatched[0]!r}: no log has such a name")
    return conduct(options, "logs", lambda show: lablogs_finding(evaluate(plan, show)), Plan.__module__)
