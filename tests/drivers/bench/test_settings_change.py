"""Wherever the writing of settings is interrupted, the drive ends with all the old or all the new ones, as reported."""

from collections.abc import Callable
from math import inf, isnan, nan
from typing import Any

import pytest

from drivers.bench.bench_port import NoAnswerError
from drivers.bench.drive_bench import SetupFacts
from drivers.bench.drive_setup import DriveSetup, same
from drivers.bench.settings_change import Change, Names, Outcome, change_settings
from drivers.drive_types import DRIVE_BENCHES, DRIVE_TYPES
from simulation.devices.odrive.settings import BUILD
from simulation.devices.simulated_drive import SimulatedDrive
from tests.drivers.bench.simulated_bus import SimulatedBus, simulated

ID, LONGEST_S = 3, 0.3
each_type = pytest.mark.parametrize("name", ["odrive", "moteus", "mit"])
FIRST: dict[str, Any] = {
    "watchdog_s": 0.0,
    "torque_constant_nm_a": 0.07,
    "current_limit_a": 6.0,
    "heartbeat_period_s": 0.5,
}


class Bench:
    """One drive of a type with other settings than the configuration wants."""

    def __init__(self, name: str, **changes: Any) -> None:
        self.device: SimulatedDrive = simulated(name, ID, "0badcafe", **(FIRST | changes))
        self.bus = SimulatedBus(self.device)
        parameters = DRIVE_TYPES[name].parameters(bus="can", node_id=ID, type=name)
        facts = SetupFacts(parameters, LONGEST_S, (), [BUILD])
        self.drive: DriveSetup = DRIVE_BENCHES[name].open_setup(self.bus.bench_port(), facts)
        self.drive.identify()
        self.first = self.read()
        differing = [each for each in self.drive.settings() if not each.accepts(self.first[each.key])]
        self.new = {each.key: each.wanted for each in differing if not each.read_only}
        self.old = {key: self.first[key] for key in self.new}
        self.begin = len(self.bus.sent)

    def read(self) -> dict[str, float]:
        return {each.key: self.drive.read(each.key) for each in self.drive.settings()}

    def change(self, interrupt_after: float = inf) -> Change:
        calls = iter(range(10**6))
        return change_settings(self.drive, self.old, self.new, lambda: next(calls) >= interrupt_after, Names())

    @property
    def frames(self) -> int:
        return len(self.bus.sent) - self.begin

    def state(self) -> str:
        """Return which settings the drive has now."""
        found = self.read()
        fitting = [
            name
            for name, wanted in (("old", self.old), ("new", self.new))
            if all(same(found[key], value) for key, value in wanted.items())
        ]
        others = all(same(found[key], value) for key, value in self.first.items() if key not in self.new)
        return fitting[0] if fitting and others else f"mixed: {found}"

    def switch_off_and_on(self) -> None:
        self.bus.unplugged_after = 10**9
        self.device.restart(self.bus.now_s)
        self.bus.sleep(3.0)


@each_type
def test_settings_that_differ_are_written_and_outlast_a_restart(name: str) -> None:
    bench = Bench(name)
    assert len(bench.new) >= 1
    assert bench.change().outcome is Outcome.NEW
    assert bench.state() == "new"
    bench.switch_off_and_on()
    assert bench.state() == "new"
    assert all(each.accepts(bench.read()[each.key]) for each in bench.drive.settings() if not each.read_only)
    assert not bench.bus.energised


@each_type
def test_an_interrupted_change_leaves_the_old_settings(name: str) -> None:
    """Ctrl-C comes before any setting, or before the storing."""
    for calls in range(len(Bench(name).new) + 1):
        bench = Bench(name)
        assert bench.change(interrupt_after=calls).outcome is Outcome.OLD
        assert bench.state() == "old"
        bench.switch_off_and_on()
        assert bench.state() == "old"


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("odrive", "axis0.config.can.encoder_msg_rate_ms", -1.0),
        ("odrive", "axis0.config.can.encoder_msg_rate_ms", nan),
        ("odrive", "axis0.controller.config.vel_limit", 1e40),
        ("mit", "TIMEOUT", inf),
        ("mit", "PMAX", 1e40),
    ],
)
def test_a_number_that_the_drive_cannot_hold_leaves_the_old_settings(name: str, key: str, value: float) -> None:
    """A file to restore may say anything; the settings before that number have been written then."""
    bench = Bench(name)
    bench.new |= {key: value}
    bench.old = {each: bench.first[each] for each in bench.new}
    change = bench.change()
    assert (change.outcome, bench.state()) == (Outcome.OLD, "old")
    assert f"{key} cannot be {value:g}" in change.text


def test_a_limit_of_infinity_is_a_setting_that_can_be_restored() -> None:
    bench = Bench("odrive")
    limit = "axis0.controller.config.vel_limit"
    bench.new, bench.old = {limit: inf}, {limit: bench.first[limit]}
    assert bench.state() == "old" and not same(1e30, inf)
    assert bench.change().outcome is Outcome.NEW
    bench.switch_off_and_on()
    assert bench.drive.read(limit) == inf


