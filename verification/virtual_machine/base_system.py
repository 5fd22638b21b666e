"""The base system of a robot before the installation: Debian 12 with kernel, systemd, Python, and the dependencies.

mmdebstrap makes it from Debian's own packages, as root or with user namespaces. A tar archive stores it until the list
of packages or the project's dependencies change. The guest has no network, so the dependencies are downloaded on the
host, for the guest's Python, and installed from a folder.
"""

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
STORE = PROJECT / ".virtual_machine"
HOST_PACKAGES = {  # Debian package: the program that it brings
    "qemu-system-x86": "qemu-system-x86_64",
    "mmdebstrap": "mmdebstrap",
    "debian-archive-keyring": "",
    "e2fsprogs": "mke2fs",
    "fakeroot": "fakeroot",
}
SUITE = "bookworm"
GUEST_PYTHON = "3.11"
PACKAGES = (
    "linux-image-amd64,initramfs-tools,lz4,kmod,udev,systemd,systemd-sysv,libpam-systemd,dbus,"
    "iproute2,procps,adduser,python3,python3-venv,can-utils"
)
EXCLUDED_PATHS = ("/usr/share/doc/*", "/usr/share/man/*", "/usr/share/locale/*") + tuple(
    f"/lib/modules/*/kernel/{folder}/*"  # two thirds of the kernel's package, for hardware that is not emulated
    for folder in (
        *("sound", "drivers/gpu", "drivers/media", "drivers/staging", "drivers/infiniband", "drivers/scsi"),
        *("drivers/net/wireless", "drivers/net/ethernet", "drivers/usb", "drivers/iio", "drivers/hwmon"),
    )
)
INITRAMFS = {  # no more than reaches the disk: every megabyte of it costs a second of emulation
    "etc/initramfs-tools/conf.d/small": "MODULES=list\nCOMPRESS=lz4\nFSTYPE=ext4\n",
    "etc/initramfs-tools/modules": "virtio_pci\nvirtio_blk\next4\n",
}
REQUIREMENTS = PROJECT / "requirements"
LOCK = "robot.txt"
HASHED = ["--require-hashes", "--only-binary=:all:"]
WHEELS = "/opt/wheels"
PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64")
IN_THE_GUEST = (
    "env -i PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8"
    f' PIP_NO_INDEX=1 PIP_FIND_LINKS={WHEELS} PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore chroot "$1"'
)


class BuildError(Exception):
    """The image cannot be built; the text says why and what to do."""


@cache
def lock_clone() -> int:
    """Wait until no other process uses the disks of this clone; this one does for as long as it lives."""
    descriptor = os.open(PROJECT, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        print("Another 'make test-vm' runs in this clone: waiting for its end ...", file=sys.stderr, flush=True)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    return descriptor


def install_missing_packages() -> None:
    """Install missing host packages, the only installation outside of the project's folder, and print their names."""
    missing = [package for package in HOST_PACKAGES if not _installed(package)]
    if not missing:
        return
    command = ["apt-get", "install", "--yes", "--no-install-recommends", *missing]
    if os.geteuid() != 0:
        command = ["sudo", *command]
    print(f"Installing Debian packages: {' '.join(missing)}", flush=True)
    if shutil.which(command[0]) is None:
        raise BuildError(f"As root: {' '.join(command[1:])}")
    run(command)


def _installed(package: str) -> bool:
    program = HOST_PACKAGES[package]
    return shutil.which(program) is not None if program else Path("/usr/share/keyrings/" + package + ".gpg").exists()


def run(command: Sequence[str | Path]) -> None:
    """Run a command and shows its output only where it fails."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        output = done.stdout.decode(errors="replace")
        raise BuildError(f"{output}\n{command[0]} failed with status {done.returncode}: the last lines above say why.")


def fingerprint(*texts: bytes) -> str:
    digest = hashlib.sha256()
    for text in texts:
        digest.update(hashlib.sha256(text).digest())
    return digest.hexdigest()[:16]


def base_system() -> Path:
    """Return the archive with these packages and dependencies, and builds it where it does not exist."""
    key = fingerprint(
        " ".join([*_debian_command(), *INITRAMFS.values(), *PLATFORMS]).encode(), (REQUIREMENTS / LOCK).read_bytes()
    )
    archive = STORE / f"base-{key}.tar"
    if not archive.exists():
        shutil.rmtree(STORE, ignore_errors=True)
        STORE.mkdir()
        print("Building Debian with the project's dependencies (two minutes) ...", flush=True)
        _fetch_wheels()
        _write_initramfs_settings()
        unfinished = archive.with_suffix(".unfinished")
        run([*_debian_command(), unfinished])
        unfinished.rename(archive)
    return archive


def _fetch_wheels() -> None:
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(STORE / "wheels")]
    command += [*HASHED, "--implementation=cp", f"--python-version={GUEST_PYTHON}"]
    command += [f"--platform={platform}" for platform in PLATFORMS]
    run([*command, "-r", REQUIREMENTS / LOCK])


def _write_initramfs_settings() -> None:
    for name, text in INITRAMFS.items():
        path = STORE / "settings" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _debian_command() -> list[str]:
    command = ["mmdebstrap", "--variant=minbase", "--format=tar", f"--include={PACKAGES}"]
    command += [f"--dpkgopt=path-exclude={pattern}" for pattern in EXCLUDED_PATHS]
    command += [f"--essential-hook=copy-in {STORE / 'settings' / 'etc'} /"]  # before the kernel makes its initramfs
    command += [f"--customize-hook=copy-in {STORE / 'wheels'} /opt"]
    command += [f"--customize-hook={IN_THE_GUEST} python3 -m venv /opt/mudskipper/venv"]
    command += [f"--customize-hook=copy-in {REQUIREMENTS} /opt"]
    locked = f"{' '.join(HASHED)} -r /opt/requirements/{LOCK}"
    command += [f"--customize-hook={IN_THE_GUEST} /opt/mudskipper/venv/bin/pip install {locked}"]
    return [*command, SUITE]
