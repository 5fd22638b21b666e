"""What each command of `claims.toml` measured last: `docs/results/NAME.json`, from which the pages take their figures.

A figure is a number, a text or a truth in the JSON of its command. Its name is the path to it, such as
`table/3 cm/48.5/mean`; a row of a list is named by its texts, as `errors/walking, 49.5, k_s, default/median`. A slash
in a name becomes a bar: `rad|s`. A claim names its figures by patterns of paths, each with a tolerance: parts after
commas must all be met.

    exact     the same as before
    0.1       at most that far from the figure before
    5 %       the same, as a fraction of the figure before
    x 1.5     at most that factor larger or smaller than the figure before
    >= 0.97   a bound, whatever the figure was before; also <=
"""

import json
import tomllib
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
ROUNDING = 1e-9
Figure = float | str | bool | None


class InvalidResultError(ValueError):
    """A file of results that cannot be read, or that was edited by hand."""


class Claim(NamedTuple):
    name: str
    command: str  # as a reader types it; it writes files to its working folder, and LOGS is a folder of measured logs
    figures: Mapping[str, str]  # tolerance by pattern of path
    quick: bool = False
    pictures: Mapping[str, str] = {}  # pattern of the written file, by the picture of the documentation


Result = dict[str, Any]  # the whole file: the command, what identifies the run, and the figures


def load_claims(root: Path = ROOT) -> dict[str, Claim]:
    """Return all claims by name."""
    text = (root / "verification" / "claims" / "claims.toml").read_text(encoding="utf-8")
    return {name: Claim(name, **row) for name, row in tomllib.loads(text).items()}


def result_path(name: str, root: Path = ROOT) -> Path:
    return root / "docs" / "results" / f"{name}.json"


def load_result(path: Path) -> Result:
    """Return a result. Raises InvalidResultError, which names the file."""
    again = f"restore it, or delete it and run: make claims ARGS='{path.stem} --rewrite'"
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        digest, written = record.pop("digest"), digest_of(record)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidResultError(f"{path}: cannot be read ({error!r}); {again}") from error
    if digest != written:
        raise InvalidResultError(f"{path}: was edited by hand; {again}")
    result: Result = record
    return result


def load_results(root: Path = ROOT) -> dict[str, Result]:
    """Return all results by name. Raises InvalidResultError."""
    return {path.stem: load_result(path) for path in sorted((root / "docs" / "results").glob("*.json"))}


def write_result(path: Path, record: Mapping[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**record, "digest": digest_of(record)}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def digest_of(record: Mapping[str, Any]) -> str:
    return sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()[:16]


def picture_digests(claim: Claim, root: Path = ROOT) -> dict[str, str]:
    return {each: sha256((root / "docs" / each).read_bytes()).hexdigest()[:16] for each in claim.pictures}


def claimed_figures(claim: Claim, output: Any) -> dict[str, Figure]:
    """Return the claimed figures of a command's JSON by path. Raises ValueError for a pattern without a figure."""
    every = dict(_leaves(output))
    if empty := [each for each in claim.figures if not any(matches(path, each) for path in every)]:
        raise ValueError(f"its JSON has no figure {', '.join(empty)}")
    return {path: figure for path, figure in every.items() if any(matches(path, each) for each in claim.figures)}


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Figure]]:
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = dict(zip(_row_names(value), value, strict=True)).items()
    else:
        yield path, value
        return
    for key, each in items:
        name = key.replace("/", "|")
        yield from _leaves(each, f"{path}/{name}" if path else name)


def _row_names(rows: list[Any]) -> list[str]:
    """Return for each row of a list its texts, or its first value, where these differ; otherwise its position."""
    if all(isinstance(row, dict) and row for row in rows):
        texts = [", ".join(each for each in row.values() if isinstance(each, str)) for row in rows]
        for names in (texts, [str(next(iter(row.values()))) for row in rows]):
            if len(set(names)) == len(rows) and all(names):
                return names
    return [str(position) for position in range(len(rows))]


def matches(path: str, pattern: str) -> bool:
    """Return whether a path matches a pattern, whose stars stand for anything between two slashes."""
    parts, patterns = path.split("/"), pattern.split("/")
    return len(parts) == len(patterns) and all(map(fnmatchcase, parts, patterns))


def tolerance_of(claim: Claim, path: str) -> str:
    """Return the tolerance of a claimed figure: that of the first pattern that matches it, or exact."""
    return next((tolerance for pattern, tolerance in claim.figures.items() if matches(path, pattern)), "exact")


def is_within(old: Figure, new: Figure, tolerance: str) -> bool:
    """Return whether a new figure meets all parts of its tolerance. Raises ValueError for an unknown tolerance."""
    return all(_meets(old, new, part.strip()) for part in tolerance.split(","))


def _meets(old: Figure, new: Figure, part: str) -> bool:
    if part.startswith((">=", "<=")):
        sign = 1.0 if part.startswith(">") else -1.0
        return _is_number(new) and sign * float(new) >= sign * float(part[2:]) - ROUNDING  # type: ignore[arg-type]
    if part == "exact" or not (_is_number(old) and _is_number(new)):
        return old == new
    before, after = float(old), float(new)  # type: ignore[arg-type]
    if part.startswith("x"):
        factor = float(part[1:])
        return before / factor - ROUNDING <= after <= before * factor + ROUNDING
    allowed = float(part[:-1]) / 100.0 * abs(before) if part.endswith("%") else float(part)
    return abs(after - before) <= allowed + ROUNDING


def _is_number(figure: Figure) -> bool:
    return isinstance(figure, int | float) and not isinstance(figure, bool)
