"""A serial line over a pseudo-terminal: how lines end, what an unplugged cable does, and why a port is refused."""

import errno
import os
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.serial.serial_line import RETRY_S, SerialLine, SerialLineError, open_serial
from tests.waiting import LONGEST_S, shortest_wait_s

pytest.importorskip("serial", reason="pyserial is not installed")


class Cable:
    """A device that writes given bytes, under a link that stays the same."""

    def __init__(self, folder: Path) -> None:
        self.link = folder / "device"
        self.plug_in()
        self.line = SerialLine(str(self.link), 115200, longest_bytes=20)

    def plug_in(self) -> None:
        self.files = os.openpty()
        tty.setraw(self.files[1])
        self.link.symlink_to(os.ttyname(self.files[1]))

    def unplug(self) -> None:
        self.link.unlink()
        for file in self.files:
            os.close(file)

    def hear(self, data: bytes, lines: int) -> list[bytes]:
        """Write data, and return the lines that are read until `lines` of them have come."""
        os.write(self.files[0], data)
        heard, deadline_s = list[bytes](), time.monotonic() + LONGEST_S
        while len(heard) < lines and time.monotonic() < deadline_s:
            heard += self.line.read(0.0)
        return heard


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    made = Cable(tmp_path)
    yield made
    made.line.close()
    if made.link.is_symlink():
        made.unplug()


def test_lines_end_with_either_or_both_and_blank_ones_are_none(cable: Cable) -> None:
    assert cable.hear(b"rest of one\r\none\rtwo\nthree\r\n  \r\nfour\n", 4) == [b"one", b"two", b"three", b"four"]
    assert cable.hear(b"fi", 0) == []
    assert cable.hear(b"ve\n", 1) == [b"five"]
    assert list(cable.line.recent) == [b"one", b"two", b"three", b"four", b"five"]


def test_a_line_without_an_end_comes_in_pieces_and_its_rest_is_no_line(cable: Cable) -> None:
    assert cable.hear(b"x" * 30, 1) == [b"x" * 30]
    assert cable.hear(b"xx\nwhole\n", 1) == [b"whole"]


def test_reading_never_waits(cable: Cable) -> None:
    assert shortest_wait_s(lambda: cable.line.read(0.0)) < 0.0005


def test_a_device_that_is_gone_is_opened_again_periodically_and_starts_fresh(cable: Cable) -> None:
    cable.hear(b"\nbegun", 0)
    cable.unplug()
    assert cable.line.read(1.0) == []
    assert (cable.line.is_there, cable.line.unpluggings) == (False, 1)
    assert not cable.line.reopen(1.0 + 0.9 * RETRY_S)
    assert not cable.line.reopen(1.0 + 1.1 * RETRY_S)
    assert cable.line.problem is not None and "no serial port" in str(cable.line.problem)
    assert cable.line.problem.why == os.strerror(errno.ENOENT)
    cable.plug_in()
    assert not cable.line.reopen(1.0 + 2.0 * RETRY_S)
    assert cable.line.reopen(1.0 + 2.2 * RETRY_S)
    assert not cable.line.reopen(9.0)  # it is there
    assert cable.hear(b"half\nwhole\n", 1) == [b"whole"]


def test_the_error_of_a_missing_port_lists_the_existing_ones(tmp_path: Path) -> None:
    with pytest.raises(SerialLineError, match=r"no serial port .*/nothing: (there are|this computer sees none)"):
        open_serial(str(tmp_path / "nothing"), 9600)


def test_a_file_and_a_folder_are_no_serial_ports(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path):
        with pytest.raises(SerialLineError, match=f"{path} is no serial port: "):
            open_serial(str(path), 9600)


def test_a_port_in_use_says_so(cable: Cable) -> None:
    with pytest.raises(SerialLineError, match="another program"):
        open_serial(str(cable.link), 115200)


def test_without_permission_the_group_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial

    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(SerialLineError, match="dialout"):
        open_serial("/dev/ttyUSB0", 9600)