def unplug(bench: Bench, frame: int) -> None:
    bench.bus.unplugged_after = frame


def cut_supply(bench: Bench, frame: int) -> None:
    """Let the drive restart after a frame; it answers again a moment later."""
    bench.bus.at_frame = (frame, lambda: bench.device.restart(bench.bus.now_s))


def dip_supply(bench: Bench, frame: int) -> None:
    """Let the drive restart after a frame, and answer the next one already."""
    bench.device.boot_s = 0.0
    cut_supply(bench, frame)


@each_type
@pytest.mark.parametrize(
    ("fail", "outcomes"),
    [(unplug, {Outcome.OLD_AFTER_RESTART, Outcome.UNKNOWN}), (cut_supply, set()), (dip_supply, set())],
)
def test_a_cable_or_a_supply_that_fails_at_any_frame_leaves_the_old_or_the_new_settings(
    name: str, fail: Callable[[Bench, int], None], outcomes: set[Outcome]
) -> None:
    whole, seen = Bench(name), set[Outcome]()
    whole.change()
    for frames in range(whole.frames):
        bench = Bench(name)
        fail(bench, bench.begin + frames)
        outcome = bench.change().outcome
        seen.add(outcome)
        bench.switch_off_and_on()
        allowed = {Outcome.NEW: ("new",), Outcome.UNKNOWN: ("old", "new")}.get(outcome, ("old",))
        assert bench.state() in allowed, (frames, outcome)
    assert outcomes <= seen


@each_type
def test_nothing_is_written_while_torque_is_on(name: str) -> None:
    bench = Bench(name)
    bench.device.energised = True
    change = bench.change()
    assert "not idle" in change.text and change.outcome is Outcome.OLD
    assert bench.frames == 1 and bench.state() == "old"


@each_type
def test_no_frame_of_a_setup_is_a_command_of_torque(name: str) -> None:
    bench = Bench(name)
    bench.change()
    parameters = DRIVE_TYPES[name].parameters(bus="can", node_id=ID, type=name)
    table = DRIVE_TYPES[name].gate_table(parameters)
    closing = {payload for payloads in table.while_open.values() for payload in payloads}
    for frame in bench.bus.sent:
        assert isnan(table.decode_torque(frame.data)) or frame.arbitration_id != table.torque_id
        assert frame.data not in closing


@each_type
def test_a_silent_drive_is_named_by_what_it_was_asked(name: str) -> None:
    bench = Bench(name)
    bench.bus.unplugged_after = 0
    with pytest.raises(NoAnswerError, match="no answer to"):
        bench.drive.identify()


def test_an_odrive_without_the_numbers_of_its_build_says_which_file_is_missing() -> None:
    bus = SimulatedBus(simulated("odrive", ID))
    parameters = DRIVE_TYPES["odrive"].parameters(bus="can", node_id=ID)
    other = BUILD | {"hw_version": "4.4.58"}
    drive = DRIVE_BENCHES["odrive"].open_setup(bus.bench_port(), SetupFacts(parameters, LONGEST_S, (), [other]))
    drive.identify()
    with pytest.raises(Exception, match="firmware 0.6.11, hardware 0.0.0"):
        drive.read("axis0.config.watchdog_timeout")


@pytest.mark.parametrize(
    ("name", "settings", "text"),
    [("odrive05", {}, "odrivetool"), ("mit", {"model": "AK80-9"}, "neither read nor written")],
)
def test_a_drive_whose_settings_cannot_be_changed_says_so(name: str, settings: dict[str, Any], text: str) -> None:
    parameters = DRIVE_TYPES[name].parameters(bus="can", node_id=ID, type=name, **settings)
    drive = DRIVE_BENCHES[name].open_setup(SimulatedBus().bench_port(), SetupFacts(parameters, LONGEST_S))
    assert text in drive.cannot and not drive.settings()


@pytest.mark.parametrize(
    ("name", "identifier", "data"),
    [
        ("odrive", 0x64, "01 01 00 00 cd cc cc 3d"),  # writes 0.1 to parameter 1
        ("odrive", 0x76, "01"),  # stores and restarts
        ("moteus", 0x8003, "40 01 0b 63 6f 6e 66 20 77 72 69 74 65 0a 42 01 30 50 50 50"),  # conf write, and a poll
        ("mit", 0x7FF, "03 00 55 09 d0 07 00 00"),  # 2000 times 50 µs
        ("mit", 0x7FF, "03 00 aa 01 00 00 00 00"),  # stores
    ],
)
def test_the_frames_that_write_and_store(name: str, identifier: int, data: str) -> None:
    """The bytes are those of examples/can_param_access.py of ODrive, docs/protocol of moteus, and damiao-motor
    1.0.6.
    """
    bench = Bench(name)
    bench.change()
    assert (identifier, bytes.fromhex(data)) in {(frame.arbitration_id, frame.data) for frame in bench.bus.sent}
