"""A configuration is accepted whole or refused by name, before anything is opened."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.gait.gait import SINGLE_FLIPPER
from control.records import JOINTS
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, Configuration
from firmware_host.configuration.loading import load_configuration, parse_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from tests.waiting import LONGEST_S


def problems_of(text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text)
    return caught.value.problems


def changed(text: str, key: str, value: str) -> str:
    """`key = …` set to another value where it stands first."""
    assert re.search(rf"^{key} = ", text, re.MULTILINE), key
    return re.sub(rf"^{key} = \S+", f"{key} = {value}", text, count=1, flags=re.MULTILINE)


def test_the_example_is_valid_and_names_all_joints(configuration: Configuration) -> None:
    assert set(configuration.drive) == set(JOINTS)
    assert configuration.torque_constants_nm_a == (0.083, 0.083, 0.083, 0.083)


def test_the_example_states_the_defaults(configuration: Configuration) -> None:
    """What the file shows to a newcomer is what he would get without it."""
    minimal = parse_configuration(minimal_text())
    for section in ("geometry", "arm", "gait", "limits", "adaptation", "gains", "motion", "loop"):
        assert getattr(configuration, section) == getattr(minimal, section), section


def minimal_text() -> str:
    drives = "".join(f'[drive.{joint}]\nbus = "a"\nnode_id = {place}\n' for place, joint in enumerate(JOINTS))
    return f'[bus.a]\ninterface = "virtual"\nchannel = "x"\n{drives}'


def test_an_unknown_key_is_refused_by_name(example_text: str) -> None:
    text = example_text.replace("torque_nm = 0.75", "torque_nm = 0.75\ntorqe_nm = 0.5")
    assert problems_of(text) == ["limits.torqe_nm: there is no such key"]


def test_an_unknown_section_is_refused_by_name(example_text: str) -> None:
    assert problems_of(example_text + "\n[gaitt]\nx = 1\n") == ["gaitt: there is no such key"]


def test_a_value_out_of_bounds_is_refused_with_key_value_and_bound(example_text: str) -> None:
    assert problems_of(changed(example_text, "torque_nm", "9.5")) == ["limits.torque_nm = 9.5: must be at most 5.0"]
    assert problems_of(changed(example_text, "node_id", "-1")) == ["drive.left_sweep.node_id = -1: must be at least 0"]


def test_all_problems_are_told_at_once(example_text: str) -> None:
    text = changed(changed(example_text, "torque_nm", "9.5"), "plate_width_m", "7")
    assert len(problems_of(text)) == 2


def test_a_missing_drive_is_refused_by_name(example_text: str) -> None:
    text = example_text.replace("[drive.right_sweep]", "[drive.right_swep]")
    reported = "\n".join(problems_of(text))
    assert "drive.right_sweep is missing" in reported
    assert "drive.right_swep: there is no such joint" in reported


def test_a_missing_bus_is_refused_by_name() -> None:
    text = minimal_text().replace("[bus.a]", "[bus.b]")
    assert any("drive.left_sweep.bus = 'a': no such bus; there is b" in reported for reported in problems_of(text))


def test_two_drives_with_one_id_on_one_bus_are_refused() -> None:
    reported = problems_of(minimal_text().replace("node_id = 3", "node_id = 2"))
    assert reported == ["drive.right_adduction.node_id = 2: right_sweep has the same on bus 'a'"]


def test_a_depth_out_of_reach_is_refused_with_the_bound(example_text: str) -> None:
    (reported,) = problems_of(changed(example_text, "max_depth_m", "0.06"))
    assert reported.startswith("adaptation.max_depth_m = 0.06: out of reach, must be at most 0.0504")


def test_a_wider_sweep_reaches_less_deep(example_text: str) -> None:
    text = changed(example_text, "sweep_angle_deg", "35.0")
    assert any("out of reach" in reported for reported in problems_of(text))


def test_depths_in_the_wrong_order_are_refused(example_text: str) -> None:
    text = changed(example_text, "initial_depth_m", "0.06")
    assert any("initial_depth_m = 0.06" in message for message in problems_of(text))
    reported = problems_of(changed(changed(example_text, "min_depth_m", "0.04"), "max_depth_m", "0.035"))
    assert any("min_depth_m = 0.04: must be at most" in message for message in reported)


def test_joint_limits_must_leave_room_for_the_gait(example_text: str) -> None:
    text = example_text.replace("torque_nm = 0.75", "sweep_max_deg = 25.0\nadduction_min_deg = -30.0")
    reported = "\n".join(problems_of(text))
    assert "limits.sweep_max_deg = 25.0: must be at least 30" in reported
    assert "limits.adduction_min_deg = -30.0: must be at most -57" in reported


def test_a_sign_of_zero_is_refused(example_text: str) -> None:
    assert problems_of(changed(example_text, "sign", "0")) == ["drive.left_sweep.sign = 0: must be 1 or -1"]


@pytest.mark.parametrize("value", ['"0.75"', "true", "nan", "inf", "[0.75]"])
def test_a_value_of_the_wrong_kind_is_refused(example_text: str, value: str) -> None:
    (reported,) = problems_of(changed(example_text, "torque_nm", value))
    assert reported.startswith("limits.torque_nm = ")


def test_a_protocol_is_a_preset_that_other_keys_change(example_text: str) -> None:
    text = example_text.replace('protocol = "walking"', 'protocol = "single_flipper"')
    gait = parse_configuration(text.replace("swing_duration_s = 0.8", "pause_s = 1.0")).gait
    assert gait.stance_speed_m_s == SINGLE_FLIPPER.stance_speed_m_s == 0.1
    assert gait.pause_s == 1.0


def test_an_unknown_protocol_is_refused(example_text: str) -> None:
    (reported,) = problems_of(example_text.replace('"walking"', '"galloping"'))
    assert reported == "gait.protocol = 'galloping': must be one of walking, single_flipper"


def test_something_that_is_no_toml_names_the_line(example_text: str) -> None:
    (reported,) = problems_of("[geometry\n")
    assert reported.startswith("not a TOML file") and "line 1" in reported


@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        ('name = "mudskipper"', 'name = "../../x"', "robot.name = '../../x': must be 1 to 64"),
        ('name = "mudskipper"', 'name = ""', "robot.name = '': must be 1 to 64"),
        ("/run/mudskipper/mudskipper.sock", "a\\u0000b", "status.socket = 'a\\x00b': must be at most 107 bytes"),
        ("/run/mudskipper/mudskipper.sock", "x" * 120, "must be at most 107 bytes"),
        ("/run/mudskipper/mudskipper.sock", "", "status.socket = '': must name a socket"),
    ],
)
def test_texts_that_cannot_be_used_are_refused(example_text: str, old: str, new: str, reported: str) -> None:
    assert reported in problems_of(example_text.replace(old, new))[0]


@pytest.mark.parametrize("key", ["sweep_stiffness_nm_rad", "adduction_stiffness_nm_rad"])
def test_a_recovery_s_lead_that_does_not_reach_the_full_torque_is_refused(example_text: str, key: str) -> None:
    """0.75 N·m over 8 degrees are 5.37 N·m/rad."""
    (reported,) = problems_of(f"{example_text}\n[gains]\n{key} = 5.3\n")
    assert reported == (
        f"gains.{key} = 5.3: must be at least 5.38, or a recovery.lead_deg = 8 does not reach limits.torque_nm = 0.75"
    )
    parse_configuration(f"{example_text}\n[gains]\n{key} = 5.38\n")
    longer = changed(example_text, "attempts", "3\nlead_deg = 8.2")
    parse_configuration(f"{longer}\n[gains]\n{key} = 5.3\n")
    parse_configuration(f"{changed(example_text, 'attempts', '0')}\n[gains]\n{key} = 0.0\n")


def test_a_motor_force_beyond_the_torque_limit_is_refused(example_text: str) -> None:
    """0.75 N·m at 0.12 m are 6.25 N."""
    parse_configuration(changed(example_text, "motor_force_n", "6.25"))
    assert problems_of(changed(example_text, "motor_force_n", "6.26")) == [
        "adaptation.motor_force_n = 6.26: must be at most 6.25 for limits.torque_nm = 0.75"
        " and geometry.flipper_length_m = 0.12"
    ]


def test_a_joint_without_inertia_is_refused(example_text: str) -> None:
    text = example_text.replace("[arm]", "[arm]\nsweep_inertia_kg_m2 = 0.0")
    assert problems_of(text) == ["arm.sweep_inertia_kg_m2 = 0.0: must be at least 1e-05"]


def test_a_current_limit_below_the_torque_limit_is_refused(example_text: str) -> None:
    text = example_text.replace("node_id = 0", "node_id = 0\ncurrent_limit_a = 5.0")
    assert problems_of(text) == [
        "drive.left_sweep.current_limit_a = 5.0: must be at least 9.04 for limits.torque_nm = 0.75"
    ]


@pytest.mark.parametrize(
    ("milder", "harder"), [("late_s", "quiet_s"), ("quiet_s", "silence_s"), ("lag_s", "silence_s")]
)
def test_a_harder_reaction_may_not_come_before_a_milder_one(milder: str, harder: str) -> None:
    others = "".join(f"{key} = 0.2\n" for key in {"late_s", "quiet_s", "lag_s", "silence_s"} - {milder, harder})
    if milder == "quiet_s":
        others = others.replace("late_s = 0.2", "late_s = 0.01")
    if milder == "late_s":
        others = others.replace("silence_s = 0.2", "silence_s = 0.4")
    text = f"{minimal_text()}\n[faults]\n{others}"
    wrong = text + f"{milder} = 0.3\n{harder} = 0.25\n"
    assert problems_of(wrong) == [f"faults.{milder} = 0.3: must be at most faults.{harder} = 0.25"]
    parse_configuration(text + f"{milder} = 0.25\n{harder} = 0.25\n")


def test_the_least_voltage_must_not_be_above_the_low_one() -> None:
    wrong = f"{minimal_text()}\n[faults]\nvoltage_low_v = 20.0\nvoltage_min_v = 20.5\n"
    assert problems_of(wrong) == ["faults.voltage_min_v = 20.5: must be at most faults.voltage_low_v = 20.0"]
    parse_configuration(f"{minimal_text()}\n[faults]\nvoltage_low_v = 0.0\nvoltage_min_v = 0.0\n")


def test_a_room_in_which_every_motor_counts_as_hot_is_refused() -> None:
    text = f"{minimal_text()}\n[limits]\ntemperature_warm_c = 40.0\ntemperature_hot_c = 60.0\n"
    (problem,) = problems_of(f"{text}\n[winding]\nroom_c = 50.0\n")
    assert problem.startswith("winding.room_c = 50.0: must be less than 50, ")
    parse_configuration(f"{text}\n[winding]\nroom_c = 49.0\n")


@pytest.mark.parametrize("line", ["quiet_s = 0.0", "silence_s = nan", "lag_fraction = 0.0", "late_s = true"])
def test_bounds_of_faults_have_bounds_themselves(line: str) -> None:
    problems = problems_of(f"{minimal_text()}\n[faults]\n{line}\n")
    assert any(problem.startswith(f"faults.{line.split()[0]} = ") for problem in problems)


def test_endless_numbers_and_nesting_are_no_toml() -> None:
    assert problems_of("x = " + "9" * 5000)[0].startswith("not a TOML file")
    assert problems_of("x = " + "[" * 5000)[0].startswith("not a TOML file")


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        load_configuration(tmp_path / "none.toml")


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_bytes(b"a = 1\n# gr\xfc\xdf\n")
    with pytest.raises(ConfigurationError, match=r"x\.toml: not UTF-8 text \(at line 2\); save the file as UTF-8"):
        load_configuration(path)


TOML_VALUES = st.one_of(
    st.integers(-(2**40), 2**40).map(str),
    st.floats(allow_nan=True).map(lambda x: repr(x)),
    st.booleans().map(lambda x: str(x).lower()),
    st.sampled_from(['""', '"x"', "[]", "{}", "[1, 2]", "{ a = 1 }"]),
)
KEYS = st.sampled_from(
    ["geometry.drop_m", "gait.pause_s", "gait.protocol", "limits.torque_nm", "drive.left_sweep.bus", "bus.a.options",
     "adaptation.max_depth_m", "robot.name", "loop", "drive", "bus", "geometry", "gait", "nonsense.key", "text"]
)  # fmt: skip


@pytest.mark.parametrize("name", ['"odrive"', '"moteus"', "7"])
def test_the_type_of_a_drive_is_one_of_the_table(example_text: str, name: str) -> None:
    text = example_text.replace("[drive.left_sweep]\n", f"[drive.left_sweep]\ntype = {name}\n")
    if name == '"odrive"':
        assert parse_configuration(text).drive == parse_configuration(example_text).drive
        return
    with pytest.raises(ConfigurationError) as refused:
        parse_configuration(text)
    (problem,) = refused.value.problems
    assert problem.startswith("drive.left_sweep.type = ") and problem.endswith("must be one of odrive")


@given(KEYS, TOML_VALUES)
def test_any_value_anywhere_is_accepted_or_refused_by_name(key: str, value: str) -> None:
    """Never another exception than ConfigurationError."""
    try:
        parse_configuration(f"{key} = {value}\n{minimal_text()}")
    except ConfigurationError as problem:
        assert problem.problems and all(problem.problems)


def test_the_daemon_refuses_with_status_78_and_no_traceback(tmp_path: Path, example_text: str) -> None:
    path = tmp_path / "mudskipper.toml"
    path.write_text(changed(example_text, "torque_nm", "99"), encoding="utf-8")
    command = [sys.executable, "-m", "firmware_host.daemon", "--config", str(path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    assert ended.returncode == EXIT_CONFIGURATION == 78
    assert ended.stderr == "mudskipperd: limits.torque_nm = 99: must be at most 5.0\n"


@pytest.mark.parametrize("option", [[], ["--check-config"]])
def test_a_group_that_does_not_exist_is_refused_before_anything_is_made(
    short_folder: Path, example_text: str, option: list[str]
) -> None:
    socket = short_folder / "folder" / "s"
    text = example_text.replace("/run/mudskipper/mudskipper.sock", str(socket))
    text = text.replace("[status]", '[status]\nread_group = "no such"\n')
    (short_folder / "mudskipper.toml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "firmware_host.daemon", "--config", str(short_folder / "mudskipper.toml"), *option]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    assert ended.returncode == EXIT_CONFIGURATION
    assert ended.stderr.startswith("mudskipperd: status.read_group = 'no such': there is no such group")
    assert ended.stderr.count("\n") == 1 and not socket.parent.exists()


@pytest.mark.parametrize("key", ["read_group", "drive_group"])
def test_a_group_s_name_holds_no_zero_byte(example_text: str, key: str) -> None:
    with pytest.raises(ConfigurationError, match=f"status.{key}: must be without a zero byte"):
        parse_configuration(example_text.replace("[status]", f'[status]\n{key} = "a\\u0000b"'))
