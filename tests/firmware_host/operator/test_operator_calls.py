"""The methods of the socket: the log names each sender, and the lease decides who may move the robot."""

import re
from itertools import pairwise
from math import nan, radians
from typing import Any

import pytest

from control.faults import FaultKind
from control.modes import Mode
from control.rate import PERIOD_S
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.gait_file import as_json, gait_document
from firmware_host.log.recorder import LONGEST_TEXT
from firmware_host.loop import Loop
from firmware_host.mud_learning import ClosedStride
from firmware_host.operator.operator_calls import OperatorCalls
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rights import Peer
from firmware_host.sockets.rpc import RefusedError
from firmware_host.sockets.socket_methods import METHODS, Level
from firmware_host.trial import BEGUN, SET, OperatorReport, from_json, read_report
from tests.control.synthetic_muds import stride as closed_stride
from tests.firmware_host.recorded_robot import RecordedRobot

ANNA = Caller(1, Peer(77, 1000, frozenset({71})), Level.DRIVE)
BEN = Caller(2, Peer(78, 1001, frozenset({71})), Level.DRIVE)
WALL_S = 1_800_000_000.25


class Robot:
    """A simulated robot with the methods of its socket."""

    def __init__(self, robot: RecordedRobot) -> None:
        self.events, self.steps, self.lease = robot.recorder, robot, robot.loop.lease
        self._methods = OperatorCalls(robot.loop, [], lambda: robot.now_s, lambda: WALL_S).methods

    def ask(self, method: str, caller: Caller = ANNA, **params: Any) -> Any:
        return self._methods[method](params, caller)

    def run_until_stride(self, stride: int) -> None:
        assert self.steps.run_until(lambda: self.steps.loop.target.stride == stride, 20.0)


@pytest.fixture
def idle(configuration: Configuration) -> Robot:
    return Robot(RecordedRobot(configuration))


@pytest.fixture
def armed(robot: RecordedRobot) -> Robot:
    return Robot(robot)


def test_the_log_names_the_sender_of_each_request(armed: Robot) -> None:
    armed.ask("walk", strides=2)
    armed.steps.run_for(0.1)
    armed.ask("stop", BEN)
    armed.ask("disarm", BEN)
    assert [text for text in armed.events.texts if text.startswith("request")] == [
        "request arm",  # by the fixture
        "request walk by uid 1000 (process 77)",
        "request stop by uid 1001 (process 78)",
        "request disarm by uid 1001 (process 78)",
    ]


def test_a_stop_that_changes_nothing_does_not_fill_the_log_but_is_counted(armed: Robot) -> None:
    armed.ask("disarm")
    armed.steps.step()
    reported = len(armed.events.texts)
    for _ in range(50):
        assert armed.ask("stop", BEN) == armed.ask("disarm", BEN) == "accepted"
        armed.steps.step()
    assert not armed.events.about("request")[2:] and len(armed.events.texts) - reported <= 2  # mode and lease
    assert armed.ask("status")["unlogged_requests"] == 100
    armed.ask("arm")
    assert armed.events.texts[-1].startswith("request arm by uid 1000 (process 77); 100 before it")


def test_a_repeated_request_is_logged_once_a_second(idle: Robot) -> None:
    idle.steps.run_for(1.0)
    for _ in range(400):
        idle.ask("clear")
        idle.steps.step()
    assert idle.events.about("request") == [
        "request clear by uid 1000 (process 77)",
        "request clear by uid 1000 (process 77); 379 before it changed nothing or were repeated",
    ]


def test_answers_have_the_keys_of_the_table(armed: Robot) -> None:
    assert list(armed.ask("status")) == list(METHODS["status"].answer_keys)
    assert list(armed.ask("hello")) == list(METHODS["hello"].answer_keys)
    assert set(armed.ask("check")[0]) == set(METHODS["check"].answer_keys)
    assert all(0.0 <= drive["angle_age_s"] < 0.1 for drive in armed.ask("status")["drives"])


