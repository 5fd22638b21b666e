"""Describes walks for their logs: `mudskipper trial` and `mudskipper note`."""

import argparse
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.shared_options import Socket
from experiments.reports.text_tables import table
from experiments.study.option import Option
from operator_client.status_client import StatusClient


def key_value(text: str) -> tuple[str, str]:
    """Parse KEY=VALUE. The daemon checks both."""
    key, found, value = text.partition("=")
    if not (found and key):
        raise argparse.ArgumentTypeError(f"{text:.60}: must be a key and its value, such as mud=A")
    return key, value


KeyValues = Annotated[
    tuple[tuple[str, str], ...],
    Option("mud=A water=49.5 ...; KEY= removes one", metavar="KEY=VALUE", parse=key_value, keyed=True),
]


def trial_text(trial_of: Mapping[str, Mapping[str, str]]) -> str:
    """Return descriptions side by side, each below its head if it has one."""
    keys = dict.fromkeys(key for described in trial_of.values() for key in described)
    rows = [[key, *(described.get(key, "-") for described in trial_of.values())] for key in keys]
    head = [["", *trial_of]] if any(trial_of) else []
    return table([*head, *rows]) if rows else "no description is set"


def trial(
    action: Annotated[Literal["show", "set"], Option("(default: show)", metavar="set")] = "show",
    values: KeyValues = (),
    *,
    socket: Socket,
) -> Answer:
    """Show how walks are described, or change the defaults, which hold until they are changed again."""
    if bool(values) != (action == "set"):
        raise usage_error("'mudskipper trial set KEY=VALUE ...' changes the defaults, 'mudskipper trial' shows them")
    with StatusClient(socket) as client:
        report = client.call("trial_set", **dict(values)) if values else client.call("trial")
    return Answer(
        report, trial_text({"default": report["defaults"], "this walk, or the last": report["present"]}), schema="trial"
    )


def note(
    text: Annotated[str, Option("for the log", metavar="TEXT")] = "",
    *,
    socket: Socket,
    mark: Annotated[bool, Option("mark this moment, such as a clap that a camera records")] = False,
) -> Answer:
    """Write a note or a marker into the log, and print its time."""
    if not (text or mark):
        raise usage_error("a note needs a text, such as 'mudskipper note \"rained last night\"'")
    with StatusClient(socket) as client:
        written: dict[str, Any] = client.call("mark" if mark else "note", text=text)
    return Answer(written, f"{written['time']}  {written['stamp_s']:.4f} s by the robot's clock", schema="note")
