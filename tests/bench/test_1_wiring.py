"""Stage 1: nothing moves, nothing is armed."""

from experiments.bench import wiring_check
from tests.bench.staged_bench import StagedBench


def test_every_drive_is_heard_under_its_id_on_its_bus(bench: StagedBench) -> None:
    bench.check(wiring_check.check_ids)


def test_no_other_sender_is_on_the_buses(bench: StagedBench) -> None:
    bench.check(wiring_check.check_unknown_ids)


def test_messages_come_as_often_as_control_needs_them(bench: StagedBench) -> None:
    bench.check(wiring_check.check_message_rates)


def test_the_buses_have_room_for_the_commands(bench: StagedBench) -> None:
    bench.check(wiring_check.check_bus_loads)


def test_the_drives_have_firmware_whose_messages_are_known(bench: StagedBench) -> None:
    bench.check(wiring_check.check_firmware)


def test_the_drives_watchdogs_are_on_and_quick(bench: StagedBench) -> None:
    bench.check(wiring_check.check_watchdogs)


def test_nothing_is_lost_and_no_drive_is_in_error(bench: StagedBench) -> None:
    bench.check(wiring_check.check_quiet_buses)
