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
from command_line.operation import attended_walk, run
from control.geometry import FlipperGeometry
from control.plate_integrals import submerged_part
from firmware_host.lease import TAKEN_OVER
from operator_client.status_client import CallRefusedError, StatusClient, plain
from tests.command_line.command_lines import json_of, refusal
from tests.command_line.command_lines import run as run_command
from tests.folders import ROOT

LAWS = ROOT / "examples" / "laws"
MODE = {"fault": None, "power_cut": None, "notice": "", "stride": 0, "phase": "swing", "depth_m": 0.0, "body_x_m": 0.0}


HELD = {"schema": "operation/1", "command": "run", "mode": "hold", "notice": ""}


class WalkOfTwoStrides(StatusClient):
    """A daemon whose robot closes a stride of both flippers with every second status, and stops on request."""

    def __init__(self, _: Path) -> None:
        self.orders: list[dict[str, Any]] = []
        self.refusal, self.lease_refusal = "", ""
        self._asked, self.stopped = 0, False

    def call(self, method: str, /, **params: Any) -> Any:
        if method == "status":
            self._asked += 1
            rests = self.stopped or self._asked > 8
            return MODE | {"mode": "hold" if rests else "walking", "strides_closed": 10, "stride": self._asked // 2}
        if method == "strides":
            closed = 10 + 2 * min(2, self._asked // 2)
            return [{"flipper": "left", "number": number} for number in range(params["since"], closed)]
        if method == "lease" and self.lease_refusal:
            raise CallRefusedError(self.lease_refusal)
        if method == "stride":
            if self.refusal:
                raise CallRefusedError(self.refusal)
            packed = msgpack.packb(params, default=plain)  # raises what the real client raises
            self.orders.append(msgpack.unpackb(packed, strict_map_key=False))
        self.stopped = self.stopped or method == "stop"
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
        self.stopped = self.stopped or method == "stop"
        return "accepted"


def serve(client: WalkOfTwoStrides, patch: pytest.MonkeyPatch) -> None:
    """Let the command meet this daemon, and no time pass between two looks at it."""
    patch.setattr(attended_walk, "POLL_S", 0.0)
    patch.setattr(attended_walk, "RENEWAL_S", 0.0)
    patch.setattr(run, "StatusClient", lambda socket: client)


@pytest.fixture
def daemon(monkeypatch: pytest.MonkeyPatch) -> WalkOfTwoStrides:
    client = WalkOfTwoStrides(Path())
    serve(client, monkeypatch)
    return client


@pytest.fixture
def holding(monkeypatch: pytest.MonkeyPatch) -> HoldingRobot:
    client = HoldingRobot(Path())
    serve(client, monkeypatch)
    return client


def law(folder: Path, body: str, rate_hz: str = "") -> str:
    """Write a law, and return its file; with a rate it moves single joints."""
    path = folder / "law.py"
    head = f"RATE_HZ = {rate_hz}\n" if rate_hz else "import math\n"
    path.write_text(f"{head}def law(seen):\n    {body}\n", encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("body", "orders"),
    [
        ("return 0.001 * seen[0]['number']", [{"depth_m": 0.01}, {"depth_m": 0.012}]),
        ("return {'depth_m': 0.03, 'sweep_angle_deg': 20.0}", [{"depth_m": 0.03, "sweep_angle_deg": 20.0}] * 2),
        ("return __import__('numpy').float32(0.03125)", [{"depth_m": 0.03125}] * 2),
        ("return None", []),
    ],
    ids=["a depth", "a depth and a sweep", "of numpy", "as before"],
)
def test_a_law_is_called_once_for_each_stride_that_closed(
    daemon: WalkOfTwoStrides, tmp_path: Path, body: str, orders: Sequence[dict[str, Any]]
) -> None:
    assert json_of("run", law(tmp_path, body), "--strides", "2") == HELD
    assert daemon.orders == list(orders)


@pytest.mark.usefixtures("daemon")
def test_with_json_a_law_prints_to_standard_error(tmp_path: Path) -> None:
    ended = run_command("run", law(tmp_path, "print('thinking')"), "--json", "--strides", "2")
    assert json.loads(ended.stdout) == HELD and "thinking" in ended.stderr


def test_a_law_imports_what_lies_next_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "depths_of_mine.py").write_text("DEPTH_M = 0.025\n", encoding="utf-8")
    found, _ = run.load_law(law(tmp_path, "return __import__('depths_of_mine').DEPTH_M"))
    assert run.order_of(found, []) == {"depth_m": 0.025}


@pytest.mark.usefixtures("daemon")
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
def test_a_law_that_fails_stops_the_robot_and_is_named(tmp_path: Path, body: str, named: Sequence[str]) -> None:
    ended = run_command("run", law(tmp_path, body))
    assert ended.returncode == exit_codes.REFUSED and ended.stdout.splitlines()[-1] == "hold"
    assert all(name in ended.stderr for name in named)


@pytest.mark.usefixtures("daemon")
def test_a_law_that_takes_longer_than_its_lease_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "LEASE_S", 0.01)
    ended = run_command("run", law(tmp_path, "import time; time.sleep(0.02)"))
    assert ended.stderr.count(" s: a lease lasts 0.01 s") == 2  # strides


