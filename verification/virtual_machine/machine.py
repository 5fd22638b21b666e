"""A virtual machine that boots a copy of a robot's disk: commands go in over a virtio port, their answers come out.

QEMU emulates one processor. With KVM the guest runs in real time. Without it the guest's clock counts executed
instructions (`-icount`): it stops while the emulator works and jumps ahead while the guest waits (`sleep=off`), so the
guest is as punctual as a robot's computer on a busy machine too. One instruction per nanosecond is QEMU's fastest
rate, and too slow for the loop and a simulated robot on one processor. The kernel is therefore given 3 GHz as the rate
of a time stamp counter that runs at 1 GHz, and a second of the guest has three times the instructions. Checks of
durations run inside the guest; time-outs on the host only end a hanging run.
"""

import base64
import json
import os
import shlex
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from verification.virtual_machine.installed_robot import Disk

BOOT_S = 600.0
SLOWEST = 60.0  # times that the guest's clock may run slower than the wall's
MEMORY_MIB = 768
PROBE_S = 20.0
KERNEL_OPTIONS = "root=/dev/vda rw console=ttyS0 quiet panic=-1 mitigations=off audit=0"
COUNTED_CLOCK = ("-icount", "shift=0,sleep=off")
STRETCHED_CLOCK = "tsc_early_khz=3000000 tsc=reliable"


class MachineError(Exception):
    """The machine does not boot or answer; the text ends with its last output."""


class Answer(NamedTuple):
    status: int
    output: str
    errors: str


class Machine:
    """Owns the QEMU process, its disk and the connection; the disk outlives a cut of the power."""

    def __init__(self, disk: Disk) -> None:
        self._kernel, self._initramfs = disk.kernel, disk.initramfs
        self._folder = Path(tempfile.mkdtemp(prefix="mud-vm-"))
        self._image = disk.image.with_name(self._folder.name)
        subprocess.run(["cp", "--sparse=always", disk.image, self._image], check=True)
        self._accelerator = "kvm" if _kvm_works(self._kernel) else "tcg"
        self._qemu: subprocess.Popen[bytes] | None = None
        self._connection: socket.socket | None = None
        self._received = b""

    def boot(self) -> None:
        """Boot, and return when the guest takes commands."""
        port = self._folder / "commands"
        port.unlink(missing_ok=True)
        with (self._folder / "console").open("ab") as console:
            self._qemu = subprocess.Popen(self._command(port), stdin=subprocess.DEVNULL, stdout=console, stderr=console)
        deadline_s = time.monotonic() + BOOT_S
        self._connection = socket.socket(socket.AF_UNIX)
        while not port.exists() and time.monotonic() < deadline_s and self._qemu.poll() is None:
            time.sleep(0.05)
        self._connection.connect(str(port))
        self._receive(deadline_s)

    def _command(self, port: Path) -> list[str]:
        command = [*_bare_machine(self._accelerator, self._kernel), "-initrd", str(self._initramfs)]
        emulated = self._accelerator == "tcg"
        command += ["-append", f"{KERNEL_OPTIONS} {STRETCHED_CLOCK if emulated else ''}"]
        command += ["-serial", "stdio", "-device", "virtio-serial"]
        command += ["-object", "can-bus,id=bus", *("-device", "kvaser_pci,canbus=bus") * 2]  # can0, can1
        command += ["-drive", f"file={self._image},if=virtio,format=raw"]
        command += ["-chardev", f"socket,id=commands,path={port},server=on,wait=off"]
        command += ["-device", "virtserialport,chardev=commands,name=commands"]
        return [*command, *(COUNTED_CLOCK if emulated else ())]

    def run(self, command: str, user: str = "", longest_s: float = 30.0) -> Answer:
        """Run a command as root, or as `user` in a new login, for at most `longest_s` of the guest's time."""
        if user:
            command = f"runuser --login {user} --command {shlex.quote(command)}"
        assert self._connection is not None
        self._connection.sendall(json.dumps({"command": command, "longest_s": longest_s}).encode() + b"\n")
        answer = self._receive(time.monotonic() + SLOWEST * longest_s)
        return Answer(int(answer["status"]), str(answer["output"]), str(answer["errors"]))

    def read(self, path: str) -> bytes:
        """Read a file of the guest."""
        answer = self.run(f"base64 {shlex.quote(path)}", longest_s=60.0)
        if answer.status != 0:
            raise MachineError(answer.errors)
        return base64.b64decode(answer.output)

    def _receive(self, deadline_s: float) -> dict[str, int | str]:
        """The next line. Raises MachineError where the machine ends or says nothing for too long."""
        assert self._connection is not None and self._qemu is not None
        while b"\n" not in self._received:
            self._connection.settimeout(max(deadline_s - time.monotonic(), 0.001))
            try:
                part = self._connection.recv(1 << 20)
            except OSError as problem:
                raise MachineError(f"no answer ({problem}):\n{self.last_words()}") from problem
            if not part:
                raise MachineError(f"the virtual machine has ended:\n{self.last_words()}")
            self._received += part
        line, _, self._received = self._received.partition(b"\n")
        answer: dict[str, int | str] = json.loads(line)
        return answer

    def last_words(self) -> str:
        return (self._folder / "console").read_text(encoding="utf-8", errors="replace")[-4000:]

    def cut_power(self) -> None:
        """At once: what the guest's kernel has not written to the disk yet is lost."""
        if self._qemu is not None:
            self._qemu.kill()
            self._qemu.wait()
        if self._connection is not None:
            self._connection.close()
        self._qemu, self._connection, self._received = None, None, b""

    def close(self) -> None:
        self.cut_power()
        self._image.unlink(missing_ok=True)
        shutil.rmtree(self._folder, ignore_errors=True)


def _bare_machine(accelerator: str, kernel: Path) -> list[str]:
    command = ["setpriv", "--pdeathsig", "KILL"]  # no machine outlives its tests
    command += ["qemu-system-x86_64", "-machine", "q35", "-accel", accelerator, "-cpu", "max", "-smp", "1"]
    command += ["-m", str(MEMORY_MIB), "-nodefaults", "-display", "none", "-no-reboot", "-kernel", str(kernel)]
    return command


def _kvm_works(kernel: Path) -> bool:
    """Boot a kernel without a disk, which must panic and end at once: a device file alone proves nothing."""
    if not os.access("/dev/kvm", os.R_OK | os.W_OK):
        return False
    probe = [*_bare_machine("kvm", kernel), "-append", "panic=-1 quiet"]
    try:
        return subprocess.run(probe, capture_output=True, stdin=subprocess.DEVNULL, timeout=PROBE_S).returncode == 0
    except subprocess.TimeoutExpired:
        return False