def test_a_described_walk_is_a_trial_and_so_is_the_walk_after_it(armed: Robot) -> None:
    def walk(**params: Any) -> list[OperatorReport]:
        before = len(armed.events.texts)
        armed.ask("walk", strides=1, **params)
        armed.steps.run_until(lambda: armed.steps.loop.mode is Mode.WALKING, 1.0)
        armed.steps.run_until(lambda: armed.steps.loop.mode is Mode.HOLD, 20.0)
        return [report for text in armed.events.texts[before:] if (report := read_report(text))]

    assert walk() == []
    armed.ask("trial_set", mud="A", water="49.5", plate="flat")
    armed.ask("trial_set", BEN, plate="")
    (first,) = walk(trial="3", water="50")
    assert first.kind == BEGUN and first.by == str(ANNA) and first.time.timestamp() == WALL_S
    assert from_json(first.text) == armed.ask("status")["trial"] == {"mud": "A", "water": "50", "trial": "3"}
    assert from_json(walk()[0].text) == armed.ask("trial")["defaults"] == {"mud": "A", "water": "49.5"}
    armed.ask("trial_set", mud="", water="")
    assert [each.text for each in walk()] == ["{}"] and walk() == []  # the trial's log does not go on
    with pytest.raises(RefusedError):
        walk(mud="B", depth_m=1.0)
    assert armed.ask("status")["trial"] == {}


def test_new_defaults_go_to_the_log_whose_writer_stores_them(idle: Robot) -> None:
    idle.ask("trial_set", mud="A")
    report = read_report(idle.events.texts[-1])
    assert report and (report.kind, from_json(report.text)) == (SET, {"mud": "A"})


@pytest.mark.parametrize("method", ["note", "mark"])
def test_a_note_and_a_marker_have_both_clocks(idle: Robot, method: str) -> None:
    text = "clap: 👏" + 893 * "𓆣"  # the longest
    answer = idle.ask(method, text=text)
    assert len(idle.events.texts[-1].encode()) < LONGEST_TEXT
    report = read_report(idle.events.texts[-1])
    assert report and report.text == text and report.time.timestamp() == WALL_S
    assert answer == {"stamp_s": idle.steps.now_s, "time": report.time.isoformat(timespec="microseconds")}


@pytest.mark.parametrize(
    ("method", "params", "reason"),
    [
        ("note", {"text": "x" * 901}, "text"),
        ("note", {"text": "a\nb"}, "text"),
        ("mark", {"text": 3}, "text"),
        ("trial_set", {"Mud": "A"}, "'Mud'"),
        ("trial_set", {"plate": 1.0}, "plate"),
        ("trial_set", {"water": "wet"}, "water"),
        ("trial_set", {"water": "nan"}, "water"),
        ("trial_set", {name: "ü" * 900 for name in ("mud", "note")}, "3000"),
        ("walk", {"water": "101"}, "water"),
        ("walk", {"water": "-1"}, "water"),
    ],
)  # fmt: skip
def test_a_description_that_cannot_be_logged_is_refused_with_its_key(
    idle: Robot, method: str, params: dict[str, Any], reason: str
) -> None:
    with pytest.raises(RefusedError) as refused:
        idle.ask(method, **params)
    assert reason in str(refused.value) and len(str(refused.value)) < 200
    assert idle.ask("trial") == {"defaults": {}, "present": {}} and not idle.events.about("uid")


@pytest.mark.parametrize("end", ["hang_up", "silence"])
def test_a_lease_that_ends_with_torque_off_does_not_block_arming(idle: Robot, end: str) -> None:
    idle.steps.run_for(1.0)
    idle.ask("lease", for_s=0.5)
    if end == "hang_up":
        idle.lease.hang_up(ANNA)
    idle.steps.run_for(PERIOD_S if end == "hang_up" else 0.5 + 2 * PERIOD_S)
    assert idle.ask("status")["faults"] == [] and not idle.events.about("lease_lost")
    assert idle.events.texts[-1] == "lease of uid 1000 (process 77) is over"
    assert idle.ask("arm", BEN) == "accepted"
    idle.steps.run_for(0.5)
    assert idle.ask("status")["mode"] == "hold"


