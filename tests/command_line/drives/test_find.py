"""`mudskipper drives find` prints what answers, and refuses a bus that another program uses."""

import json

import pytest

from command_line import exit_codes
from drivers.drive_types import DRIVE_BENCHES
from tests.command_line.command_lines import failure
from tests.command_line.drives.bench_setup import MakeBench


@pytest.mark.parametrize("name", DRIVE_BENCHES)
def test_every_drive_of_the_configuration_is_listed_with_its_joint(make_bench: MakeBench, name: str) -> None:
    bench = make_bench(name)
    ended = bench.run("find", "--json")
    report = json.loads(ended.stdout)
    found = {each["joint"]: each["type"] for bus in report["buses"] for each in bus["drives"]}
    assert ended.returncode == exit_codes.OK and found == dict.fromkeys(bench.drives, name)
    assert not any(bus.energised for bus in bench.buses.values())
    shown = bench.run("find").stdout
    assert all(joint in shown for joint in bench.drives) and "every configured drive answers" in shown


def test_a_drive_that_does_not_answer_is_a_failure(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.buses["left"].drives.remove(bench.drives["left_sweep"])
    ended = bench.run("find")
    assert ended.returncode == exit_codes.UNHEALTHY
    assert "FAIL drive.left_sweep: type odrive, id 0: nothing answers" in ended.stdout


def test_drives_of_a_type_that_was_not_asked_for_are_not_missed(make_bench: MakeBench) -> None:
    bench = make_bench()
    ended = bench.run("find", "--type", "odrive05")
    assert "no drive answers" in ended.stdout and "FAIL" not in ended.stdout


def test_one_bus_can_be_searched_alone(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run("find", "--bus", "right")
    assert bench.buses["right"].sent and not bench.buses["left"].sent


def test_an_interface_without_can_fd_is_refused_by_name() -> None:
    message = failure("drives", "find", "--interface", "slcan", "--channel", "/dev/ttyACM0", "--fd")
    assert "slcan carries no CAN FD" in message
