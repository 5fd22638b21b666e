"""Describes walks for their logs: `mudskipper trial` and `mudskipper note`."""

import argparse
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from command_line import exit_codes
from command_line.errors import usage_error
from command_line.json_output import print_value
from command_line.operation.operation import connect
from command_line.shared_options import Json, Socket
from experiments.reports.text_tables import table
from experiments.study.option import Option


def key_value(text: str) -> tuple[str, str]:
    """Parse KEY=VALUE. The daemon checks both."""
    key, found, value = text.partition("=")
    if not (found and key):
        raise argparse.ArgumentTypeError(f"{text:.60}: must be a key and its value, such as mud=A")
    return key, value


KeyValues = Annotated[
    tuple[tuple[str, str], ...], Option("mud=A water=49.5 ...; KEY= removes one", metavar="KEY=VALUE", parse=key_value)
]


def show(trial_of: Mapping[str, Mapping[str, str]]) -> None:
    """Print descriptions side by side, each below its head."""
    keys = dict.fromkeys(key for described in trial_of.values() for key in described)
    rows = [[key, *(described.get(key, "-") for described in trial_of.values())] for key in keys]
    print(table([["", *trial_of], *rows]) if rows else "no description is set")


def trial(
    action: Annotated[Literal["show", "set"], Option("(default: show)", metavar="set")] = "show",
    values: KeyValues = (),
    *,
    socket: Socket,
    json: Json = False,
) -> int:
    """Show how walks are described, or change the defaults, which hold until they are changed again."""
    if bool(values) != (action == "set"):
        raise usage_error("'mudskipper trial set KEY=VALUE ...' changes the defaults, 'mudskipper trial' shows them")
    with connect(socket) as client:
        report = client.call("trial_set", **dict(values)) if values else client.call("trial")
    if json:
        print_value(report)
    else:
        show({"default": report["defaults"], "this walk, or the last": report["present"]})
    return exit_codes.OK


def note(
    text: Annotated[str, Option("for the log", metavar="TEXT")] = "",
    *,
    socket: Socket,
    json: Json = False,
    mark: Annotated[bool, Option("mark this moment, such as a clap that a camera records")] = False,
) -> int:
    """Write a note or a marker into the log, and print its time."""
    if not (text or mark):
        raise usage_error("a note needs a text, such as 'mudskipper note \"rained last night\"'")
    with connect(socket) as client:
        written: dict[str, Any] = client.call("mark" if mark else "note", text=text)
    if json:
        print_value(written)
    else:
        print(f"{written['time']}  {written['stamp_s']:.4f} s by the robot's clock")
    return exit_codes.OK
