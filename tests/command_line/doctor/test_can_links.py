"""CAN interfaces are read from the output of several releases of iproute2 and evaluated."""

import json
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from command_line.doctor import can_links
from command_line.doctor.can_links import CanLink, examine_bus, examine_unit, parse_links, read_sys_links
from command_line.doctor.findings import Level
from drivers.drive import DriveParameters
from firmware_host.configuration.configuration import BusParameters, Configuration
from tests.folders import ROOT

# iproute2 6.1 of Debian 12, with an mcp251xfd that is set up by systemd/80-can.network and .link.
DEBIAN_12 = """[{"ifindex":3,"ifname":"can0","flags":["NOARP","UP","LOWER_UP","ECHO"],"mtu":16,"qdisc":"pfifo_fast",
"operstate":"UP","linkmode":"DEFAULT","group":"default","txqlen":32,"link_type":"can","promiscuity":0,"allmulti":0,
"min_mtu":0,"max_mtu":0,"linkinfo":{"info_kind":"can","info_data":{"state":"ERROR-ACTIVE",
"berr_counter":{"tx":0,"rx":0},"restart_ms":100,"bittiming":{"bitrate":1000000,"sample_point":"0.750","tq":25,
"prop_seg":14,"phase_seg1":15,"phase_seg2":10,"sjw":1,"brp":1},"bittiming_const":{"name":"mcp251xfd",
"tseg1":{"min":2,"max":256},"tseg2":{"min":1,"max":128},"sjw":{"min":1,"max":128},"brp":{"min":1,"max":256},
"brp_inc":1},"clock":40000000}},"num_tx_queues":1,"num_rx_queues":1}]"""
# An adapter without configuration: down, stopped, a queue of ten frames, no timing.
UNTOUCHED = """[{},{"ifindex":4,"ifname":"can1","flags":["NOARP","ECHO"],"mtu":16,"qdisc":"noop","operstate":"DOWN",
"linkmode":"DEFAULT","group":"default","txqlen":10,"link_type":"can","linkinfo":{"info_kind":"can","info_data":
{"state":"STOPPED","restart_ms":0,"clock":48000000}}}]"""
VIRTUAL = """[{"ifindex":1,"ifname":"lo","flags":["LOOPBACK","UP"],"link_type":"loopback","txqlen":1000},
{"ifindex":5,"ifname":"vcan0","flags":["NOARP","UP","LOWER_UP"],"mtu":72,"qdisc":"noqueue","operstate":"UNKNOWN",
"group":"default","txqlen":1000,"link_type":"can","linkinfo":{"info_kind":"vcan"}}]"""
CAN0 = BusParameters("socketcan", "can0")


def changed(**details: Any) -> dict[str, CanLink]:
    """Return the links of DEBIAN_12 with other details."""
    links = json.loads(DEBIAN_12)
    info = links[0]["linkinfo"]["info_data"]
    for key, value in details.items():
        table = links[0] if key in links[0] else info["bittiming"] if key in info["bittiming"] else info
        table[key] = value
    return parse_links(json.dumps(links))


def levels(links: dict[str, CanLink], drives: int = 2, bus: BusParameters = CAN0) -> dict[str, Level]:
    return {
        finding.id: finding.level for finding in examine_bus("left", bus, [DriveParameters("left", 0)] * drives, links)
    }


def test_settings_are_read_as_far_as_they_are_there() -> None:
    """The sample point is text in older releases of iproute2, and a number in newer ones."""
    configured = CanLink("can0", True, "can", "ERROR-ACTIVE", 1_000_000, 0.75, 100, 32, carries_fd=False)
    assert parse_links(DEBIAN_12) == changed(sample_point=0.75) == {"can0": configured}
    stopped = CanLink("can1", False, "can", "STOPPED", restart_ms=0, queue_frames=10, carries_fd=False)
    assert parse_links(UNTOUCHED) == {"can1": stopped}
    assert parse_links(VIRTUAL) == {"vcan0": CanLink("vcan0", True, "vcan", queue_frames=1000, carries_fd=True)}


@pytest.mark.parametrize("text", ["Option -json is unknown", "5", "[5]", '[{"link_type": "can", "flags": 7}]'])
def test_another_output_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        parse_links(text)


def test_an_interface_as_ours_are_set_up_is_ok_in_every_line() -> None:
    lines = ("bus", "bit_rate", "sample_point", "restart", "queue", "load")
    assert levels(parse_links(DEBIAN_12)) == {f"{line}.left": Level.OK for line in lines}


def test_an_interface_that_is_down_fails_with_the_command_that_brings_it_up() -> None:
    found = examine_bus("left", BusParameters("socketcan", "can1"), [], parse_links(UNTOUCHED))
    assert found[0].level is Level.FAIL and "ip link set can1 up type can bitrate 1000000" in found[0].fix
    assert {finding.id: finding.level for finding in found}["queue.left"] is Level.WARN
    fd = examine_bus("left", BusParameters("socketcan", "can1", {}, 1000, 5000), [], parse_links(UNTOUCHED))
    assert "dbitrate 5000000 fd on" in fd[0].fix