def test_a_lease_is_that_of_one_connection_and_keeps_only_other_users_from_the_timing(armed: Robot) -> None:
    second_program = ANNA._replace(connection=3)
    for _ in range(5):
        armed.ask("lease", for_s=0.5)
        armed.steps.run_for(0.2)
    assert armed.lease.held and not armed.lease.lost(armed.steps.now_s)
    assert armed.events.about("lease") == ["lease taken by uid 1000 (process 77)"]
    with pytest.raises(RefusedError, match="operates the robot"):
        armed.ask("lease", second_program, for_s=0.5)
    with pytest.raises(RefusedError, match="uid 1000 .* operates the robot"):
        armed.ask("reset_timing", BEN)
    assert armed.ask("reset_timing", second_program) == "accepted"
    armed.ask("release")
    assert armed.ask("reset_timing", BEN) == "accepted"


MOTIONS: list[tuple[str, dict[str, Any]]] = [("walk", {"strides": 1}), ("move", {"left_sweep_rad": 0.1})]


@pytest.mark.parametrize(("method", "params"), MOTIONS)
def test_only_the_holder_of_the_lease_moves_the_robot(armed: Robot, method: str, params: dict[str, Any]) -> None:
    armed.ask("lease", for_s=0.5)
    with pytest.raises(RefusedError, match="operates the robot: .*silent for 0.5 s, or overrule it with --take-over"):
        armed.ask(method, BEN, **params)
    armed.steps.run_for(0.1)
    assert armed.ask("status")["mode"] == "hold" and not armed.ask("status")["moving"]
    assert armed.ask(method, ANNA, **params) == "accepted"


@pytest.mark.parametrize(("method", "mode"), [("stop", "stopping"), ("disarm", "idle")])
def test_every_user_stops_the_robot_despite_a_lease(armed: Robot, method: str, mode: str) -> None:
    armed.ask("lease", for_s=10.0)
    armed.ask("walk", strides=0)
    armed.steps.run_for(0.5)
    assert armed.ask(method, BEN) == "accepted"
    armed.steps.run_for(0.01)
    assert armed.ask("status")["mode"] == mode


@pytest.mark.parametrize(("method", "params"), [*MOTIONS, ("walk", {"lease_s": 0.5})])
def test_a_take_over_ends_the_lease_of_the_previous_holder(armed: Robot, method: str, params: dict[str, Any]) -> None:
    armed.ask("lease", for_s=0.5)
    assert armed.ask(method, BEN, take_over=True, **params) == "accepted"
    assert armed.events.about("lease of") == ["lease of uid 1000 (process 77) taken over by uid 1001 (process 78)"]
    for again in ("lease", "walk", "move", "arm"):
        with pytest.raises(RefusedError, match=r"^taken over: uid 1001 \(process 78\)"):
            armed.ask(again, ANNA, **({"for_s": 0.5} if again == "lease" else {}))
    armed.lease.hang_up(ANNA)
    armed.steps.run_for(0.3)
    assert armed.ask("status")["notice"] == ""  # no lease was lost
    assert armed.ask("status")["mode"] in ("hold", "walking")


def test_a_refused_take_over_changes_nothing(armed: Robot) -> None:
    armed.ask("lease", for_s=0.5)
    for method, params in (
        ("arm", {}),
        ("move", {"left_sweep_rad": 9.0}),
        ("walk", {"depth_m": 1.0, "lease_s": 0.5}),
        ("walk", {"lease_s": 99.0}),
        ("lease", {"for_s": 0.5}),
    ):
        with pytest.raises(RefusedError):
            armed.ask(method, BEN, take_over=True, **params)
    with pytest.raises(RefusedError, match="take_over = 1: must be true or false"):
        armed.ask("walk", BEN, take_over=1)
    assert armed.ask("lease", ANNA, for_s=0.5) == "accepted"


