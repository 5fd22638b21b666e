"""`mudskipper drives find`: lists what answers on the buses, and what does not fit the configuration."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

from command_line import exit_codes
from command_line.drives.opened_buses import FD_RATE_KBIT_S, OpenedBus, opened_buses
from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.robot_options import RobotConfiguration, interface_name
from command_line.screen import GREEN, RED, YELLOW, coloured, watched
from control.computing.suggestion import suggestion
from drivers.bench.search import SearchResult, drive_problems, expectation_problems, id_problems
from drivers.drive import DriveParameters
from drivers.drive_types import DRIVE_BENCHES
from experiments.reports.text_tables import table
from experiments.study.option import Option
from firmware_host.configuration.configuration import BusParameters
from firmware_host.configuration.loading import load_configuration

HEAD = ("id", "type", "joint", "hardware", "firmware", "serial number")
UNKNOWN = "-"


def find(
    *,
    config: RobotConfiguration,
    bus: Annotated[tuple[str, ...], Option("configured bus (default: all)")] = (),
    interface: Annotated[
        str | None, Option("of python-can, such as socketcan, without a configuration", parse=interface_name)
    ] = None,
    channel: Annotated[str | None, Option("of that interface, such as can0")] = None,
    fd: Annotated[bool, Option("that interface carries CAN FD")] = False,
    type: Annotated[tuple[str, ...], Option("ask drives of this type alone", choices=tuple(DRIVE_BENCHES))] = (),
) -> Answer:
    drives: Mapping[str, DriveParameters] = {}
    if interface and channel:
        rate_kbit_s = FD_RATE_KBIT_S if fd else 0
        buses = {channel: BusParameters(interface, channel, {}, 1000, rate_kbit_s)}
    elif interface or channel:
        raise usage_error("--interface and --channel belong together: --interface socketcan --channel can0")
    else:
        configuration = load_configuration(config)
        drives, configured = configuration.drive, configuration.bus
        if unknown := next((name for name in bus if name not in configured), None):
            raise usage_error(f"--bus {unknown}: {config} has no such bus; {suggestion(unknown, configured)}")
        buses = {name: each for name, each in configured.items() if name in (bus or configured)}
    with opened_buses(buses) as opened, watched() as show:
        results = [(each, each.search(type, show)) for each in opened]
    drives = {joint: drive for joint, drive in drives.items() if not type or drive.type in type}
    reports = [_report(each, result, drives) for each, result in results]
    text = "\n\n".join("\n".join(_lines(report)) for report in reports)
    failed = any(report["problems"] or not report["drives"] for report in reports)
    return Answer({"buses": reports}, text, exit_codes.UNHEALTHY if failed else exit_codes.OK, "drives-find")


def _report(bus: OpenedBus, result: SearchResult, configured: Mapping[str, DriveParameters]) -> dict[str, Any]:
    expected = {joint: drive for joint, drive in configured.items() if drive.bus == bus.name}
    joints = {(drive.node_id, drive.type): joint for joint, drive in expected.items()}
    drives = [each._asdict() | {"joint": joints.get((each.node_id, each.type), "")} for each in result.found]
    found = [each._replace(model_problem="") if (each.node_id, each.type) in joints else each for each in result.found]
    problems = [*drive_problems(found), *id_problems(found), *expectation_problems(found, expected)]
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
        configured = ", every configured drive answers" if any(drive["joint"] for drive in drives) else ""
        yield f"{coloured('ok', GREEN)}   every id answers once{configured}"
