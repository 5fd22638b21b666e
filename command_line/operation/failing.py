"""Runs `mudskipper fail`: makes a part of the robot fail on purpose, where its configuration allows that."""

import argparse
from typing import Any

from command_line import exit_codes
from command_line.json_output import print_json, print_value
from command_line.operation.operation import with_daemon
from command_line.screen import complain
from experiments.reports.text_tables import table
from operator_client.status_client import StatusClient


def fail(options: argparse.Namespace) -> int:
    if options.list and options.component is not None:
        complain("fail --list takes neither COMPONENT nor KIND")
        return exit_codes.USAGE
    if options.list:
        return with_daemon(options, lambda client: _show(client, options.json))
    if options.component is None or options.kind is None:
        complain("fail needs a COMPONENT and a KIND, or --list")
        return exit_codes.USAGE
    return with_daemon(options, lambda client: _fail(client, options))


def _fail(client: StatusClient, options: argparse.Namespace) -> int:
    failing = client.call("fail", component=options.component, kind=options.kind, for_s=options.seconds)
    if options.json:
        print_value(failing)
    else:
        print(failing_table(failing))
    return exit_codes.OK


def _show(client: StatusClient, as_json: bool) -> int:
    report = client.call("failures")
    if as_json:
        print_json("failures", report)
    elif report["allowed"]:
        print(f"{families_table(report['table'])}\n\n{failing_table(report['failing'])}")
    else:
        print("deliberate failures are not allowed: failures.allowed is false in the configuration")
    return exit_codes.OK


def families_table(rows: list[dict[str, Any]]) -> str:
    """Returns a row for each family of components with the same kinds; --json lists every component."""
    kinds: dict[str, dict[str, None]] = {}
    members: dict[str, dict[str, None]] = {}
    for row in rows:
        kinds.setdefault(row["family"], {})[row["kind"]] = None
        for placeholder in ("JOINT", "NAME"):
            head, found, tail = row["family"].partition(placeholder)
            if found:
                name = row["component"].removeprefix(head).removesuffix(tail)
                members.setdefault(placeholder, {})[name] = None
    text = table([("component", "kinds"), *((family, ", ".join(each)) for family, each in kinds.items())])
    return "\n".join([text, "", *(f"{placeholder}: {', '.join(names)}" for placeholder, names in members.items())])


def failing_table(failing: list[dict[str, Any]]) -> str:
    if not failing:
        return "nothing fails on purpose"
    rows = [(each["component"], each["kind"], f"{each['remaining_s']:.1f} s more", each["does"]) for each in failing]
    return table([("failing", "kind", "for", "what it does"), *rows])
