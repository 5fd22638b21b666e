"""The disk of a robot: the base system, with the project installed by the commands of docs/how-to/install.md.

They run in the disk's folder while no systemd runs there. `systemctl enable` works in that state. `true` replaces the
commands that ask a running system to reload (udevadm, networkctl), because the first boot loads everything.
"""

import shutil
import subprocess
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from verification.virtual_machine.base_system import (
    IN_THE_GUEST,
    PROJECT,
    STORE,
    BuildError,
    base_system,
    fingerprint,
    install_missing_packages,
    lock_clone,
    run,
)

GUEST_FILES = Path(__file__).parent / "guest"
GUIDE = "docs/how-to/install.md"
HEADINGS = ("## On the robot", "## Without CAN hardware")  # of the guide, whose commands are run
DONE_ALREADY = ("apt install", "git clone")  # by base_system.py, and by a copy of this working tree
NEEDS_A_RUNNING_ROBOT = ("systemctl status", "mudskipper ")
DISK_MIB = 2000


class Disk(NamedTuple):
    image: Path
    kernel: Path
    initramfs: Path


def installed_robot(name: str = "robot", last_commands: str = "") -> Disk:
    """Return a disk that was never booted; copy it before booting. `last_commands` follow those of the guide."""
    lock_clone()
    install_missing_packages()
    archive = base_system()
    disk = Disk(STORE / f"{name}.ext4", STORE / "kernel", STORE / "initramfs")
    key, mark = fingerprint(_key(archive).encode(), last_commands.encode()), STORE / f"{name}.key"
    if not mark.exists() or mark.read_text(encoding="utf-8") != key:
        print("Installing the project by the guide's commands (half a minute) ...", flush=True)
        mark.unlink(missing_ok=True)
        _make_disk(archive, disk, last_commands)
        mark.write_text(key, encoding="utf-8")
    return disk


def _key(archive: Path) -> str:
    return fingerprint(archive.name.encode(), *(path.read_bytes() for path in _project_files()))


def _project_files() -> list[Path]:
    """Return the files that git tracks or would add: the working tree without build products."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=PROJECT, check=True, capture_output=True, text=True).stdout
    paths = (PROJECT / name for name in sorted(names.split("\0")) if name)
    return [path for path in paths if path.is_file()]


def _make_disk(archive: Path, disk: Disk, last_commands: str) -> None:
    work = STORE / "work"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    with tarfile.open(work / "src.tar", "w") as source:
        for path in _project_files():
            source.add(path, str(Path("opt/mudskipper/src") / path.relative_to(PROJECT)), filter=_owned_by_root)
    (work / "install.sh").write_text(installation() + last_commands, encoding="utf-8")
    _install(archive, work)
    _write_image(work, disk)
    shutil.rmtree(work, ignore_errors=True)


def _owned_by_root(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid = member.gid = 0
    member.uname = member.gname = "root"
    return member


def installation() -> str:
    """Return the script that runs in the disk's folder."""
    lines = [line for heading in HEADINGS for line in _guide_commands(heading)]
    wanted = [line for line in lines if not line.startswith((*DONE_ALREADY, *NEEDS_A_RUNNING_ROBOT))]
    before = (GUEST_FILES / "before_installation.sh").read_text(encoding="utf-8")
    after = (GUEST_FILES / "after_installation.sh").read_text(encoding="utf-8")
    # `&&` inside a line must not hide a failure: sh -e does not stop for the first part of one.
    checked = [f"{{ {line.split('  #')[0]}; }} || {{ echo 'guide: {line}' >&2; exit 1; }}" for line in wanted]
    return "\n".join(["set -eu", before, "cd /opt/mudskipper/src/systemd", *checked, after, ""])


def _guide_commands(heading: str) -> Iterator[str]:
    """Yield the lines of the first shell block below a heading."""
    _, found, below = (PROJECT / GUIDE).read_text(encoding="utf-8").partition(f"\n{heading}\n")
    _, opening, rest = below.partition("```sh\n")
    if not found or not opening:
        raise BuildError(f"{GUIDE} has no commands below {heading!r}: the image is installed by them.")
    yield from (line for line in rest.partition("```")[0].splitlines() if line.strip())


def _install(archive: Path, work: Path) -> None:
    steps = "update,setup,download/empty,extract/empty,run/empty,install/empty,cleanup"
    command = ["mmdebstrap", "--variant=custom", "--format=tar", f"--skip={steps}"]
    command += [f"--setup-hook=tar-in {archive} /"]
    command += [f"--customize-hook=tar-in {work / 'src.tar'} /"]
    command += [f"--customize-hook=upload {work / 'install.sh'} /root/install.sh"]
    command += [f"--customize-hook={IN_THE_GUEST} sh /root/install.sh"]
    run([*command, "", work / "robot.tar"])


def _write_image(work: Path, disk: Disk) -> None:
    """mke2fs fills the file system from a folder; fakeroot keeps its owners without root."""
    folder = work / "root"
    script = (
        f"mkdir {folder} && tar --extract --file={work / 'robot.tar'} --directory={folder}"
        f" && rm -f {disk.image} && mke2fs -q -t ext4 -L robot -d {folder} {disk.image} {DISK_MIB}M"
        f" && cp {folder}/boot/vmlinuz-* {disk.kernel} && cp {folder}/boot/initrd.img-* {disk.initramfs}"
        f" && rm -rf {folder}"
    )
    run(["fakeroot", "sh", "-c", script])


def main() -> int:
    try:
        installed_robot()
    except BuildError as problem:
        print(problem, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
