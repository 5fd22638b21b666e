"""What has to be done to a system so that the robot's service is on it, or no longer: computed, not done.

A file of ours that its owner has edited is never overwritten: the new one is put beside it as .new, once. Whether it
was edited is seen by its digest, which the last installation has left in a manifest. The manifest is written last, so
an installation that broke off is done again. The configuration counts as edited from the first day.
"""

from __future__ import annotations

import json
import sysconfig
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from command_line.install.service_steps import Command, MakeLink, Remove, Run, Step, WriteFile

DEFAULT_PREFIX = "/opt/mudskipper/venv"  # in the unit
MANIFEST = "etc/mudskipper/.installed.json"
LINK = "usr/local/bin/mudskipper"
INTERFACES = ("can0", "can1")
SERVICE, NETWORKD, WAIT_ONLINE = "mudskipper", "systemd-networkd", "systemd-networkd-wait-online"
SYSUSERS, LINK_FILE, NETWORK, UNIT, CONFIGURATION = (
    "etc/sysusers.d/mudskipper.conf",
    "etc/systemd/network/80-can.link",
    "etc/systemd/network/80-can.network",
    "etc/systemd/system/mudskipper.service",
    "etc/mudskipper/mudskipper.toml",
)
SOURCES = {  # in systemd/
    SYSUSERS: "mudskipper.sysusers",
    LINK_FILE: "80-can.link",
    NETWORK: "80-can.network",
    UNIT: "mudskipper.service",
    CONFIGURATION: "mudskipper.toml",
}
OWNED = ("etc/mudskipper", "var/lib/mudskipper")  # what a purge removes


class Plan(NamedTuple):
    steps: list[Step]
    notes: list[str]


class System(NamedTuple):
    """The computer, or another system's files."""

    root: Path
    prefix: Path  # of the environment, as that system sees it
    run: Run
    live: bool  # the one that runs here

    def command(self, program: str, *words: str) -> Command:
        where = () if self.live else (f"--root={self.root}",)
        return Command((program, *where, *words))

    def is_enabled(self, unit: str) -> bool:
        return self.run(self.command("systemctl", "is-enabled", unit).words).text.strip() == "enabled"

    def is_active(self, unit: str) -> bool:
        return self.live and self.run(("systemctl", "is-active", unit)).text.strip() == "active"


def source_folder() -> Path:
    """Beside the packages in a working tree, in the environment's share/ where they are installed."""
    beside = Path(__file__).resolve().parents[2] / "systemd"
    if (beside / "mudskipper.service").exists():
        return beside
    return Path(sysconfig.get_path("data")) / "share" / "mudskipper"


def load_sources(prefix: Path) -> dict[str, str]:
    """The text of each file, by its place. Raises OSError."""
    texts = {place: (source_folder() / name).read_text(encoding="utf-8") for place, name in SOURCES.items()}
    texts[UNIT] = texts[UNIT].replace(DEFAULT_PREFIX, str(prefix))
    return texts


def plan_installation(system: System) -> Plan:
    sources, before = load_sources(system.prefix), _load_manifest(system.root)
    after = {place: _digest(text) for place, text in sources.items()}
    plan = Plan([], [])
    for place, text in sources.items():
        _plan_file(plan, system.root / place, text, before.get(place))
    _plan_link(plan, system)
    changed = {place for place in after if before.get(place) != after[place]}
    plan.steps.extend(_commands(system, changed))
    if before != after:
        plan.steps.append(WriteFile(system.root / MANIFEST, json.dumps(after, indent=1) + "\n"))
    if UNIT in changed and before:
        plan.notes.append("restart it with the robot disarmed: systemctl restart mudskipper")
    return plan


def _plan_file(plan: Plan, path: Path, text: str, before: str | None) -> None:
    """`before` is the digest of what was installed last."""
    if not path.exists() and not path.is_symlink():
        plan.steps.append(WriteFile(path, text))
        return
    present, new = _digest(_text_of(path)), _digest(text)
    if present == new:
        return
    edited = path.is_symlink() or present != before or path.name == Path(CONFIGURATION).name
    if not edited:
        plan.steps.append(WriteFile(path, text))
    elif before != new:
        beside = path.with_name(f"{path.name}.new")
        plan.notes.append(f"{path} stays as it is; what is new is in {beside.name} beside it")
        if _text_of(beside) != text:
            plan.steps.append(WriteFile(beside, text))


