"""The table of all faults: what a person reads of it, and that its columns do not contradict each other or the code."""

import ast
from string import ascii_lowercase

import pytest

from control.fault_kinds import KINDS, make_fault
from control.faults import Blocks, Clears, FaultKind, Reaction
from control.modes import Health, Mode, Request, next_mode
from tests.folders import ROOT

PACKAGES = ("control", "drivers", "estimation", "firmware_host")
CHECKS = {
    "drive", "watchdog", "bus", "joint", "flipper", "loop", "clock", "estimator", "pose", "lease", "log",
}  # fmt: skip
every_kind = pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))


def names_in(package: str) -> set[str]:
    """Strings that could be a fault's name, in code that makes faults; of f-strings, what they may become."""
    found: set[str] = set()
    for path in (ROOT / package).rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if path.name != "fault_kinds.py" and "import make_fault" in text:
            nodes = list(ast.walk(ast.parse(text)))
            found |= {str(node.value) for node in nodes if isinstance(node, ast.Constant)}
            found |= {name for node in nodes if isinstance(node, ast.JoinedStr) for name in _filled(node)}
    return found


def _filled(text: ast.JoinedStr) -> set[str]:
    """Names that an f-string like f"{what}_hot" may become: those of the kinds that end so."""
    last = text.values[-1]
    if not (isinstance(last, ast.Constant) and isinstance(last.value, str) and last.value.startswith("_")):
        return set()
    return {name for name in KINDS if name.endswith(last.value)}


def made_in_code() -> set[str]:
    return {name for package in PACKAGES for name in names_in(package)} & set(KINDS)


@every_kind
def test_a_kind_stands_under_its_own_name(kind: FaultKind) -> None:
    assert KINDS[kind.name] is kind
    assert set(kind.name) <= set(ascii_lowercase + "_")


def test_every_name_stands_once() -> None:
    """A dict would have kept the last of two without a word."""
    tree = ast.parse((ROOT / "control" / "fault_kinds.py").read_text(encoding="utf-8"))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    kinds = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "FaultKind"]
    assert len(kinds) == len(KINDS)


def test_no_two_kinds_mean_the_same() -> None:
    meanings = {kind.meaning for kind in KINDS.values()}
    assert len(meanings) == len(KINDS)


@every_kind
def test_what_it_means_reads_as_a_sentence(kind: FaultKind) -> None:
    assert kind.meaning[0].isupper()
    assert kind.meaning.endswith(".") and not kind.meaning.endswith("..")
    assert len(kind.meaning.split()) >= 3
    assert "|" not in kind.meaning + kind.what_to_do  # they are cells of a table in docs/faults.md


@every_kind
def test_what_to_do_reads_on_after_a_sentence_and_has_no_full_stop(kind: FaultKind) -> None:
    assert kind.what_to_do
    assert kind.what_to_do[0].islower() or kind.what_to_do[0] == "'"
    assert not kind.what_to_do.endswith(".")
    assert len(kind.what_to_do.split()) >= 3


@every_kind
def test_a_kind_belongs_to_a_line_of_the_check(kind: FaultKind) -> None:
    assert kind.check in CHECKS


@every_kind
def test_what_a_person_must_clear_says_so_or_how_to_mend_it(kind: FaultKind) -> None:
    if kind.clears is Clears.BY_RESTART:
        assert "restart" in kind.what_to_do
    if "clear" in kind.what_to_do:
        assert kind.clears is Clears.BY_HAND


@every_kind
def test_what_asks_for_more_than_a_warning_is_never_overruled_by_force(kind: FaultKind) -> None:
    """The modes refuse to arm then; a check that showed less would not say why."""
    if kind.reaction >= Reaction.HOLD:
        assert kind.blocks is Blocks.ALWAYS


@every_kind
def test_a_bug_takes_the_torque_off_at_once_and_only_a_restart_ends_it(kind: FaultKind) -> None:
    if kind.clears is Clears.BY_RESTART:
        assert (kind.reaction, kind.blocks) == (Reaction.DRIVES_IDLE, Blocks.ALWAYS)


@every_kind
def test_what_takes_the_torque_off_at_once_is_never_over_by_itself(kind: FaultKind) -> None:
    if kind.reaction is Reaction.DRIVES_IDLE:
        assert kind.clears is not Clears.WHEN_GONE


@every_kind
def test_what_a_person_must_clear_has_stopped_the_robot(kind: FaultKind) -> None:
    """`clear` is refused while torque is on: a latched warning could not be cleared."""
    if kind.clears is not Clears.WHEN_GONE:
        assert kind.reaction >= Reaction.SOFT_STOP


@every_kind
def test_a_kind_does_something(kind: FaultKind) -> None:
    assert kind.reaction > Reaction.NONE or kind.blocks is not Blocks.NO


@every_kind
def test_force_cannot_arm_against_what_the_modes_refuse(kind: FaultKind) -> None:
    fault = make_fault(kind.name, "", kind.meaning)
    health = Health(drives_heard=True, worst=fault)
    armed = next_mode(Mode.IDLE, Request.ARM, health) is Mode.ARMING
    assert armed == (kind.reaction < Reaction.HOLD)


@pytest.mark.parametrize(
    ("milder", "harder"),
    [
        ("drive_late", "drive_quiet"),
        ("drive_quiet", "drive_silent"),
        ("position_stale", "position_silent"),
        ("current_stale", "current_silent"),
        ("current_stale", "position_stale"),
        ("current_silent", "position_silent"),
        ("motor_overheating", "motor_hot"),
        ("winding_overheating", "winding_hot"),
        ("voltage_low", "voltage_under"),
        ("loop_overrun", "loop_lagging"),
        ("loop_lagging", "loop_stalled"),
        ("bus_warning", "bus_off"),
    ],
)
def test_the_worse_of_two_degrees_has_the_harder_reaction(milder: str, harder: str) -> None:
    assert KINDS[milder].reaction < KINDS[harder].reaction
    assert KINDS[milder].blocks <= KINDS[harder].blocks


@every_kind
def test_a_reaction_comes_within_a_time_that_is_stated(kind: FaultKind) -> None:
    assert 1 <= kind.bound_ticks <= 765


def test_every_kind_is_found_somewhere_in_the_code() -> None:
    assert set(KINDS) <= made_in_code()


def test_nothing_makes_a_fault_that_is_not_in_the_table() -> None:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "make_fault":
                    name = node.args[0]
                    assert not isinstance(name, ast.Constant) or name.value in KINDS, (path, ast.unparse(node))


def test_a_fault_of_an_unknown_name_is_a_mistake() -> None:
    with pytest.raises(KeyError):
        make_fault("drive_lost", "", "There is no such kind.")


def test_a_fault_is_told_by_its_kind_and_the_line_by_its_subject() -> None:
    fault = make_fault("joint_position", "left_sweep", "The left_sweep joint is out of its range.")
    assert (fault.name, fault.check) == ("joint_position", "joint.left_sweep")
    assert make_fault("loop_overrun", "", "The loop missed 1 of its ticks.").check == "loop"
