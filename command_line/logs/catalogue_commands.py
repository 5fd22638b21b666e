"""Commands on the catalogue of many logs: index, query; and its use by `log list`."""

from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any

from command_line import exit_codes
from command_line.errors import usage_error
from command_line.json_output import Answer
from command_line.logs.log_options import Folder
from command_line.robot_options import RobotConfiguration, default_configuration
from command_line.screen import complain, watched
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import table, value_shown
from experiments.study.option import Option
from logs.catalogue.entry import LogEntry
from logs.files.log_error import LogError

LISTING_READS_S = 1.0  # new logs that `log list` reads; it describes the others by the summary at their end


def catalogued(folder: Path) -> dict[Path, LogEntry]:
    """Return the entries of the closed logs; none, with a message, where the catalogue cannot be used."""
    try:
        from logs.catalogue.catalogue import Catalogue  # duckdb is an extra
    except ModuleNotFoundError:
        return {}
    try:
        catalogue = Catalogue(folder)
    except LogError as problem:
        complain(str(problem))
        return {}
    _update(catalogue, LISTING_READS_S)
    return {folder / entry.file: entry for entry in catalogue.entries()}


def _update(catalogue: Any, longest_s: float = inf, broken_again: bool = False) -> bool:
    """Return whether the catalogue is stored; where it is not, this command can use it all the same."""
    try:
        with watched() as watch:
            unread = catalogue.update(watch, longest_s, broken_again)
    except OSError as problem:
        complain(f"the catalogue {catalogue.path} cannot be stored: {problem.strerror or problem}")
        return False
    if unread:
        complain(f"{counted(unread, 'new log')} not in the catalogue yet: 'mudskipper log index' reads them")
    return True


def configured_folder(path: Path) -> Path:
    """Raises CommandError where no folder is named at all."""
    if path == default_configuration() and not path.exists():
        raise usage_error(f"name the folder of the logs: there is no {path} that names one")
    from firmware_host.configuration.loading import load_configuration  # slow to import

    return Path(load_configuration(path).log.directory)


def chosen_folder(named: Path | None, config: Path) -> Path:
    """Return the named folder of logs, or the configured one. Raises LogError where there is no such folder."""
    folder = named or configured_folder(config)
    if not folder.is_dir():
        raise LogError(f"{folder}: there is no such folder")
    return folder


def index(folder: Folder = None, *, config: RobotConfiguration) -> Answer:
    from logs.catalogue.catalogue import Catalogue

    catalogue = Catalogue(chosen_folder(folder, config))
    stored = _update(catalogue, broken_again=True)
    states = [entry.state for entry in catalogue.entries()]
    report = {"catalogue": str(catalogue.path), "logs": len(states), "broken": states.count("broken")}
    text = f"{report['catalogue']}: {counted(len(states), 'log')}, {report['broken']} broken"
    return Answer(report, text, exit_codes.OK if stored else exit_codes.UNHEALTHY, "log-index")


def query(
    sql: Annotated[str, Option('such as "select file, strides, speed_m_s from logs"', metavar="SQL")],
    folder: Folder = None,
    *,
    config: RobotConfiguration,
) -> Answer:
    from logs.catalogue.catalogue import Catalogue

    catalogue = Catalogue(chosen_folder(folder, config))
    _update(catalogue)
    names, rows = catalogue.query(sql)
    report = {"rows": [dict(zip(names, map(_for_json, row), strict=True)) for row in rows]}
    return Answer(report, table([names, *([value_shown(value) for value in row] for row in rows)]), schema="log-query")


def _for_json(value: Any) -> Any:
    """Return numbers, texts, lists and structures as JSON has them, and times and other values of SQL as text."""
    if isinstance(value, dict):
        return {str(key): _for_json(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_for_json(each) for each in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value if isinstance(value, str | int | float | None) else str(value)