@pytest.mark.parametrize(
    ("details", "line", "level"),
    [
        ({"state": "ERROR-WARNING"}, "bus.left", Level.WARN),
        ({"state": "BUS-OFF"}, "bus.left", Level.FAIL),
        ({"bitrate": 250000}, "bit_rate.left", Level.FAIL),
        ({"bitrate": 250000}, "load.left", Level.FAIL),
        ({"bitrate": 500000}, "load.left", Level.WARN),
        ({"sample_point": "0.699"}, "sample_point.left", Level.WARN),
        ({"sample_point": "0.700"}, "sample_point.left", Level.OK),
        ({"sample_point": "0.900"}, "sample_point.left", Level.OK),
        ({"sample_point": "0.901"}, "sample_point.left", Level.WARN),
        ({"restart_ms": 0}, "restart.left", Level.WARN),
        ({"restart_ms": 1000}, "restart.left", Level.OK),
        ({"restart_ms": 1001}, "restart.left", Level.WARN),
        ({"txqlen": 15}, "queue.left", Level.WARN),
        ({"txqlen": 16}, "queue.left", Level.OK),
        ({"txqlen": 64}, "queue.left", Level.OK),
        ({"txqlen": 65}, "queue.left", Level.WARN),
    ],
)
def test_each_setting_is_evaluated(details: dict[str, Any], line: str, level: Level) -> None:
    assert levels(changed(**details))[line] is level


def test_bit_rate_and_load_are_compared_with_the_drives() -> None:
    slow = BusParameters("socketcan", "can0", {}, 250)
    assert levels(changed(bitrate=250000), bus=slow)["bit_rate.left"] is Level.OK
    assert levels({})["bus.left"] is Level.FAIL  # an interface that does not exist
    loads = [levels(parse_links(DEBIAN_12), drives)["load.left"] for drives in (2, 4, 6)]
    assert loads == [Level.OK, Level.WARN, Level.FAIL]


def test_a_bus_that_is_no_interface_of_the_kernel_is_evaluated_by_its_load_alone() -> None:
    serial = BusParameters("slcan", "/dev/ttyACM0", {}, 500)
    assert levels({}, bus=serial) == {"bus.left": Level.OK, "load.left": Level.WARN}


def test_without_iproute2_the_kernel_s_files_tell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, kind, flags in (("can0", 280, "0x400c1"), ("can1", 280, "0x40080"), ("eth0", 1, "0x1003")):
        folder = tmp_path / "sys/class/net" / name
        folder.mkdir(parents=True)
        for file, text in (("type", kind), ("flags", flags), ("tx_queue_len", 10)):
            (folder / file).write_text(f"{text}\n", encoding="utf-8")
    (tmp_path / "sys/class/net/bonding_masters").write_text("", encoding="utf-8")

    def missing(*arguments: object, **options: object) -> None:
        raise FileNotFoundError(2, "No such file or directory", "ip")

    monkeypatch.setattr(subprocess, "run", missing)
    links = can_links.read_links(tmp_path)
    assert links == read_sys_links(tmp_path)
    assert {name: link.up for name, link in links.items()} == {"can0": True, "can1": False}
    assert levels(links) == {"bus.left": Level.OK, "queue.left": Level.WARN, "load.left": Level.OK}


@pytest.mark.parametrize(
    ("present", "configured", "loop", "levels"),
    [
        (("can0", "can1"), ("can0",), {}, []),  # an interface that no drive uses
        (("can0",), ("can0",), {}, [Level.FAIL]),
        ((), ("can0", "can1"), {}, []),  # their buses are reported
        ((), ("/dev/ttyUSB0",), {}, [Level.FAIL] * 2),
        (("can0", "can1", "can2"), ("can0", "can2"), {}, [Level.WARN]),
        (("can0",), ("can0", "can1"), {"wait_for_bus": True}, [Level.FAIL]),
    ],
)
def test_the_service_waits_for_the_interfaces_of_its_buses(
    configuration: Configuration,
    present: tuple[str, ...],
    configured: tuple[str, ...],
    loop: dict[str, bool],
    levels: list[Level],
) -> None:
    buses = {each: BusParameters("slcan" if "tty" in each else "socketcan", each) for each in configured}
    robot = replace(configuration, bus=buses, loop=replace(configuration.loop, **loop))
    unit = (ROOT / "systemd/mudskipper.service").read_text(encoding="utf-8")
    assert [finding.level for finding in examine_unit(unit, present, robot)] == levels
    assert not list(examine_unit("", present, robot))
