"""The methods that inject failures appear in log and status."""

from dataclasses import replace
from typing import Any

import pytest

from drivers.can.mock_bus import MockBus
from drivers.fault_injection.failing_port import FailingPort, failing_ports
from drivers.fault_injection.failures import FailureParameters, Failures
from firmware_host.configuration.configuration import Configuration
from firmware_host.fault_injection.failure_calls import failures_of, with_failures
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.rpc import RefusedError
from firmware_host.sockets.socket_methods import Level
from firmware_host.sockets.status_socket import Methods
from verification.example_robot import load_one_flipper

MIA = Caller(1, Peer(7, 1000, frozenset()), Level.DRIVE)


class Bench:
    def __init__(self, failures: Failures | None) -> None:
        self.now_s = 10.0
        self.reported: list[tuple[float, str, bool]] = []  # time, text, and whether a failure was active
        self.failures = failures
        self.failing_at_disarm: list[str] = []
        self.holder = MIA
        self.methods = with_failures(self._plain(), failures, self._report, lambda: self.now_s, self._require_holder)

    def _plain(self) -> Methods:
        return {"status": self._status, "disarm": self._disarm}

    def _require_holder(self, caller: Caller) -> None:
        if caller != self.holder:
            raise RefusedError("not yours")

    def _status(self, params: dict[str, Any], caller: Caller) -> dict[str, Any]:
        return {"warnings": ["hot"], "mode": "idle"}

    def _disarm(self, params: dict[str, Any], caller: Caller) -> str:
        self.failing_at_disarm = list(self.failures.failing) if self.failures else []
        return "accepted"

    def _report(self, now_s: float, text: str) -> None:
        self.reported.append((now_s, text, bool(self.failures and self.failures.failing)))

    def fail(self, component: str, kind: str, **others: Any) -> Any:
        return self.methods["fail"]({"component": component, "kind": kind, **others}, MIA)


@pytest.fixture
def bench() -> Bench:
    return Bench(Failures(("left", "right")))


def test_nothing_fails_for_an_operator_while_another_one_holds_the_lease(bench: Bench) -> None:
    bench.holder = MIA._replace(connection=2)
    with pytest.raises(RefusedError, match="not yours"):
        bench.fail("log", "off")
    assert bench.reported == []


def test_a_failure_is_bounded_and_reported_before_it_begins(bench: Bench) -> None:
    (failing,) = bench.fail("log", "off")
    assert failing == {
        "component": "log",
        "kind": "off",
        "remaining_s": 2.0,
        "does": "the log's writer looks dead and takes no row",
    }
    assert bench.reported == [(10.0, "failing on purpose: log off for 2 s, asked by uid 1000 (process 7)", False)]


def test_active_failures_are_in_the_status(bench: Bench) -> None:
    assert bench.methods["status"]({}, MIA) == {"warnings": ["hot"], "mode": "idle", "failing": []}
    bench.fail("left_sweep", "off", for_s=1.5)
    bench.now_s += 0.5
    report = bench.methods["status"]({}, MIA)
    assert report["warnings"] == ["hot", "failing on purpose: left_sweep off, 1.0 s more"]
    assert [each["component"] for each in report["failing"]] == ["left_sweep"]


def test_each_end_of_a_failure_is_reported_that_is_replaced_or_ended_alone_or_with_all(bench: Bench) -> None:
    for component, kind in (("pose", "stuck"), ("log", "off"), ("loop", "stuck"), ("log", "stuck")):
        bench.fail(component, kind)
    assert [each["component"] for each in bench.fail("log", "ok")] == ["pose", "loop"]
    assert bench.fail("all", "ok") == []
    assert [text.removeprefix("end of failing on purpose: ") for _, text, _ in bench.reported if "end" in text] == [
        "log off",
        "log stuck",
        "pose stuck",
        "loop stuck",
    ]


def test_a_disarm_ends_every_failure_before_it_is_done(bench: Bench) -> None:
    bench.fail("left_sweep.command", "off")
    assert bench.methods["disarm"]({}, MIA) == "accepted"
    assert bench.failing_at_disarm == []
    assert bench.reported[-1][1] == "end of failing on purpose: left_sweep.command off"


def test_the_list_holds_all_that_can_fail(bench: Bench) -> None:
    bench.fail("pose", "off")
    report = bench.methods["failures"]({}, MIA)
    assert bench.failures is not None
    assert [(row["component"], row["kind"], row["does"]) for row in report["table"]] == list(bench.failures.table())
    assert report["allowed"] and [each["component"] for each in report["failing"]] == ["pose"]


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({}, "component = None: must be"),
        ({"component": "left_knee", "kind": "ok"}, "left_knee"),
        ({"component": "all", "kind": "off"}, "no component 'all'"),
        ({"component": "log", "kind": "off", "for_s": "long"}, "must be a number"),
        ({"component": ["log"], "kind": "off"}, "component = .*: must be"),
        ({"component": "log", "kind": "x" * 65}, "kind = .*: must be"),
        ({"component": "two\nlines", "kind": "off"}, "component = .*: must be"),
    ],
)
def test_invalid_failures_are_refused_with_a_message(bench: Bench, params: dict[str, Any], said: str) -> None:
    with pytest.raises(RefusedError, match=said):
        bench.methods["fail"](params, MIA)
    assert bench.failures is not None and not bench.failures.failing and bench.reported == []


def test_forbidden_failures_are_refused_with_the_key() -> None:
    bench = Bench(None)
    with pytest.raises(RefusedError, match=r"failures\.allowed = true"):
        bench.fail("pose", "off")
    assert bench.methods["failures"]({}, MIA) == {"allowed": False, "failing": [], "table": []}
    assert bench.methods["status"]({}, MIA) == {"warnings": ["hot"], "mode": "idle"}


def test_only_what_the_robot_has_fails_and_only_where_the_configuration_allows_it(configuration: Configuration) -> None:
    assert failures_of(configuration) is None
    for allowing, missing in ((configuration, "left_knee"), (load_one_flipper(), "left_sweep")):
        failures = failures_of(replace(allowing, failures=FailureParameters(True)))
        assert failures is not None and not failures.refusal("right_sweep", "off")
        assert "no component" in (failures.refusal(missing, "off") or "")


def test_without_the_switch_there_is_no_wrapper_at_all(configuration: Configuration) -> None:
    ports = {name: MockBus().open() for name in configuration.bus}
    assert failing_ports(ports, configuration.drive, None) is ports
    wrapped = failing_ports(ports, configuration.drive, Failures(configuration.bus))
    assert all(isinstance(port, FailingPort) for port in wrapped.values()) and wrapped.keys() == ports.keys()
