"""Plans the installation or removal of the robot's service: lists the steps without doing them.

A step writes a file, makes a link, removes a file or runs a command; its text is printed before it is done.

A file that its owner has edited is never overwritten: the new version is written next to it as NAME.new, once. A file
counts as edited where its digest differs from the one in the manifest of the last installation. The manifest is
written last, so an interrupted installation is repeated. The configuration always counts as edited.
"""

import json
import re
import shlex
import sysconfig
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from command_line import exit_codes
from command_line.errors import CommandError
from firmware_host.configuration.service_file import CONFIGURATION, UNIT, service_configuration
from firmware_host.sockets.user_groups import VIEWERS

DEFAULT_PREFIX = "/opt/mudskipper/venv"  # in the unit
MANIFEST = "etc/mudskipper/.installed.json"
LINKS = ("usr/local/bin/mudskipper", "usr/local/bin/mudskipperd")
DEVICE = "sys-subsystem-net-devices-{}.device"
DEFAULT_DEVICES = f"{DEVICE.format('can0')} {DEVICE.format('can1')}"  # in the unit
INTERFACE = re.compile(r"[\w.-]+", re.ASCII)  # a name that needs no quotes in a unit
NOT_SAID = (ValueError, LookupError, TypeError, AttributeError)  # by a configuration that makes no sense
UDEV_DEVICES = ("net/can0", "net/can1", "misc/cpu_dma_latency")  # below /sys/class
SERVICE, LIVE_SERVICE = "mudskipper", "mudskipper-live"
NETWORKD, WAIT_ONLINE = "systemd-networkd", "systemd-networkd-wait-online"
SYSUSERS = "etc/sysusers.d/mudskipper.conf"
LINK_FILE = "etc/systemd/network/80-can.link"
RULES = "etc/udev/rules.d/70-mudskipper-cpu.rules"
NETWORK = "etc/systemd/network/80-can.network"
LIVE_UNIT = "etc/systemd/system/mudskipper-live.service"  # not enabled by the installation
SOURCES = {  # name in systemd/ by installed path
    SYSUSERS: "mudskipper.sysusers",
    **{path: path.rpartition("/")[2] for path in (RULES, LINK_FILE, NETWORK, UNIT, LIVE_UNIT, CONFIGURATION)},
}
OWNED = ("etc/mudskipper", "var/lib/mudskipper")  # folders that a purge removes


class Outcome(NamedTuple):
    status: int
    text: str


Run = Callable[[Sequence[str]], Outcome]


class WriteFile(NamedTuple):
    path: Path
    text: str

    def __str__(self) -> str:
        return f"write {self.path}"


class MakeLink(NamedTuple):
    path: Path
    target: Path

    def __str__(self) -> str:
        return f"link {self.path} to {self.target}"


class Remove(NamedTuple):
    path: Path

    def __str__(self) -> str:
        return f"remove {self.path}{'/' if self.path.is_dir() else ''}"


class Command(NamedTuple):
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"run {shlex.join(self.words)}"


Step = WriteFile | MakeLink | Remove | Command


class Plan(NamedTuple):
    steps: list[Step]
    notes: list[str]


class System(NamedTuple):
    """This computer, or the file tree of another one."""

    root: Path
    prefix: Path  # of the environment, as that system sees it
    run: Run
    live: bool  # whether it is this computer

    def command(self, program: str, *words: str) -> Command:
        return Command((program, *(() if self.live else (f"--root={self.root}",)), *words))

    def is_enabled(self, unit: str) -> bool:
        return self.run(self.command("systemctl", "is-enabled", unit).words).text.strip() == "enabled"


def source_folder() -> Path:
    """Return systemd/ of a working tree, or the environment's share/ where the package is installed."""
    in_tree = Path(__file__).resolve().parents[2] / "systemd"
    installed = Path(sysconfig.get_path("data")) / "share" / "mudskipper"
    return in_tree if (in_tree / "mudskipper.service").exists() else installed


