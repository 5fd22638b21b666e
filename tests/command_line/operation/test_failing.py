"""`mudskipper fail` against a real daemon with a simulated robot."""

import json

from command_line import exit_codes
from control.records import JOINTS
from drivers.fault_injection.failures import Failures
from logs.files.log_reader import read_log
from tests.running_bench import Bench


def test_a_failing_drive_stops_the_robot_and_is_shown_and_logged(own_bench: Bench) -> None:
    bench = own_bench
    bench.run("arm")
    done = bench.run("fail", "left_sweep", "off", "--for", "5")
    assert done.returncode == exit_codes.OK and "left_sweep  off" in done.stdout
    report = bench.wait_for(lambda report: report["mode"] == "fault")
    assert "left_sweep" in json.dumps(report["fault"])
    assert "failing on purpose: left_sweep off" in bench.run("status").stdout
    assert bench.run("fail", "all", "ok").stdout == "nothing fails on purpose\n"
    bench.wait_for(lambda report: report["failing"] == [] and report["drives"][0]["angle_age_s"] < 0.1)
    texts = [event["text"] for event in read_log(bench.stop_daemon()).events]
    (begin,) = [text for text in texts if text.startswith("failing on purpose")]
    assert begin.startswith("failing on purpose: left_sweep off for 5 s, asked by ")
    assert "end of failing on purpose: left_sweep off" in texts


def test_the_list_shows_every_component_with_its_kinds(bench: Bench) -> None:
    listed = json.loads(bench.run("fail", "--list", "--json").stdout)
    table = [(row["component"], row["kind"], row["does"]) for row in listed["table"]]
    assert table == list(Failures(("left", "right")).table()) and listed["failing"] == []
    assert listed["schema"] == "failures/1"
    shown = bench.run("fail", "--list").stdout
    assert {row["family"] for row in listed["table"]} <= set(shown.split()) and all(joint in shown for joint in JOINTS)
