"""Runs `mudskipper fail`: makes a part of the robot fail on purpose, where its configuration allows that."""

from typing import Annotated, Any

from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.shared_options import Socket
from experiments.reports.text_tables import table
from experiments.study.option import Option
from operator_client.status_client import StatusClient


def fail(
    component: Annotated[
        str | None, Option("left_sweep, bus.left, pose ..., or all", metavar="component", offers="{joint}")
    ] = None,
    kind: Annotated[
        str | None, Option("off, stuck, garbage, slow, intermittent ..., or ok to end the failure", metavar="kind")
    ] = None,
    *,
    socket: Socket,
    seconds: Annotated[float, Option("seconds until it ends", unit="s", name="--for")] = 2.0,
    list: Annotated[bool, Option("list what can fail, how, and what fails now")] = False,
) -> Answer:
    if list and component is not None:
        raise usage_error("fail --list takes neither COMPONENT nor KIND")
    if not list and (component is None or kind is None):
        raise usage_error("fail needs a COMPONENT and a KIND, or --list")
    with StatusClient(socket) as client:
        if not list:
            failing = client.call("fail", component=component, kind=kind, for_s=seconds)
            return Answer(failing, failing_table(failing))
        report = client.call("failures")
    if report["allowed"]:
        text = f"{families_table(report['table'])}\n\n{failing_table(report['failing'])}"
    else:
        text = "deliberate failures are not allowed: failures.allowed is false in the configuration"
    return Answer(report, text, schema="failures")


def families_table(rows: list[dict[str, Any]]) -> str:
    """Return a row for each family of components with the same kinds; --json lists every component."""
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
