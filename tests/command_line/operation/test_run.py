"""A user's control law orders the strides of an attended walk or moves joints, and one that fails stops the robot."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from runpy import run_path
from typing import Any

import msgpack
import pytest

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.operation import attended_walk, run
from control.geometry import FlipperGeometry
from control.plate_integrals import submerged_part
from firmware_host.lease import TAKEN_OVER
from operator_client.status_client import CallRefusedError, StatusClient, plain
from tests.folders import ROOT

LAWS = ROOT / "examples" / "laws"
MODE = {"fault": None, "power_cut": None, "notice": "", "stride": 0, "phase": "swing", "depth_m": 0.0, "body_x_m": 0.0}


class WalkOfTwoStrides(StatusClient):
    """A daemon whose robot closes a stride of both flippers with every second status, and stops on request."""

    def __init__(self, _: Path, refusal: str = "") -> None:
        self.orders: list[dict[str, Any]] = []
        self._refusal, self._asked, self._stopped = refusal, 0, False
        self.lease_refusal = ""

    def call(self, method: str, /, **params: Any) -> Any:
        if method == "status":
            self._asked += 1
            rests = self._stopped or self._asked > 8
            return MODE | {"mode": "hold" if rests else "walking", "strides_closed": 10}
        if method == "strides":
            closed = 10 + 2 * min(2, self._asked // 2)
            return [{"flipper": "left", "number": number} for number in range(params["since"], closed)]
        if method == "lease" and self.lease_refusal:
            raise CallRefusedError(self.lease_refusal)
        if method == "stride":
            if self._refusal:
                raise CallRefusedError(self._refusal)
            packed = msgpack.packb(params, default=plain)  # raises what the real client raises
            self.orders.append(msgpack.unpackb(packed, strict_map_key=False))
        self._stopped = self._stopped or method == "stop"
        return "accepted"

    def close(self) -> None:
        pass


class HoldingRobot(WalkOfTwoStrides):
    """A daemon whose robot holds its pose until its seventh status, and refuses angles beyond 1 rad."""

    def call(self, method: str, /, **params: Any) -> Any:
        if method == "status":
            self._asked += 1
            return MODE | {"mode": "hold" if self._asked < 7 else "idle", "now_s": 0.1 * self._asked}
        if method == "move":
            if not params["left_sweep_rad"] <= 1.0:
                raise CallRefusedError("left_sweep: must be at most 1")
            self.orders.append(params)
        self._stopped = self._stopped or method == "stop"
        return "accepted"


@pytest.fixture
def holding(monkeypatch: pytest.MonkeyPatch) -> HoldingRobot:
    client = HoldingRobot(Path())
    monkeypatch.setattr("command_line.operation.run.StatusClient", lambda socket: client)
    return client


@pytest.fixture
def daemon(monkeypatch: pytest.MonkeyPatch) -> WalkOfTwoStrides:
    client = WalkOfTwoStrides(Path())
    monkeypatch.setattr(attended_walk, "POLL_S", 0.0)
    monkeypatch.setattr(attended_walk, "RENEWAL_S", 0.0)
    monkeypatch.setattr("command_line.operation.run.StatusClient", lambda socket: client)
    return client


def law(folder: Path, body: str) -> str:
    path = folder / "law.py"
    path.write_text(f"import math\ndef law(strides):\n    {body}\n", encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("body", "orders"),
    [
        ("return 0.001 * strides[0]['number']", [{"depth_m": 0.01}, {"depth_m": 0.012}]),
        ("return {'depth_m': 0.03, 'sweep_angle_deg': 20.0}", [{"depth_m": 0.03, "sweep_angle_deg": 20.0}] * 2),
        ("return __import__('numpy').float32(0.03125)", [{"depth_m": 0.03125}] * 2),
        ("return None", []),
    ],
    ids=["a depth", "a depth and a sweep", "of numpy", "as before"],
)
def test_a_law_is_called_once_for_each_stride_that_closed(
    daemon: WalkOfTwoStrides, tmp_path: Path, body: str, orders: Sequence[dict[str, Any]]
) -> None:
    answer = run.run(law(tmp_path, body), socket=tmp_path)
    assert answer.print(as_json=False) == exit_codes.OK
    assert answer.report == {"command": "run", "mode": "hold", "notice": ""}
    assert daemon.orders == list(orders)


def test_with_json_a_law_prints_to_standard_error(
    daemon: WalkOfTwoStrides, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run.run(law(tmp_path, "print('thinking')"), socket=tmp_path, json=True).print(as_json=True)
    printed = capsys.readouterr()
    assert json.loads(printed.out)["mode"] == "hold" and "thinking" in printed.err


def test_a_law_imports_what_lies_next_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "depths_of_mine.py").write_text("DEPTH_M = 0.025\n", encoding="utf-8")
    found, _ = run.load_law(law(tmp_path, "return __import__('depths_of_mine').DEPTH_M"))
    assert run.order_of(found, []) == {"depth_m": 0.025}


@pytest.mark.parametrize(
    ("body", "named"),
    [
        ("return 1 / 0", ("ZeroDivisionError", "line 3")),
        ("raise __import__('asyncio').CancelledError", ("CancelledError", "line 3")),
        ("return __import__('json').loads('')", ("JSONDecodeError", "line 3")),
        ("return 'deep'", ("'deep'",)),
        ("return {'depth_m': 0.03, 4: 'disarm'}", ("4: 'disarm'",)),
        ("return {'depth_m': 2**64}", ("cannot be sent",)),
    ],
)
def test_a_law_that_fails_stops_the_robot_and_is_named(
    daemon: WalkOfTwoStrides, tmp_path: Path, capsys: pytest.CaptureFixture[str], body: str, named: Sequence[str]
) -> None:
    assert run.run(law(tmp_path, body), socket=tmp_path).print(as_json=False) == exit_codes.REFUSED
    printed = capsys.readouterr()
    assert printed.out.splitlines()[-1] == "hold" and all(name in printed.err for name in named)


def test_a_law_that_takes_longer_than_its_lease_is_named(
    daemon: WalkOfTwoStrides, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "LEASE_S", 0.01)
    run.run(law(tmp_path, "import time; time.sleep(0.02)"), socket=tmp_path)
    assert capsys.readouterr().err.count(" s: a lease lasts 0.01 s") == 2  # strides


def test_an_order_that_the_daemon_refuses_stops_the_robot(
    daemon: WalkOfTwoStrides, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    daemon._refusal = "depth_m = 9: too deep"
    assert run.run(law(tmp_path, "return 9.0"), socket=tmp_path).print(as_json=False) == exit_codes.REFUSED
    assert daemon._refusal in capsys.readouterr().err


def test_a_program_that_takes_the_robot_over_is_not_stopped(daemon: WalkOfTwoStrides, tmp_path: Path) -> None:
    daemon._refusal = f"{TAKEN_OVER}uid 7 wanted the robot"
    with pytest.raises(CallRefusedError, match="uid 7"):
        run.run(law(tmp_path, "return 0.02"), socket=tmp_path)
    assert not daemon._stopped


def test_nor_by_a_law_that_fails_meanwhile(
    daemon: WalkOfTwoStrides, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(strides: Any) -> None:
        daemon.lease_refusal = f"{TAKEN_OVER}uid 7 wanted the robot"
        raise ZeroDivisionError

    monkeypatch.setattr(run, "load_law", lambda target: (failing, 0.0))
    with pytest.raises(CallRefusedError, match="uid 7"):
        run.run("", socket=tmp_path)
    assert not daemon._stopped


def joint_law(folder: Path, body: str, rate_hz: str = "50.0") -> str:
    path = folder / "law.py"
    path.write_text(f"RATE_HZ = {rate_hz}\ndef law(status):\n    {body}\n", encoding="utf-8")
    return str(path)


def test_a_law_with_a_rate_moves_joints_by_the_status_until_the_robot_holds_no_more(
    holding: HoldingRobot, tmp_path: Path
) -> None:
    target = joint_law(tmp_path, "return {'left_sweep_rad': status['now_s']}")
    assert run.run(target, socket=tmp_path).print(as_json=False) == exit_codes.REFUSED  # it is idle
    first, *others = holding.orders
    assert first == {"left_sweep_rad": pytest.approx(0.1), "lease_s": attended_walk.LEASE_S, "take_over": False}
    assert [order["left_sweep_rad"] for order in others] == pytest.approx([0.2, 0.3, 0.4, 0.5, 0.6])
    assert not holding._stopped


@pytest.mark.parametrize(
    ("bad", "named"),
    [("1 / 0", "ZeroDivisionError"), ("'up'", "'up'"), ("{'left_sweep_rad': float('nan')}", "nan")],
)
def test_a_law_of_joints_that_fails_stops_the_robot(
    holding: HoldingRobot, tmp_path: Path, capsys: pytest.CaptureFixture[str], bad: str, named: str
) -> None:
    target = joint_law(tmp_path, f"return {bad} if status['now_s'] > 0.25 else {{'left_sweep_rad': 0.0}}")
    assert run.run(target, socket=tmp_path).print(as_json=False) == exit_codes.REFUSED
    assert len(holding.orders) == 2 and holding._stopped
    assert named in capsys.readouterr().err


@pytest.mark.parametrize("rate_hz", ["0.99", "50.01", "float('nan')", "'20'"])
def test_a_rate_out_of_bounds_is_refused_before_the_robot_moves(tmp_path: Path, rate_hz: str) -> None:
    with pytest.raises(CommandError, match="RATE_HZ") as refused:
        run.run(joint_law(tmp_path, "return {}", rate_hz), socket=tmp_path)
    assert refused.value.status == exit_codes.USAGE
    with pytest.raises(CommandError, match="--strides"):
        run.run(joint_law(tmp_path, "return {}"), socket=tmp_path, strides=3)


@pytest.mark.parametrize(
    "content", ["", "import nothing_of_this_name", "raise SystemExit(5)", "law = 3", "def other(strides): pass"]
)
def test_a_file_without_a_law_is_refused_before_the_robot_walks(tmp_path: Path, content: str) -> None:
    path = tmp_path / "law.py"
    path.write_text(content, encoding="utf-8")
    for target in (str(path), f"{path}:absent"):
        with pytest.raises(CommandError) as refused:
            run.run(target, socket=tmp_path)
        assert refused.value.status == exit_codes.USAGE


@pytest.mark.parametrize("path", sorted(LAWS.glob("*.py")), ids=lambda path: path.stem)
def test_the_examples_order_depths_that_the_robot_reaches(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", (LAWS / "paper_rule.py").open())  # a file that is ready, with + and - in it
    example, rate_hz = run.load_law(str(path))
    assert rate_hz == 0.0
    for k_e, step_m in ((3e6, 0.03), (3e5, 0.001), (3e7, 0.0)):
        stride = {"k_e": {"value": k_e, "valid": True}, "step_m": step_m}
        order = run.order_of(example, [stride, stride])
        assert order is not None and 0.01 <= order["depth_m"] <= 0.05


def test_the_paper_s_rule_orders_the_depth_of_which_the_estimator_s_law_expects_its_torque() -> None:
    """A plate that stands upright in the mud."""
    rule, geometry = run_path(str(LAWS / "paper_rule.py")), FlipperGeometry()
    for k_e in (1e6, 1.5e6, 2.5e6):
        depth_m = rule["law"]([{"k_e": {"value": k_e, "valid": True}}])
        volume_m3 = geometry.plate_thickness_m * submerged_part(geometry, depth_m, 0.0, 1.0).area_m2
        assert k_e * volume_m3 * geometry.flipper_length_m == pytest.approx(rule["MOTOR_NM"])