def test_an_order_that_the_daemon_refuses_stops_the_robot(daemon: WalkOfTwoStrides, tmp_path: Path) -> None:
    daemon.refusal = "depth_m = 9: too deep"
    ended = run_command("run", law(tmp_path, "return 9.0"))
    assert ended.returncode == exit_codes.REFUSED and daemon.refusal in ended.stderr and daemon.stopped


@pytest.mark.usefixtures("daemon")
@pytest.mark.parametrize(
    ("strides", "status"), [((), exit_codes.REFUSED), (("--strides", "9"), exit_codes.REFUSED), (("--strides", "5"), 0)]
)
def test_a_law_that_another_program_stops_is_refused_as_one_of_joints_is(
    tmp_path: Path, strides: Sequence[str], status: int
) -> None:
    """The robot begins five strides."""
    ended = run_command("run", law(tmp_path, "return None"), *strides)
    assert (ended.returncode, ended.stdout.splitlines()[-1]) == (status, "hold")


def test_a_program_that_takes_the_robot_over_is_not_stopped(daemon: WalkOfTwoStrides, tmp_path: Path) -> None:
    daemon.refusal = f"{TAKEN_OVER}uid 7 wanted the robot"
    ended = run_command("run", law(tmp_path, "return 0.02"))
    assert ended.returncode == exit_codes.REFUSED and "uid 7" in ended.stderr and not daemon.stopped


def test_nor_by_a_law_that_fails_meanwhile(daemon: WalkOfTwoStrides, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(strides: Any) -> None:
        daemon.lease_refusal = f"{TAKEN_OVER}uid 7 wanted the robot"
        raise ZeroDivisionError

    monkeypatch.setattr(run, "load_law", lambda target: (failing, 0.0))
    ended = run_command("run", "law.py")
    assert ended.returncode == exit_codes.REFUSED and "uid 7" in ended.stderr and not daemon.stopped


def test_a_law_with_a_rate_moves_joints_by_the_status_until_the_robot_holds_no_more(
    holding: HoldingRobot, tmp_path: Path
) -> None:
    ended = run_command("run", law(tmp_path, "return {'left_sweep_rad': seen['now_s']}", "50.0"))
    assert ended.returncode == exit_codes.REFUSED  # it is idle
    first, *others = holding.orders
    assert first == {"left_sweep_rad": pytest.approx(0.1), "lease_s": attended_walk.LEASE_S, "take_over": False}
    assert [order["left_sweep_rad"] for order in others] == pytest.approx([0.2, 0.3, 0.4, 0.5, 0.6])
    assert not holding.stopped


@pytest.mark.parametrize(
    ("bad", "named"),
    [("1 / 0", "ZeroDivisionError"), ("'up'", "'up'"), ("{'left_sweep_rad': float('nan')}", "nan")],
)
def test_a_law_of_joints_that_fails_stops_the_robot(
    holding: HoldingRobot, tmp_path: Path, bad: str, named: str
) -> None:
    body = f"return {bad} if seen['now_s'] > 0.25 else {{'left_sweep_rad': 0.0}}"
    ended = run_command("run", law(tmp_path, body, "50.0"))
    assert ended.returncode == exit_codes.REFUSED and named in ended.stderr
    assert len(holding.orders) == 2 and holding.stopped


@pytest.mark.parametrize("rate_hz", ["0.99", "50.01", "float('nan')", "'20'"])
def test_a_rate_out_of_bounds_is_refused_before_the_robot_moves(tmp_path: Path, rate_hz: str) -> None:
    assert "RATE_HZ" in refusal("run", law(tmp_path, "return {}", rate_hz))
    for option in ("--strides", "--depth"):  # of a law of strides
        assert f"{option} 3: " in refusal("run", law(tmp_path, "return {}", "50.0"), option, "3")


@pytest.mark.parametrize(
    "content", ["", "import nothing_of_this_name", "raise SystemExit(5)", "law = 3", "def other(strides): pass"]
)
def test_a_file_without_a_law_is_refused_before_the_robot_walks(tmp_path: Path, content: str) -> None:
    path = tmp_path / "law.py"
    path.write_text(content, encoding="utf-8")
    for target in (str(path), f"{path}:absent"):
        assert str(path) in refusal("run", target)


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