def load_sources(prefix: Path, folder: Path | None = None, configuration: str = "") -> dict[str, str]:
    """Return the text of each file by its installed path, of this version or from another folder. Raises OSError.

    The unit waits for the CAN interfaces of this configuration, or for the default ones where it cannot be read.
    """
    texts = {path: ((folder or source_folder()) / name).read_text(encoding="utf-8") for path, name in SOURCES.items()}
    for unit in (UNIT, LIVE_UNIT):
        texts[unit] = texts[unit].replace(DEFAULT_PREFIX, str(prefix))
    with suppress(*NOT_SAID):
        texts[UNIT] = _bound_to(_interfaces(tomllib.loads(configuration)), texts[UNIT])
    return texts


def require_interfaces(path: Path) -> None:
    """Raise CommandError where a configuration does not say for which interfaces the unit waits."""
    with suppress(FileNotFoundError):
        text = path.read_text(encoding="utf-8", errors="replace")
        try:
            _interfaces(tomllib.loads(text))
        except NOT_SAID:
            refusal = f"{path} does not say which buses the service waits for: 'mudskipperd --check-config' says why"
            raise CommandError(refusal, status=exit_codes.CONFIGURATION) from None


def _interfaces(configuration: dict[str, Any]) -> list[str]:
    """Return the network interfaces that the daemon needs at its start."""
    if configuration.get("loop", {}).get("wait_for_bus", False):
        return []
    buses = configuration["bus"].values()
    return [bus["channel"] for bus in buses if bus["interface"] == "socketcan" and INTERFACE.fullmatch(bus["channel"])]


def _bound_to(interfaces: Sequence[str], unit: str) -> str:
    devices = " ".join(DEVICE.format(name.replace("-", r"\x2d")) for name in interfaces)
    lines = unit.replace(DEFAULT_DEVICES, devices).splitlines(keepends=True)
    return "".join(line for line in lines if line.strip() not in ("BindsTo=", "WantedBy="))


def plan_installation(system: System, folder: Path | None = None) -> Plan:
    """Plan with the files of this version, or of one in another folder."""
    configuration = _text_of(service_configuration(system.root))
    sources, before = load_sources(system.prefix, folder, configuration), _load_manifest(system.root)
    after = {path: _digest(text) for path, text in sources.items()}
    plan = Plan([], [])
    for path, text in sources.items():
        _plan_file(plan, system.root / path, text, before.get(path))
    for link in LINKS:
        _plan_link(plan, system, link)
    written = {step.path for step in plan.steps if isinstance(step, WriteFile)}  # also one that was deleted
    changed = {path for path in after if before.get(path) != after[path] or system.root / path in written}
    is_new = UNIT not in before or not (system.root / LINKS[0]).is_symlink()  # an edited unit survives a removal
    plan.steps.extend(_commands(system, changed, is_new))
    if before != after:
        plan.steps.append(WriteFile(system.root / MANIFEST, json.dumps(after, indent=1) + "\n"))
    if UNIT in changed and before:
        plan.notes.append("restart it with the robot disarmed: systemctl restart mudskipper")
    return plan


def _plan_file(plan: Plan, path: Path, text: str, before: str | None) -> None:
    """`before` is the digest of the text that was installed last."""
    exists = path.exists() or path.is_symlink()
    present, new = _digest(_text_of(path)), _digest(text)
    edited = path.is_symlink() or present != before or path.name == Path(CONFIGURATION).name
    if not exists or (present != new and not edited):
        plan.steps.append(WriteFile(path, text))
    elif present != new and before != new:
        newer = path.with_name(f"{path.name}.new")
        plan.notes.append(f"{path} was edited and stays; the new version is in {newer.name} next to it")
        if _text_of(newer) != text:
            plan.steps.append(WriteFile(newer, text))


def _plan_link(plan: Plan, system: System, link: str) -> None:
    path, target = system.root / link, _target(system, link)
    if path.is_symlink() and path.readlink() == target:
        return
    if path.exists() and not path.is_symlink():
        plan.notes.append(f"{path} belongs to other software and stays")
    else:
        plan.steps.append(MakeLink(path, target))


def _target(system: System, link: str) -> Path:
    return system.prefix / "bin" / Path(link).name


