"""The processors stay awake exactly while torque is on; where this is not permitted the robot still walks."""

import os
import struct
from pathlib import Path

from firmware_host.computer.awake_processors import AwakeProcessors

NO_LATENCY, KERNEL_DEFAULT = struct.pack("=i", 0), struct.pack("=i", -1)


def test_sleep_is_forbidden_with_torque_and_permitted_without_and_each_is_written_once(tmp_path: Path) -> None:
    device = tmp_path / "cpu_dma_latency"
    os.mkfifo(device)
    kernel = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
    processors = AwakeProcessors(device=device)
    for energised in (False, False, True, True, True, False, False, True):
        processors.update(energised)
    assert os.read(kernel, 64) == NO_LATENCY + KERNEL_DEFAULT + NO_LATENCY
    processors.close()
    assert os.read(kernel, 64) == b""  # closing the device ends the request
    os.close(kernel)


def test_a_computer_without_the_device_is_a_sentence_and_no_failure(tmp_path: Path) -> None:
    processors = AwakeProcessors(device=tmp_path / "cpu_dma_latency")
    assert processors.problem.startswith("the processors may sleep between two ticks: ")
    assert processors.problem.endswith("No such file or directory")
    processors.update(True)
    processors.close()
    processors.close()


def test_if_it_is_not_configured_the_device_is_not_opened(tmp_path: Path) -> None:
    assert AwakeProcessors(wanted=False, device=tmp_path / "none").problem == ""


def test_a_kernel_that_refuses_the_request_ends_no_walk() -> None:
    processors = AwakeProcessors(device=Path("/dev/full"))  # every write fails
    processors.update(True)
    processors.close()
