"""Options of the commands on logs."""

import argparse
from pathlib import Path

from command_line.options.shared import Commands, add, add_config, add_json, add_vertical
from experiments.study.values import folder, mud_length, picture, whole

Parser = argparse.ArgumentParser
METHODS = ("default", "paper")  # of estimation
VIEWERS = ("foxglove", "plotjuggler", "rerun")
COUNT = whole(0, 100000)
MUDS_ALONG = "mud and its length (default: 61), repeatable, in the order of the track"
SEVERAL_FILES = "log of this project; several files are the segments of one run"
ANY_LOG = "log of this project, its segments, or a CSV file of the paper's authors"
FOLDER = "names the folder (default: %(default)s)"


def add_replay(replay: Parser) -> None:
    replay.set_defaults(function="logs.log_commands.replay")
    replay.add_argument("files", type=Path, nargs="+", metavar="FILE", help=ANY_LOG)
    add_json(replay)
    replay.add_argument(
        "--config", type=Path, metavar="FILE", help="use this configuration (default: the one in the log)"
    )
    replay.add_argument("--method", choices=METHODS, help="estimate by this method (default: the configured one)")
    add_vertical(replay)


def add_plot(plot: Parser) -> None:
    plot.set_defaults(function="logs.log_commands.plot")
    plot.add_argument("--out", type=picture(".png", ".svg", ".pdf"), metavar="PNG", help="or .svg, .pdf")
    _add_walk(plot)


def add_film(film: Parser) -> None:
    film.set_defaults(function="logs.log_commands.film")
    film.add_argument("--out", type=picture(".png", ".gif"), metavar="FILE", help=".png for a strip, .gif for a film")
    film.add_argument("--stride", action="append", type=COUNT, metavar="N", help="number in the replay, repeatable")
    _add_walk(film)


def _add_walk(parser: Parser) -> None:
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help=ANY_LOG)
    parser.add_argument("--walk", type=COUNT, default=0, metavar="N", help="number of the walk (default: the last)")
    add_vertical(parser)


def add_log(log: Parser) -> None:
    actions = log.add_subparsers(dest="action", required=True, metavar="action")
    info = add(actions, "info", "logs.log_commands.info", "Print what a log contains.")
    info.add_argument("files", type=Path, nargs="+", metavar="FILE", help=SEVERAL_FILES)
    report = add(actions, "report", "logs.log_report.log_report", "Write a run, or a comparison of runs, as a page.")
    report.add_argument("files", type=Path, nargs="+", metavar="FILE", help=f"{ANY_LOG}; several runs are compared")
    report.add_argument("--out", type=folder, metavar="DIR", help="(default: a folder named after the log)")
    muds = report.add_mutually_exclusive_group()
    muds.add_argument("--mud", type=mud_length, action="append", metavar="NAME[=CM]", help=MUDS_ALONG)
    muds.add_argument("--world", type=Path, metavar="FILE", help="of the simulated robot: names the muds")
    _add_export(actions)
    preserve = add(actions, "preserve", "logs.log_folder_commands.preserve_log", "Exclude logs from the quota.")
    preserve.add_argument("files", type=Path, nargs="+", metavar="FILE", help="log in done/ of a folder of logs")
    preserve.add_argument("--undo", action="store_true", help="include them again")
    _add_catalogue(actions)
    opening = add(actions, "open", "viewers.open_log.open_log", "Open a log in a viewer, with the project's layout.")
    opening.add_argument("file", type=Path, metavar="FILE", help="log of this project")
    opening.add_argument(
        "--with", choices=VIEWERS, required=True, dest="viewer", help="foxglove: Lichtblick or Foxglove"
    )
    listing = add(actions, "list", "logs.log_folder_commands.list_logs", "List the logs and the room that is left.")
    listing.add_argument("folder", type=Path, nargs="?", help="of the logs (default: the configured one)")
    recover = add(actions, "recover", "logs.log_folder_commands.recover", "Repair logs whose writer was interrupted.")
    recover.add_argument("places", type=Path, nargs="*", metavar="FILE|DIR", help="(default: the configured folder)")
    for parser in (listing, recover):
        add_config(parser, FOLDER)
    add_vertical(info)
    add_vertical(report)
    add_json(info, report, listing, recover)


def _add_catalogue(actions: Commands) -> None:
    index = add(actions, "index", "logs.catalogue_commands.index", "Read all new logs of a folder into its catalogue.")
    query = add(actions, "query", "logs.catalogue_commands.query", "Answer a SELECT on the catalogue of the logs.")
    query.add_argument("sql", metavar="SQL", help='such as "select file, strides, speed_m_s from logs"')
    for parser in (index, query):
        parser.add_argument("folder", type=Path, nargs="?", metavar="DIR", help="of the logs (default: the configured)")
        add_config(parser, FOLDER)
    add_json(index, query)


def _add_export(actions: Commands) -> None:
    export = add(actions, "export", "logs.log_export.export", "Write a log in a form that other programs read.")
    export.add_argument("files", type=Path, nargs="+", metavar="FILE", help=SEVERAL_FILES)
    form = export.add_mutually_exclusive_group(required=True)
    form.add_argument("--csv", action="store_true", help="the columns of the authors' plotter, to standard output")
    form.add_argument("--parquet", action="store_true", help="tables of ticks, strides and events, into this folder")
    export.add_argument("--out", type=Path, metavar="PATH", help="write this file, for --parquet into this folder")
