"""`mudskipper status`: prints the state of the robot."""

from command_line import exit_codes
from command_line.json_output import Answer
from command_line.robot_text import (
    MODE_STYLES,
    WARNING,
    Part,
    Report,
    cause_text,
    consequences_text,
    drive_cells,
    machine_lines,
    mode_word,
    notices,
    plain,
    position_text,
    quota_text,
    stride_text,
    style_of,
    unheard_text,
)
from command_line.shared_options import Socket
from experiments.reports.text_tables import table
from operator_client.status_client import StatusClient


def status(*, socket: Socket) -> Answer:
    with StatusClient(socket) as client:
        report = client.call("status")
    failed = report["mode"] in ("fault", "damping")
    return Answer(report, status_text(report), exit_codes.UNHEALTHY if failed else exit_codes.OK)


def status_text(report: Report) -> str:
    style = MODE_STYLES.get(mode_word(report), "bold")
    position = f"{stride_text(report)}, {position_text(report)}"
    parts: list[Part] = [(f"{report['robot']}: ", ""), (mode_word(report), style), (f", {position}\n", "")]
    if report["mode"] == "boot":
        parts.append((f"{unheard_text(report) or 'every drive was heard'}\n", WARNING))
    parts += [(_cause_lines(cause), style_of(cause)) for cause in report["causes"]]
    parts += [(f"warning: {notice}\n", WARNING) for notice in notices(report)]
    drives = [{head: cell for head, (cell, _) in drive_cells(drive).items()} for drive in report["drives"]]
    parts.append((f"\n{table([list(drives[0]), *(list(drive.values()) for drive in drives)])}\n", ""))
    for name, (text, style) in [*machine_lines(report), *_ground_lines(report)]:
        parts += [(f"\n{name:7}", ""), (text, style)]
    if (log := report["log"])["path"]:
        parts.append((f"\nquota  {quota_text(log['quota_bytes'], log['min_free_fraction'])}", ""))
    return plain(parts)


def _ground_lines(report: Report) -> list[tuple[str, Part]]:
    """Return which law the ground follows, once strides show it."""
    law = report["mud"]["law"]
    if not law:
        return []
    wrong = " and ".join(f"{name} by {100.0 * error:.0f} %" for name, error in law["errors"].items())
    return [("ground", (f"{law['name']}: each coefficient is predicted wrong from the others, as {wrong}", ""))]


def _cause_lines(cause: Report) -> str:
    consequences = consequences_text(cause)
    lines = [cause_text(cause), *filter(None, [consequences and f"    and {consequences}"])]
    return "\n".join([*lines, f"    -> {cause['what_to_do']}\n"])