def _commands(system: System, changed: set[str], is_new: bool) -> Iterator[Step]:
    """Only a new installation enables services: an upgrade leaves disabled what the operator has disabled."""
    live = system.live
    if SYSUSERS in changed:
        yield system.command("systemd-sysusers")
    if changed & {UNIT, LIVE_UNIT} and live:
        yield Command(("systemctl", "daemon-reload"))
    if changed & {LINK_FILE, RULES} and live:
        yield Command(("udevadm", "control", "--reload"))
        devices = [system.root / "sys/class" / name for name in UDEV_DEVICES]
        present = [str(device) for device in devices if device.exists()]
        if present:
            yield Command(("udevadm", "trigger", "--action=add", *present))
    if is_new and not system.is_enabled(NETWORKD):
        yield system.command("systemctl", "enable", *(("--now",) if live else ()), NETWORKD)
        yield system.command("systemctl", "disable", WAIT_ONLINE)  # a CAN bus is never online; the boot would hang
    if NETWORK in changed and live:
        yield Command(("networkctl", "reload"))
    if is_new and not system.is_enabled(SERVICE):
        yield system.command("systemctl", "enable", SERVICE)
    elif UNIT in changed and system.is_enabled(SERVICE):
        yield system.command("systemctl", "reenable", SERVICE)  # its interfaces may be others


def plan_removal(system: System, purge: bool) -> Plan:
    """Also removes files that were copied without this command, where they are unchanged."""
    root, plan, before = system.root, Plan([], []), _load_manifest(system.root)
    for service in (SERVICE, LIVE_SERVICE):
        query = ("systemctl", "is-active", service)
        if system.is_enabled(service) or (system.live and system.run(query).text.strip() == "active"):
            now = ("--now",) if system.live else ()
            plan.steps.append(system.command("systemctl", "disable", *now, service))
    for path, text in load_sources(system.prefix, configuration=_text_of(service_configuration(root))).items():
        _plan_removal_of(plan, root / path, {_digest(text), before.get(path)}, purge)
    for link in LINKS:
        if (root / link).is_symlink() and (root / link).readlink() == _target(system, link):
            plan.steps.append(Remove(root / link))
    removed = {step.path for step in plan.steps if isinstance(step, Remove)}
    for paths, command in (((UNIT, LIVE_UNIT), ("systemctl", "daemon-reload")), ((NETWORK,), ("networkctl", "reload"))):
        if system.live and any(root / path in removed for path in paths):
            plan.steps.append(Command(command))
    if purge:
        plan.steps.extend(Remove(root / path) for path in OWNED if (root / path).exists())
        for program, name, file in (("groupdel", VIEWERS, "etc/group"), ("userdel", SERVICE, "etc/passwd")):
            names = {line.partition(":")[0] for line in _text_of(root / file).splitlines()}
            if system.live and name in names:
                plan.steps.append(Command((program, name)))
    else:
        _plan_manifest(plan, root, removed, before)
    return plan


def _plan_removal_of(plan: Plan, path: Path, known_digests: set[str | None], purge: bool) -> None:
    newer = path.with_name(f"{path.name}.new")
    if newer.exists():
        plan.steps.append(Remove(newer))
    if not path.exists() or path.name == Path(CONFIGURATION).name:
        return  # only a purge removes the configuration, together with its folder
    if purge or _digest(_text_of(path)) in known_digests:
        plan.steps.append(Remove(path))
    else:
        plan.notes.append(f"{path} was edited and stays; --purge removes it")


def _plan_manifest(plan: Plan, root: Path, removed: set[Path], before: dict[str, str]) -> None:
    """Keep the digests of the files that stay."""
    left = {path: digest for path, digest in before.items() if (root / path).exists() and root / path not in removed}
    if left != before:
        plan.steps.append(WriteFile(root / MANIFEST, json.dumps(left, indent=1) + "\n"))
    staying = [str(root / path) for path in OWNED if (root / path).exists()]
    if staying:
        plan.notes.append(f"{', '.join(staying)}: stays; --purge removes it")


def _load_manifest(root: Path) -> dict[str, str]:
    with suppress(ValueError):
        manifest = json.loads(_text_of(root / MANIFEST))
        if isinstance(manifest, dict):
            return {str(path): str(digest) for path, digest in manifest.items()}
    return {}


def _text_of(path: Path) -> str:
    """Return the text of a file, empty where it is missing."""
    with suppress(FileNotFoundError):
        return path.read_text(encoding="utf-8", errors="replace")
    return ""


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()
