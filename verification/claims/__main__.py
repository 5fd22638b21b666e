"""Runs the commands behind the figures of the documentation again, and reports what drifted: `make claims`.

Each command uses all processors by itself, so they run one after another. What a command printed is kept in
`build/claims`, under the digest of the sources; run again after an interruption, only the rest is measured.
"""

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from experiments.study.provenance import PACKAGES, provenance, source_digest
from verification.claims.pages import pages_of, rewrite_pages
from verification.claims.results import (
    ROOT,
    Claim,
    Figure,
    InvalidResultError,
    claimed_figures,
    is_within,
    load_claims,
    load_result,
    load_results,
    picture_digests,
    result_path,
    tolerance_of,
    write_result,
)

LOGS = "LOGS"
RECORDED = ("version", "sources", "commit", "python", "machine", "date")
NOT_RUN, DRIFTED, INTERRUPTED = 2, 1, 130


def main(arguments: Sequence[str] | None = None, root: Path = ROOT) -> int:
    """Measure, compare, and rewrite where that was asked for. Return 0 only if no figure drifted."""
    options = _options(arguments)
    claims = load_claims(root)
    if unknown := [name for name in options.names if name not in claims]:
        print(f"unknown claim {', '.join(unknown)}; there are: {', '.join(claims)}", file=sys.stderr)
        return NOT_RUN
    chosen = [claims[name] for name in options.names or claims if claims[name].quick or not options.quick]
    if len(os.sched_getaffinity(0)) == 1:
        print("one processor only: this takes about twice the time that is stated")
    try:
        return _check(chosen, options, root)
    except KeyboardInterrupt:
        print("\ninterrupted; what was measured is kept, and the same command continues", file=sys.stderr)
        return INTERRUPTED


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make claims", description="ARGS='NAME ... --option'")
    parser.add_argument("names", nargs="*", metavar="NAME", help="of a claim (default: all)")
    parser.add_argument("--quick", action="store_true", help="only those that CI repeats, three minutes in total")
    parser.add_argument("--rewrite", action="store_true", help="write what was measured to the results and the pages")
    parser.add_argument("--logs", type=Path, metavar="DIR", help="with the 16 measured logs of the accuracy page")
    return parser.parse_args(arguments)


def _check(claims: Sequence[Claim], options: argparse.Namespace, root: Path) -> int:
    problems, began = 0, time.monotonic()
    for number, claim in enumerate(claims):
        print(f"[{number + 1}/{len(claims)}] {claim.name}{_time_left(claims, number, began, root)}", flush=True)
        if LOGS in claim.command.split() and options.logs is None:
            print("  not run: it needs the measured logs, --logs DIR")
            continue
        try:
            problems += not _is_true(claim, options, root)
        except ValueError as error:
            print(f"{claim.name}: {error}", file=sys.stderr)
            problems += 1
    problems += options.rewrite and not _rewrite(root)
    print(f"{len(claims)} claims in {(time.monotonic() - began) / 60.0:.1f} min, {problems} drifted or not measured")
    return DRIFTED if problems else 0


def _rewrite(root: Path) -> bool:
    try:
        print("".join(f"rewritten: {page}\n" for page in rewrite_pages(load_results(root), root)), end="")
    except ValueError as error:
        print(f"no page is rewritten: {error}", file=sys.stderr)
        return False
    return True


def _is_true(claim: Claim, options: argparse.Namespace, root: Path) -> bool:
    """Measure a claim, print what drifted, and rewrite its result where asked for. Raises ValueError."""
    path = result_path(claim.name, root)
    old = load_result(path)["figures"] if path.exists() else {}
    folder = root / "build" / "claims" / f"{claim.name}-{_key(claim)}"
    measured = measure(claim, options.logs, folder, root)
    new = claimed_figures(claim, measured["output"])
    drifts = drifted(claim, old, new)
    for each in drifts if old else []:
        print(f"  drifted: {_drift_text(claim, each, old, new, root)}")
    if options.rewrite:
        _write(claim, measured, new, folder, root)
    elif not old:
        print("  no result yet: --rewrite writes it")
    return options.rewrite or not drifts