def _plan_link(plan: Plan, system: System) -> None:
    path, target = system.root / LINK, system.prefix / "bin" / "mudskipper"
    if path.is_symlink() and path.readlink() == target:
        return
    if path.exists() and not path.is_symlink():
        plan.notes.append(f"{path} is none of ours and stays as it is")
    else:
        plan.steps.append(MakeLink(path, target))


def _commands(system: System, changed: set[str]) -> Iterator[Step]:
    live = system.live
    if SYSUSERS in changed:
        yield system.command("systemd-sysusers")
    if UNIT in changed and live:
        yield Command(("systemctl", "daemon-reload"))
    if LINK_FILE in changed and live:
        yield Command(("udevadm", "control", "--reload"))
        places = [system.root / "sys/class/net" / name for name in INTERFACES]
        present = [str(place) for place in places if place.exists()]
        if present:
            yield Command(("udevadm", "trigger", "--action=add", *present))
    if not system.is_enabled(NETWORKD):
        yield system.command("systemctl", "enable", *(("--now",) if live else ()), NETWORKD)
        yield system.command("systemctl", "disable", WAIT_ONLINE)  # a CAN bus is never online; the boot would hang
    if NETWORK in changed and live:
        yield Command(("networkctl", "reload"))
    if not system.is_enabled(SERVICE):
        yield system.command("systemctl", "enable", SERVICE)


def plan_removal(system: System, purge: bool) -> Plan:
    """Also of files that were installed by hand, as far as they are ours to the letter."""
    root, plan, before = system.root, Plan([], []), _load_manifest(system.root)
    sources = load_sources(system.prefix)
    if system.is_enabled(SERVICE) or system.is_active(SERVICE):
        now = ("--now",) if system.live else ()
        plan.steps.append(system.command("systemctl", "disable", *now, SERVICE))
    for place, text in sources.items():
        _plan_removal_of(plan, root / place, {_digest(text), before.get(place)}, purge)
    link = root / LINK
    if link.is_symlink() and link.readlink() == system.prefix / "bin" / "mudskipper":
        plan.steps.append(Remove(link))
    _plan_reloading(plan, system)
    if purge:
        plan.steps.extend(Remove(root / place) for place in OWNED if (root / place).exists())
        if system.live and SERVICE in _users(root):
            plan.steps.append(Command(("userdel", SERVICE)))
    else:
        _plan_manifest(plan, root, before)
    return plan


def _plan_removal_of(plan: Plan, path: Path, ours: set[str | None], purge: bool) -> None:
    beside = path.with_name(f"{path.name}.new")
    if beside.exists():
        plan.steps.append(Remove(beside))
    if not path.exists() or path.name == Path(CONFIGURATION).name:
        return  # the configuration goes with its folder, if at all
    if purge or _digest(_text_of(path)) in ours:
        plan.steps.append(Remove(path))
    else:
        plan.notes.append(f"{path} was edited and stays; --purge removes it")


def _plan_reloading(plan: Plan, system: System) -> None:
    removed = {step.path for step in plan.steps if isinstance(step, Remove)}
    if system.live and system.root / UNIT in removed:
        plan.steps.append(Command(("systemctl", "daemon-reload")))
    if system.live and system.root / NETWORK in removed:
        plan.steps.append(Command(("networkctl", "reload")))


def _plan_manifest(plan: Plan, root: Path, before: dict[str, str]) -> None:
    """It remembers the configuration alone, and what else stays."""
    removed = {step.path for step in plan.steps if isinstance(step, Remove)}
    left = {
        place: digest for place, digest in before.items() if root / place not in removed and (root / place).exists()
    }
    if left != before:
        plan.steps.append(WriteFile(root / MANIFEST, json.dumps(left, indent=1) + "\n"))
    kept = [str(root / place) for place in OWNED if (root / place).exists()]
    if kept:
        plan.notes.append(f"kept, as long as you do not say --purge: {', '.join(kept)}")


def _users(root: Path) -> set[str]:
    return {line.partition(":")[0] for line in _text_of(root / "etc/passwd").splitlines()}


def _load_manifest(root: Path) -> dict[str, str]:
    with suppress(ValueError):
        reported = json.loads(_text_of(root / MANIFEST))
        if isinstance(reported, dict):
            return {str(place): str(digest) for place, digest in reported.items()}
    return {}


def _text_of(path: Path) -> str:
    """Empty where there is none."""
    with suppress(FileNotFoundError):
        return path.read_text(encoding="utf-8", errors="replace")
    return ""


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()
