"""One joint's drive on the bench: what it is, its settings now, and what the configuration wants them to be."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from command_line.drives.opened_buses import OpenedBus
from drivers.bench.bench_port import NoAnswerError
from drivers.bench.drive_bench import SetupFacts
from drivers.bench.drive_setup import CannotReadError, DriveSetup, FoundDrive, Setting
from drivers.bench.search import expectation_problems, id_problems
from drivers.drive_types import DRIVE_BENCHES
from experiments.reports.text_tables import table
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError, UnreadableFileError

Show = Callable[[str, int, int], None]
NUMBERS = "flat_endpoints*.json"  # next to the configuration
HEAD = ("setting", "on the drive", "wanted", "", "from")


class JointSetup(NamedTuple):
    joint: str
    bus: str
    drive: DriveSetup
    found: FoundDrive
    settings: Sequence[Setting]
    values: Mapping[str, float]
    unreadable: Mapping[str, str]  # reasons by key

    @property
    def title(self) -> str:
        facts = [f"{self.found.type}, id {self.found.node_id} on {self.bus}", self.found.hardware]
        facts += [f"firmware {self.found.firmware}"] if self.found.firmware else []
        facts += [f"serial number {self.found.serial_number}"] if self.found.serial_number else []
        return f"{self.joint}: {', '.join(filter(None, facts))}"

    @property
    def differing(self) -> list[Setting]:
        return [each for each in self.settings if each.key in self.values and not each.accepts(self.values[each.key])]

    @property
    def wanted(self) -> dict[str, float]:
        """The values that would be written."""
        return {each.key: each.wanted for each in self.differing if not each.read_only}


def read_documents(options_files: Sequence[Path] | None, configuration: Path) -> list[Any]:
    """Return the makers' files, by default those next to the configuration. Raises ConfigurationError."""
    files = options_files or sorted(configuration.parent.glob(NUMBERS))
    documents = []
    for file in files:
        try:
            documents.append(json.loads(file.read_text(encoding="utf-8")))
        except OSError as problem:
            raise UnreadableFileError([f"{file}: {problem.strerror}"]) from None
        except ValueError:
            raise ConfigurationError([f"{file}: is no JSON"]) from None
    return documents


def bus_problems(bus: OpenedBus, configuration: Configuration, joints: Sequence[str], show: Show) -> list[str]:
    """Search a bus, and return why its drives are not those that the configuration describes."""
    expected = {joint: configuration.drive[joint] for joint in joints if configuration.drive[joint].bus == bus.name}
    types = {drive.type for drive in configuration.drive.values() if drive.bus == bus.name}
    result = bus.search(types if len(types) > 1 else (), show)
    ids = {drive.node_id for drive in expected.values()}
    return [
        *id_problems([each for each in result.found if each.node_id in ids]),
        *expectation_problems(result.found, expected),
    ]


def read_joint(
    joint: str, bus: OpenedBus, configuration: Configuration, documents: Sequence[Any], show: Show
) -> JointSetup:
    """Read all settings of a drive. Raises NoAnswerError, and ConfigurationError for a wrong document."""
    parameters = configuration.drive[joint]
    facts = SetupFacts(parameters, configuration.faults.longest_watchdog_s, configuration.watchdog_endpoints, documents)
    try:
        drive = DRIVE_BENCHES[parameters.type].open_setup(bus.port, facts)
    except ValueError as problem:
        raise ConfigurationError([f"--endpoints: a file {problem}"]) from None
    try:
        found, settings = drive.identify(), drive.settings()
        values, unreadable = read_values(drive, [each.key for each in settings], show)
    except NoAnswerError as problem:
        raise NoAnswerError(f"{joint}: {problem}") from problem
    return JointSetup(joint, bus.name, drive, found, settings, values, unreadable)


def read_values(drive: DriveSetup, keys: Sequence[str], show: Show) -> tuple[dict[str, float], dict[str, str]]:
    """Return the values, and the reasons for those that cannot be read."""
    values, unreadable = {}, {}
    for done, key in enumerate(keys):
        show("settings read", done, len(keys))
        try:
            values[key] = drive.read(key)
        except CannotReadError as problem:
            unreadable[key] = str(problem)
    return values, unreadable


def lines_of(setup: JointSetup) -> Iterator[str]:
    """Yield the drive, its settings as a table, and what cannot be done about them."""
    yield setup.title
    if setup.drive.cannot:
        yield f"  {setup.drive.cannot}"
        return
    rows = [HEAD, *(_row(setup, each) for each in setup.settings)]
    yield from (f"  {line}" for line in table(rows).splitlines())
    for reason in dict.fromkeys(setup.unreadable.values()):
        yield f"  not read: {reason}"
    for each in setup.differing:
        if each.read_only:
            yield f"  {each.key} is never written: {each.read_only}"


def _row(setup: JointSetup, setting: Setting) -> tuple[str, ...]:
    known = setting.key in setup.values
    value = f"{setup.values[setting.key]:.6g}" if known else "-"
    is_range = setting.most - setting.least > abs(setting.wanted) * 0.2
    wanted = f"{setting.least:g} to {setting.most:g}" if is_range else f"{setting.wanted:.6g}"
    mark = "differs" if setting in setup.differing else "" if known else "not read"
    return setting.key, value, wanted, mark, setting.source