def test_a_walk_can_take_the_lease(armed: Robot) -> None:
    assert armed.ask("walk", lease_s=0.5) == "accepted"
    armed.steps.run_for(0.4)
    with pytest.raises(RefusedError, match="operates the robot"):
        armed.ask("walk", BEN)
    assert armed.ask("status")["mode"] == "walking"
    armed.steps.run_for(0.2)  # the lease expires
    assert armed.ask("status")["mode"] == "stopping"


@pytest.mark.parametrize("for_s", [None, True, "0.5", 0.09, 10.1, nan, 2**70])
def test_a_lease_lasts_from_0_1_to_10_seconds(armed: Robot, for_s: Any) -> None:
    for method, name in (("lease", "for_s"), ("walk", "lease_s")):
        with pytest.raises(RefusedError, match=rf"^{name} = .*: must be a number from 0.1 to 10"):
            armed.ask(method, **{name: for_s})
    armed.steps.run_for(0.01)
    assert not armed.lease.held and armed.ask("status")["mode"] == "hold"


def test_a_refused_request_is_not_logged(armed: Robot) -> None:
    with pytest.raises(RefusedError, match="^nothing to clear"):
        armed.ask("clear")
    assert not armed.events.about("uid")


def test_zeros_are_confirmed_at_rest_only(idle: Robot) -> None:
    idle.steps.run_for(1.0)
    loop, rest = idle.steps.loop, idle.steps.loop.states
    loop.fault_monitor.zeros[2].shift_rad = 0.5
    loop.states = rest.map(lambda state: state._replace(velocity_rad_s=0.31))
    with pytest.raises(RefusedError, match=r"^left_sweep turns at 0.31 rad/s: must be at most 0.3 rad/s"):
        idle.ask("clear", zero=True)
    assert loop.fault_monitor.zeros[2].shift_rad == 0.5
    loop.states = rest
    idle.ask("clear", zero=True)
    assert loop.fault_monitor.zeros[2].shift_rad == 0.0
    assert any(text.startswith("zero of right_sweep confirmed by") for text in idle.events.texts)


def test_a_move_changes_only_the_requested_joints(armed: Robot) -> None:
    held_rad = [drive["angle_rad"] for drive in armed.ask("status")["drives"]]
    armed.ask("move", BEN, left_sweep_rad=0.3, left_adduction_rad=0.2)
    assert armed.ask("status")["moving"]
    armed.steps.run_until(lambda: not armed.ask("status")["moving"], 5.0)
    armed.steps.run_for(0.5)
    angles_rad = [drive["angle_rad"] for drive in armed.ask("status")["drives"]]
    assert angles_rad == pytest.approx([0.3, 0.2, held_rad[2], held_rad[3]], abs=0.02)
    assert armed.ask("status")["mode"] == "hold"
    assert armed.events.about("move")[-1].endswith("left_adduction to 0.2000 rad by uid 1001 (process 78)")


def test_a_stop_ends_a_move(armed: Robot) -> None:
    armed.ask("move", left_sweep_rad=0.3)
    armed.steps.run_for(0.1)
    armed.ask("stop", BEN)
    status = armed.ask("status")
    assert not status["moving"] and status["mode"] == "hold"
    assert status["notice"] == "the joints stopped on their way: stop was requested by uid 1001 (process 78)."
    armed.steps.run_for(0.5)
    assert armed.ask("status")["drives"][0]["angle_rad"] < 0.2
    armed.ask("move", left_sweep_rad=0.3)
    assert armed.ask("status")["notice"] == ""
    armed.ask("disarm")
    armed.steps.run_for(0.1)
    assert not armed.ask("status")["moving"]


