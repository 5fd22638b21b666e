"""`mudskipper drives find`: lists what answers on the buses, and what does not fit the configuration."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from command_line import exit_codes
from command_line.drives.opened_buses import OpenedBus, chosen_buses, opened_buses
from command_line.json_output import print_json
from command_line.screen import GREEN, RED, YELLOW, coloured, complain, watched
from drivers.bench.search import SearchResult, expectation_problems, id_problems, search
from drivers.drive import DriveParameters
from drivers.drive_types import DRIVE_BENCHES
from experiments.reports.text_tables import table
from firmware_host.buses import BusError
from firmware_host.configuration.file_problems import ConfigurationError

HEAD = ("id", "type", "joint", "hardware", "firmware", "serial number")
UNKNOWN = "-"


def find(options: argparse.Namespace) -> int:
    try:
        buses, configuration = chosen_buses(options)
        drives = configuration.drive if configuration else {}
        with opened_buses(buses) as opened:
            results = [(bus, _search(bus, options)) for bus in opened]
    except ConfigurationError as problem:
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    except BusError as problem:
        complain(str(problem))
        return exit_codes.UNHEALTHY
    reports = [_report(bus, result, _on_bus(drives, bus.name)) for bus, result in results]
    if options.json:
        print_json("drives-find", {"buses": reports})
    else:
        print("\n\n".join("\n".join(_lines(report)) for report in reports))
    failed = any(report["problems"] or not report["drives"] for report in reports)
    return exit_codes.UNHEALTHY if failed else exit_codes.OK


def _search(bus: OpenedBus, options: argparse.Namespace) -> SearchResult:
    with watched() as show:
        return search(bus.port, DRIVE_BENCHES, bus.carries_fd, options.type or (), show)


def _on_bus(drives: Mapping[str, DriveParameters], bus: str) -> dict[str, DriveParameters]:
    return {joint: drive for joint, drive in drives.items() if drive.bus == bus}


def _report(bus: OpenedBus, result: SearchResult, expected: Mapping[str, DriveParameters]) -> dict[str, Any]:
    joints = {(drive.node_id, drive.type): joint for joint, drive in expected.items()}
    drives = [each._asdict() | {"joint": joints.get((each.node_id, each.type), "")} for each in result.found]
    problems = [f"id {each.node_id} ({each.type}): {each.problem}" for each in result.found if each.problem]
    problems += [*id_problems(result.found), *expectation_problems(result.found, expected)]
    if result.error_frames:
        problems.append(
            f"{result.error_frames} error frames: two drives may send under one id, or the bit rates differ"
        )
    if result.send_problem:
        problems.append(f"questions did not leave: {result.send_problem}")
    return {
        "bus": bus.name,
        "interface": bus.parameters.interface,
        "channel": bus.parameters.channel,
        "drives": drives,
        "not_asked": dict(result.not_asked),
        "problems": problems,
    }


def _lines(report: Mapping[str, Any]) -> Iterator[str]:
    drives: Sequence[Mapping[str, Any]] = report["drives"]
    count = f"{len(drives)} drive{'' if len(drives) == 1 else 's'}" if drives else "no drive answers"
    yield f"{report['bus']} ({report['interface']} {report['channel']}): {count}"
    if drives:
        keys = ("node_id", "type", "joint", "hardware", "firmware", "serial_number")
        rows = [tuple(str(drive[key] if drive[key] != "" else UNKNOWN) for key in keys) for drive in drives]
        yield "\n".join(f"  {line}" for line in table([HEAD, *rows]).splitlines())
    if report["problems"] or not drives:
        for name, reason in report["not_asked"].items():
            yield f"{coloured('note', YELLOW)} type {name} was not searched: {reason}"
    for problem in report["problems"]:
        yield f"{coloured('FAIL', RED)} {problem}"
    if drives and not report["problems"]:
        yield (
            coloured("ok", GREEN)
            + "   every id answers once"
            + (", every configured drive answers" if any(drive["joint"] for drive in drives) else "")
        )