def _drift_text(claim: Claim, figure: str, old: Mapping[str, Figure], new: Mapping[str, Figure], root: Path) -> str:
    shown = ", ".join(pages_of(claim.name, figure, root)) or "on no page"
    was, now = old.get(figure, "nothing"), new.get(figure, "nothing")
    return f"{figure} was {was}, is {now} (tolerance: {tolerance_of(claim, figure)}; {shown})"


def _time_left(claims: Sequence[Claim], number: int, began: float, root: Path) -> str:
    """Return the time that is left by the seconds of the results, on a machine that is as fast as it was so far."""
    seconds = [_seconds(result_path(each.name, root)) for each in claims]
    before, after = sum(seconds[:number]), sum(seconds[number:])
    pace = (time.monotonic() - began) / before if before else 1.0
    return f": about {pace * after / 60.0:.0f} min left" if after else ""


def _seconds(path: Path) -> float:
    try:
        return load_result(path)["seconds"] or 0.0
    except InvalidResultError:  # or none yet
        return 0.0


def measure(claim: Claim, logs: Path | None, folder: Path, root: Path) -> Any:
    """Return the `output` of the command and its `seconds`, now or before for the same sources. Raises ValueError."""
    kept = folder / "measured.json"
    if not kept.exists():
        folder.mkdir(parents=True, exist_ok=True)
        began = time.monotonic()
        output = _run(claim, logs, folder, root)
        seconds = time.monotonic() - began
        claimed_figures(claim, output)  # what lacks them, such as the JSON of an error, is not kept
        kept.with_suffix(".part").write_text(json.dumps({"seconds": round(seconds, 1), "output": output}))
        kept.with_suffix(".part").rename(kept)
    return json.loads(kept.read_text())


def _key(claim: Claim) -> str:
    """Return a digest of the command and of all sources of the product; none is left out by a computed import."""
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    modules = (".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in files)
    return sha256(f"{claim.command} {source_digest(*sorted(modules))}".encode()).hexdigest()[:12]


def _run(claim: Claim, logs: Path | None, folder: Path, root: Path) -> Any:
    program, *words = shlex.split(claim.command)
    words = [str(logs and logs.absolute()) if each == LOGS else each for each in words]
    python = Path(sys.executable)
    line = [str(python.with_name(program) if program == "mudskipper" else python), *words, "--json"]
    done = subprocess.run(
        line, cwd=folder, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(root)}
    )
    try:
        return json.loads(done.stdout)
    except ValueError as error:
        raise ValueError(f"exit status {done.returncode} and no JSON from {claim.command} in {folder}") from error


def drifted(claim: Claim, old: Mapping[str, Figure], new: Mapping[str, Figure]) -> list[str]:
    """Return the paths of all figures that left their tolerance, that are new, or that are no longer measured."""
    return [
        path
        for path in {**old, **new}
        if path not in old or path not in new or not is_within(old[path], new[path], tolerance_of(claim, path))
    ]


def _write(claim: Claim, measured: Any, figures: dict[str, Figure], folder: Path, root: Path) -> None:
    record = measured["output"].get("provenance") or provenance("verification.claims.__main__")
    for picture, written in claim.pictures.items():
        shutil.copyfile(next(folder.glob(written)), root / "docs" / picture)
    write_result(
        result_path(claim.name, root),
        {"command": claim.command}
        | {key: record[key] for key in RECORDED}
        | {"seconds": measured["seconds"], "tolerances": dict(claim.figures)}
        | {
            "pictures": picture_digests(claim, root),
            "figures": figures,
        },
    )


if __name__ == "__main__":
    sys.exit(main())