def test_a_stop_of_another_user_ends_the_moves_of_a_program_that_sends_them_at_a_rate(armed: Robot) -> None:
    armed.ask("move", left_sweep_rad=0.3, lease_s=1.0)
    armed.steps.run_for(0.1)
    armed.ask("stop", BEN)
    with pytest.raises(RefusedError, match=r"^taken over: uid 1001 \(process 78\)"):
        armed.ask("move", left_sweep_rad=0.3, lease_s=1.0)
    assert armed.events.about("lease of") == ["lease of uid 1000 (process 77) taken over by uid 1001 (process 78)"]
    armed.steps.run_for(1.2)
    assert (armed.ask("status")["mode"], armed.ask("status")["moving"]) == ("hold", False)


def test_moves_at_a_rate_go_on_without_jumps_and_are_logged_once_a_second(armed: Robot) -> None:
    controller, velocities_rad_s = armed.steps.loop.controller, []
    for call in range(30):
        armed.ask("move", left_sweep_rad=0.02 * call)
        for _ in range(19):
            armed.steps.step()
            assert controller.joint_targets is not None
            velocities_rad_s.append(controller.joint_targets[0].velocity_rad_s)
    assert max(abs(b - a) for a, b in pairwise(velocities_rad_s)) < 0.1  # of 0.4 rad/s
    assert min(velocities_rad_s[100:]) > 0.1
    assert armed.ask("status")["drives"][0]["angle_rad"] == pytest.approx(0.55, abs=0.05)
    assert len(armed.events.about("move")) == 2


def test_joints_are_not_moved_in_the_mud_nor_against_a_present_fault(
    armed: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = FaultKind.CURRENT_STALE.fault("left_sweep")
    monkeypatch.setattr(Loop, "fault", fault)
    with pytest.raises(RefusedError, match=re.escape(fault.message)):
        armed.ask("move", left_sweep_rad=0.3)
    armed.steps.loop.controller.cut_short = True
    with pytest.raises(RefusedError, match="'mudskipper stop' raises them first"):
        armed.ask("move", left_sweep_rad=0.3)


@pytest.mark.parametrize(
    ("angles_rad", "message"),
    [
        ({}, "no joint is named: at least one of left_sweep_rad"),
        ({"tail_rad": 0.1}, "there is no parameter 'tail_rad'"),
        ({"left_sweep_rad": True}, "must be a number"),
        ({"left_sweep_rad": nan}, "must be a number"),
        ({"left_sweep_rad": 3.0}, "left_sweep = 171.9 degrees: must be from"),
        ({"right_adduction_rad": -3.0}, "right_adduction = -171.9 degrees: must be from"),
    ],
)
def test_an_invalid_move_is_refused_with_its_reason(armed: Robot, angles_rad: dict[str, Any], message: str) -> None:
    with pytest.raises(RefusedError, match=message):
        armed.ask("move", **angles_rad)
    assert not armed.ask("status")["moving"]


def test_what_moves_the_robot_refuses_unknown_parameters_and_other_methods_ignore_them(idle: Robot) -> None:
    for method in ("walk", "move", "stride"):
        with pytest.raises(RefusedError, match="there is no parameter 'wtaer' here"):
            idle.ask(method, wtaer="49")
    assert idle.ask("hello", later_version=1) == idle.ask("hello")
    assert idle.ask("stop", reason="lunch") == "accepted"


@pytest.mark.parametrize(("reported_v", "lowest_v"), [((nan, 23.0), 23.0), ((24.0, 23.0), 23.0), ((nan, nan), None)])
def test_a_flipper_whose_drives_report_no_voltage_hides_not_that_of_the_other(
    idle: Robot, reported_v: tuple[float, float], lowest_v: float | None
) -> None:
    closed = [ClosedStride(number, closed_stride(), 0.03, each_v) for number, each_v in enumerate(reported_v)]
    idle.steps.loop.learning.strides = closed
    assert idle.ask("status")["stride_supply_min_v"] == lowest_v


def test_a_walk_with_a_null_depth_adapts_its_depth(armed: Robot) -> None:
    assert armed.ask("walk", depth_m=None) == "accepted"
    assert armed.steps.loop.controller.order.adaptive
    with pytest.raises(RefusedError, match="strides = None: must be a whole number"):
        armed.ask("walk", strides=None)


def test_the_depth_of_a_walk_changes_with_the_next_stride_and_no_longer_adapts(armed: Robot) -> None:
    loop = armed.steps.loop
    with pytest.raises(RefusedError, match="hold"):
        armed.ask("depth", depth_m=0.02)
    assert armed.ask("status")["next_depth_m"] == loop.configuration.adaptation.initial_depth_m  # `joy` goes on from it
    armed.ask("walk")
    armed.run_until_stride(1)
    with pytest.raises(RefusedError, match="max_depth_m"):
        armed.ask("depth", depth_m=0.2)
    begun_m = loop.stride_depth_m
    armed.ask("depth", depth_m=0.02)
    armed.steps.step()
    assert loop.stride_depth_m == begun_m != 0.02
    report = armed.ask("status")
    assert (report["next_depth_m"], report["depth_reason"]) == (0.02, "fixed")
    armed.run_until_stride(2)
    assert loop.stride_depth_m == 0.02 and armed.events.texts.count(f"depth 0.0200 m by {ANNA}") == 1


def test_a_walk_takes_several_depths_in_turn_until_one_is_fixed(armed: Robot) -> None:
    loop, walked_m = armed.steps.loop, []
    for depths_m, depth_m in (([0.02, 0.2], None), ([0.02], 0.02), ([], None), ([0.02, "deep"], None)):
        with pytest.raises(RefusedError):
            armed.ask("walk", depths_m=depths_m, depth_m=depth_m)
    gait = as_json(gait_document("ellipse") | {"depths_m": [0.06]})
    with pytest.raises(RefusedError, match=r"ellipse\.toml: depths_m: depth 6 cm"):
        armed.ask("walk", gait=gait)
    with pytest.raises(RefusedError, match="^depth 6 cm"):
        armed.ask("walk", gait=gait, depth_m=0.06)
    armed.ask("walk", depths_m=[0.02, 0.03])
    for stride in range(3):
        armed.run_until_stride(stride)
        walked_m.append(loop.stride_depth_m)
    assert walked_m == [0.02, 0.03, 0.02]
    armed.ask("depth", depth_m=0.025)
    armed.run_until_stride(3)
    assert loop.stride_depth_m == 0.025


def test_strides_to_come_have_the_ordered_sweep_and_speeds_within_the_joints_reach(armed: Robot) -> None:
    loop = armed.steps.loop
    armed.ask("walk", depth_m=0.03)
    armed.run_until_stride(1)
    too_wide = (("sweep_angle_deg", 59.0), ("sweep_angle_deg", 61.0))  # the first does not reach 3 cm
    for key, value in (*too_wide, ("stance_speed_m_s", 0.0), ("sweep", 20.0)):
        with pytest.raises(RefusedError):
            armed.ask("stride", depth_m=0.03, **{key: value})  # type: ignore[arg-type]
    armed.ask("stride", depth_m=0.02, sweep_angle_deg=20.0, stance_speed_m_s=0.3)
    armed.steps.run_until(lambda: loop.target.stride == 2 and loop.target.phase is Phase.STANCE, 20.0)
    assert loop.stride_depth_m == 0.02
    widest_rad = loop.target.sweep_rad
    armed.steps.run_until(lambda: loop.target.phase is Phase.EXTRACTION, 20.0)
    assert widest_rad == pytest.approx(radians(20.0), abs=0.01) and loop.target.sweep_rad == -radians(20.0)
    assert loop.controller.gait.parameters.sweep_angle_deg == 30.0  # of the next walk
