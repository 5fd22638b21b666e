"""A configuration is accepted as a whole, or refused with the names of the wrong keys before anything is opened."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from control.records import JOINTS
from firmware_host.configuration.configuration import EXIT_CONFIGURATION, Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_file import PROTOCOLS
from firmware_host.configuration.loading import PATHS, load_configuration, parse_configuration
from firmware_host.daemon import main
from simulation.harness.drive_presets import calibrated


def problems_of(text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text)
    return caught.value.problems


def changed(text: str, key: str, value: str) -> str:
    """Return the text with another value in the first line `key = …`."""
    assert re.search(rf"^{key} = ", text, re.MULTILINE), key
    return re.sub(rf"^{key} = \S+", f"{key} = {value}", text, count=1, flags=re.MULTILINE)


def test_the_example_is_valid_and_names_all_joints(configuration: Configuration, example_text: str) -> None:
    assert set(configuration.drive) == set(JOINTS)
    assert configuration.torque_constants_nm_a == (0.083, 0.083, 0.083, 0.083)
    typed = example_text.replace("[drive.left_sweep]", '[drive.left_sweep]\ntype = "odrive"')
    assert parse_configuration(calibrated(typed)).drive == configuration.drive


def test_the_example_states_the_defaults(configuration: Configuration) -> None:
    """A robot without these sections in its file behaves like the example."""
    minimal = parse_configuration(minimal_text())
    for section in ("geometry", "arm", "gait", "limits", "adaptation", "gains", "motion", "loop"):
        assert getattr(configuration, section) == getattr(minimal, section), section


def minimal_text() -> str:
    drives = "".join(f'[drive.{joint}]\nbus = "a"\nnode_id = {number}\n' for number, joint in enumerate(JOINTS))
    return f'[bus.a]\ninterface = "virtual"\nchannel = "x"\n{drives}'


Capture = pytest.CaptureFixture[str]
SOCKET = "/run/mudskipper/mudskipper.sock"
REFUSED = [  # a text of the example, its replacement, and the beginnings of the messages
    ("torque_nm = 0.75", "torqe_nm = 0.5", ["limits.torqe_nm: there is no such key"]),
    ("torque_nm = 0.75", "torque_nm = 9.5", ["limits.torque_nm = 9.5: must be at most 5.0"]),
    ("torque_nm = 0.75", 'torque_nm = "0.75"', ["limits.torque_nm = '0.75': should be a valid number"]),
    ("[status]", '[pose]\nsource = "rail_encoder"\nrail_encoder = { device = "/dev/ttyACM0" }\n[status]', [
        "pose.rail_encoder.metres_per_count = 0.0: must be given"
    ]),
    ("[bus.left]", "[bus.left]\noptions = { a = [1] }", [
        f"bus.left.options.a = [1]: should be a valid {kind}" for kind in ("string", "integer", "number", "boolean")
    ]),
    ("[adaptation]", '[adaptation]\nmethod = "gait"\ngait = { max_sweep_deg = 60.0 }', [
        "adaptation.gait.max_sweep_deg = 60.0: reaches 0.0130 m, less than adaptation.min_depth_m = 0.015"
    ]),
    ("torque_nm = 0.75", "torque_nm = 0.75\nsweep_min_deg = -25.0", [
        "limits.sweep_min_deg = -25.0: must be at most -30"
    ]),
    ("torque_nm = 0.75", "torque_nm = 0.75\ntemperature_warm_c = 85.0\ntemperature_hot_c = 80.0", [
        "limits.temperature_warm_c = 85.0: must be at most limits.temperature_hot_c = 80.0"
    ]),
    ("torque_nm = 0.75", "torque_nm = 0.75\nsweep_max_deg = 25.0", [
        "limits.sweep_max_deg = 25.0: must be at least 30"
    ]),
    ("torque_nm = 0.75", "torque_nm = 0.75\nadduction_min_deg = -30.0", [
        "limits.adduction_min_deg = -30.0: must be at most -57"
    ]),
    ("node_id = 0", "node_id = -1", ["drive.left_sweep.node_id = -1: must be at least 0"]),
    ("node_id = 0", "node_id = 0\ncurrent_limit_a = 5.0", [
        "drive.left_sweep.current_limit_a = 5.0: must be at least 9.04 for limits.torque_nm = 0.75"
    ]),
    ("[drive.left_sweep]", '[drive.left_sweep]\ntype = "vesc"', [
        "drive.left_sweep.type = 'vesc': there is no such type; there are odrive, moteus, mit"
    ]),
    ("[drive.left_sweep]", '[drive.left_sweep]\nserial_number = "385F324D3037"', [
        "drive.left_sweep.serial_number = '385F324D3037': must be 12 hexadecimal digits in lower case"
    ]),
    ("[drive.left_sweep]", '[drive.left_sweep]\ntype = "moteus"', ["drive.left_sweep.node_id = 0: must be at least 1"]),
    ("node_id = 0", 'node_id = 5\ntype = "moteus"', [
        "drive.left_sweep.type = 'moteus': uses CAN FD, which disturbs drive.left_adduction (odrive) on the same"
    ]),
    ("node_id = 0", 'node_id = 5\ntype = "mit"\nmodel = "AK80-10"\nproven_watchdog = { watchdog_s = 0.3 }', [
        "drive.left_sweep.model = 'AK80-10': must be one of AK10-9, AK60-6"
    ]),
    ("node_id = 0", 'node_id = 16\ntype = "mit"', ["drive.left_sweep.node_id = 16: must be at most 15"]),
    ("node_id = 0", 'node_id = 5\ntype = "mit"\nmodel = "AK80-9"\nvelocity_range_rad_s = 0.0', [
        "drive.left_sweep.velocity_range_rad_s = 0: must be 1 to 500, or -1 for that of the model"
    ]),
    *[
        ("node_id = 0", 'node_id = 5\ntype = "mit"\nmodel = "AK80-9"\nfirmware_date = "2026-11-01"\n'
         f'proven_watchdog = {{ watchdog_s = 0.3, bus = "{bus}", node_id = {node_id}, model = "{model}",'
         f' date = "{date}" }}',
         [f"drive.left_sweep.proven_watchdog.{problem}"])
        for bus, node_id, model, date, problem in (
            ("right", 5, "AK80-9", "2026-11-24", "bus = 'right': must be 'left'"),
            ("left", 6, "AK80-9", "2026-11-24", "node_id = 6: must be 5"),
            ("left", 5, "AK80-9", "2026-10-31", "date = 2026-10-31: must be at least firmware_date = 2026-11-01"),
            ("left", 5, "AK80-9", "", "date = '': must be the date of the trial"),
        )
    ],
    *[
        ("[drive.left_sweep]", f'[drive.left_sweep]\n{keys}', [f"drive.left_sweep.{problem}"])
        for keys, problem in (
            ('calibrated = { date = "2026-11-28", drive = "left 1" }', "calibrated.drive = 'left 1': must be 'left 0'"),
            ('calibrated = { date = "2026-11-28", drive = "left 0" }\nserial_number = "385f324d3037"',
             "calibrated.drive = 'left 0': must be '385f324d3037'"),
            ('calibrated = { drive = "left 0" }', "calibrated.date = '': must be the date of the calibration"),
            ('calibrated = { date = "2026-11-28", drive = "left 0" }\nfirmware_date = "2026-11-29"',
             "calibrated.date = 2026-11-28: must be at least firmware_date = 2026-11-29"),
        )
    ],
    ("node_id = 0", 'node_id = 5\ntype = "mit"\nmodel = "AK80-9"\n'
     'calibrated = { date = "2026-11-28", drive = "left 5 AK60-6" }', [
        "drive.left_sweep.calibrated.drive = 'left 5 AK60-6': must be 'left 5 AK80-9'"
    ]),
    ("node_id = 0", 'node_id = 5\ntype = "mit"\nproven_watchdog = { watchdog_s = 0.3 }', [
        "drive.left_sweep.proven_watchdog.watchdog_s = 0.3: must be 0: a DM4310 reports its own"
    ]),
    ("node_id = 0", 'node_id = 5\ntype = "mit"\nmodel = "AK80-9"\ntorque_range_nm = 9.0', [
        "drive.left_sweep.torque_range_nm = 9: must be 0: that of an AK80-9 is fixed"
    ]),
    ("node_id = 0", 'node_id = 5\ntype = "mit"\ntorque_range_nm = 0.5', [
        "drive.left_sweep.torque_range_nm = 0.5: its codes end at 0.5 N·m, and limits.torque_nm = 0.75"
    ]),
    ("node_id = 0", 'node_id = 5\ntype = "mit"\nmodel = "AK80-9"\nserial_number = "0badcafe"', [
        "drive.left_sweep.serial_number = '0badcafe': must be empty: that of an AK80-9 cannot be read"
    ]),
    ("node_id = 1", 'node_id = 2\ntype = "mit"', [
        "drive.left_adduction.node_id = 2: as mit it uses the arbitration id 0x000 on bus 'left', and so does"
        " drive.left_sweep.node_id = 0 as odrive; give one of them another id, or put them on two buses"
    ]),
    ("[drive.right_sweep]", "[drive.right_swep]", [
        "drive.right_sweep is missing: ", "drive.right_swep: there is no such joint"
    ]),
    ('"walking"', '"galloping"', ["gait.protocol = 'galloping': there is no such protocol; did you mean walking?"]),
    ('name = "mudskipper"', 'name = "../../x"', ["robot.name = '../../x': must be 1 to 64"]),
    (SOCKET, "a\\u0000b", ["status.socket = 'a\\x00b': must be at most 97 bytes"]),
    (SOCKET, "x" * 120, [f"status.socket = '{'x' * 120}': must be at most 97 bytes"]),
    (SOCKET, "/", ["status.socket = '/': must name a socket"]),
    *[
        ("[status]", f'[pose]\nsocket = "/run/mudskipper/./{name}.sock"\n[status]', [
            f"pose.socket = '/run/mudskipper/./{name}.sock': must be another socket than status.socket"
        ])
        for name in ("mudskipper", "mudskipper-rows", "mudskipper-operators")
    ],
    ("[status]", '[emergency_stop]\nsource = "key"\n[status]', [
        "emergency_stop.device = '': must be given", "emergency_stop.key = '': must be given"
    ]),
    ("[status]", '[status]\nread_group = "a\\u0000b"', ["status.read_group: must be without a zero byte"]),
    ('directory = "', 'directory = "a\\u0000', ["log.directory = 'a\\x00/var/lib/mudskipper/logs': must be"]),
    ("max_depth_m = 0.05", "max_depth_m = 0.06", ["adaptation.max_depth_m = 0.06: out of reach, must be at most 0.05"]),
    ("sweep_angle_deg = 30.0", "sweep_angle_deg = 35.0", ["adaptation.max_depth_m = 0.05: out of reach"]),
    ("initial_depth_m = 0.03", "initial_depth_m = 0.06", ["adaptation.initial_depth_m = 0.06: must be from"]),
    ("min_depth_m = 0.015", "min_depth_m = 0.06", [
        "adaptation.initial_depth_m = 0.03: must be from", "adaptation.min_depth_m = 0.06: must be at most"
    ]),
    ("drop_m = 0.050", "drop_m = 0.0645", ["geometry.axis_height_m = 0.0645: must be more than geometry.drop_m"]),
    ("torque_nm = 0.75", "torque_nm = 0.75\nadduction_max_deg = -1.0", [
        "limits.adduction_max_deg = -1.0: must be at least 0, the raised arm"
    ]),
    ("sign = 1", "sign = 0", ["drive.left_sweep.sign = 0: must be 1 or -1"]),
    ("free_body = false", "free_body = true\nfixed_base = true", [
        "estimation.free_body = true: no body on a fixed base is free"
    ]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "messages"), REFUSED)
def test_a_wrong_value_is_refused_by_its_key(example_text: str, old: str, new: str, messages: list[str]) -> None:
    assert old in example_text
    problems = problems_of(example_text.replace(old, new, 1))
    assert len(problems) == len(messages)
    assert all(problem.startswith(message) for problem, message in zip(problems, messages, strict=True))


def test_drives_share_neither_a_missing_bus_nor_an_id() -> None:
    missing = problems_of(minimal_text().replace("[bus.a]", "[bus.b]"))
    assert "drive.left_sweep.bus = 'a': there is no such bus; there is b" in missing
    twice = problems_of(minimal_text().replace("node_id = 3", "node_id = 2"))
    assert twice == ["drive.right_adduction.node_id = 2: right_sweep has the same on bus 'a'"]
    two_sections = f'[bus.b]\ninterface = "virtual"\nchannel = "x"\n{minimal_text()}'.replace(
        "node_id = 3", "node_id = 2"
    )
    before, _, after = two_sections.rpartition('bus = "a"')
    last = f'{before}bus = "b"{after}'
    shared = problems_of(last)
    assert shared == ["drive.right_adduction.node_id = 2: right_sweep has the same on bus 'a', the same channel"]
    options = ("a = 1\nb = 2", "b = 2\na = 1")
    assert problems_of(f"{last}[bus.a.options]\n{options[0]}\n[bus.b.options]\n{options[1]}\n") == shared
    other_frames = problems_of(last.replace("[bus.b]", "[bus.b]\ndata_bit_rate_kbit_s = 5000") + 'type = "moteus"\n')
    assert any("disturbs drive.left_sweep (odrive) on the same channel 'x'" in problem for problem in other_frames)


@pytest.mark.parametrize(
    ("bus", "problem"),
    [
        ('"virtual"', "data_bit_rate_kbit_s = 0: must be that of drive.left_sweep (moteus), which uses CAN FD"),
        ('"slcan"\ndata_bit_rate_kbit_s = 5000', "interface = 'slcan': carries no CAN FD, which drive.left_sweep"),
    ],
)
def test_a_bus_carries_the_can_fd_of_its_drives(bus: str, problem: str) -> None:
    text = re.sub(r"node_id = (\d)", r'node_id = 1\1\ntype = "moteus"', minimal_text()).replace('"virtual"', bus)
    assert [each.startswith(f"bus.a.{problem}") for each in problems_of(text)] == [True]


@pytest.mark.parametrize(
    ("section", "key", "value"), [("adaptation", "max_depth_m", 0.2), ("limits", "adduction_min_deg", -5.0)]
)
def test_the_bound_that_a_message_gives_is_accepted(section: str, key: str, value: float) -> None:
    (problem,) = problems_of(f"{minimal_text()}[{section}]\n{key} = {value}\n")
    bound = re.search(r"must be at most (-?[\d.]+)", problem)
    assert bound
    assert getattr(getattr(parse_configuration(f"{minimal_text()}[{section}]\n{key} = {bound[1]}\n"), section), key)


@pytest.mark.parametrize(("before", "key"), [("[drive.left_sweep]", "type"), ("[gait]", "protocol")])
def test_a_word_that_is_a_number_beyond_all_size_is_refused(before: str, key: str) -> None:
    text = f"{minimal_text()}[gait]\n".replace(before, f"{before}\n{key} = 0x{'f' * 6000}")
    assert "beyond all size" in problems_of(text)[0]


@pytest.mark.parametrize(
    ("lower", "upper", "bound", "others"),
    [
        ("late_s", "quiet_s", 0.25, "lag_s = 0.2\nsilence_s = 0.4\n"),
        ("quiet_s", "silence_s", 0.25, "late_s = 0.01\nlag_s = 0.2\n"),
        ("lag_s", "silence_s", 0.25, "late_s = 0.2\nquiet_s = 0.2\n"),
        ("voltage_min_v", "voltage_low_v", 20.0, ""),
    ],
)
def test_the_bounds_of_faults_are_ordered(lower: str, upper: str, bound: float, others: str) -> None:
    text = f"{minimal_text()}\n[faults]\n{others}{upper} = {bound}\n{lower} = "
    assert problems_of(f"{text}{bound + 0.05}") == [
        f"faults.{lower} = {bound + 0.05}: must be at most faults.{upper} = {bound}"
    ]
    parse_configuration(f"{text}{bound}")


def test_a_protocol_is_a_preset_that_other_keys_change(example_text: str) -> None:
    text = example_text.replace('protocol = "walking"', 'protocol = "single_flipper"')
    gait = parse_configuration(text.replace("swing_duration_s = 0.8", "pause_s = 1.0")).gait
    assert gait.stance_speed_m_s == PROTOCOLS["single_flipper"].stance_speed_m_s == 0.1
    assert gait.pause_s == 1.0


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


@pytest.mark.parametrize(
    ("key", "value", "most"),
    [
        ("sweep_stiffness_nm_rad", 50.0, 12.61),
        ("adduction_stiffness_nm_rad", 200.0, 17.23),
        ("sweep_damping_nm_s_rad", 0.2, 0.1789),
        ("adduction_damping_nm_s_rad", 5.0, 0.2684),
    ],
)
def test_gains_with_which_a_joint_oscillates_are_refused(
    example_text: str, key: str, value: float, most: float
) -> None:
    (reported,) = problems_of(f"{example_text}\n[gains]\n{key} = {value}\n")
    assert reported.startswith(f"gains.{key} = {value}: must be at most {most:g} for ")
    if key.endswith("stiffness_nm_rad"):
        parse_configuration(f"{example_text}\n[gains]\n{key} = {most}\n")


def test_a_heavier_arm_allows_more_stiffness(example_text: str) -> None:
    gains = "[gains]\nsweep_stiffness_nm_rad = 20.0\nsweep_damping_nm_s_rad = 0.12\n"
    assert problems_of(f"{example_text}\n{gains}")
    heavy = example_text.replace("[arm]", "[arm]\nsweep_inertia_kg_m2 = 0.0008")
    parse_configuration(f"{heavy}\n{gains}")


def test_a_motor_force_beyond_the_torque_limit_is_refused(example_text: str) -> None:
    """0.75 N·m at 0.12 m are 6.25 N."""
    parse_configuration(changed(example_text, "motor_force_n", "6.25"))
    assert problems_of(changed(example_text, "motor_force_n", "6.26")) == [
        "adaptation.motor_force_n = 6.26: must be at most 6.25 for limits.torque_nm = 0.75"
        " and geometry.flipper_length_m = 0.12"
    ]


TRIANGLE = "[[0.0, 0.0], [0.02, 0.06], [-0.02, 0.06]]"


def test_a_plate_is_a_rectangle_or_the_corners_of_the_file() -> None:
    assert parse_configuration(minimal_text()).geometry.plate_corners_m == ()
    text = f"{minimal_text()}\n[geometry]\nplate_angle_deg = 10\nplate_corners_m = {TRIANGLE}"
    geometry = parse_configuration(text).geometry
    assert geometry.plate_corners_m == ((0.0, 0.0), (0.02, 0.06), (-0.02, 0.06))
    assert (len(geometry.plate.corners), geometry.plate_angle_deg) == (3, 10.0)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            f"plate_corners_m = {TRIANGLE}\nplate_height_m = 0.06",
            "geometry.plate_height_m = 0.06: must be left out where geometry.plate_corners_m gives the plate",
        ),
        ("plate_corners_m = [[0.0, 0.0], [0.02, 0.06]]", "geometry.plate_corners_m: has 2 corners"),
        ("plate_corners_m = 5", "geometry.plate_corners_m = 5: must be an array, in [brackets]"),
        ("plate_corners_m = [[0, 0], [0.02], [-0.02, 0.06]]", "geometry.plate_corners_m 2 = [0.02]: "),
        ("plate_corners_m = [[0, 0], [0.02, nan], [-0.02, 0.06]]", "geometry.plate_corners_m 2 2 = nan: "),
        ("plate_width_m = 0.25", "geometry.flipper_length_m = 0.12: must be more than 0.125"),
    ],
)  # fmt: skip
def test_a_plate_that_is_no_plate_is_refused(keys: str, message: str) -> None:
    (problem,) = problems_of(f"{minimal_text()}\n[geometry]\n{keys}")
    assert problem.startswith(message)


def test_a_room_in_which_every_motor_counts_as_hot_is_refused() -> None:
    text = f"{minimal_text()}\n[limits]\ntemperature_warm_c = 40.0\ntemperature_hot_c = 60.0\n"
    (problem,) = problems_of(f"{text}\n[winding]\nroom_c = 50.0\n")
    assert problem.startswith("winding.room_c = 50.0: must be less than 50, ")
    parse_configuration(f"{text}\n[winding]\nroom_c = 49.0\n")


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        load_configuration(tmp_path / "none.toml")


@pytest.mark.parametrize("key", PATHS)
def test_a_path_in_the_home_folder_of_whoever_reads_the_file_is_refused(key: str, tmp_path: Path) -> None:
    path, (section, _, name) = tmp_path / "mudskipper.toml", key.rpartition(".")
    path.write_text(f'{minimal_text()}\n[{section}]\n{name} = "~/x"\n', encoding="utf-8")
    with pytest.raises(ConfigurationError, match=f"^{re.escape(key)} = '~/x': must be written out"):
        load_configuration(path)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    path.write_bytes(b"a = 1\n# gr\xfc\xdf\n")
    with pytest.raises(ConfigurationError, match=r"x\.toml: not UTF-8 text \(at line 2\); save the file as UTF-8"):
        load_configuration(path)


@pytest.mark.parametrize("option", [[], ["--check-config"]])
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("torque_nm = 0.75", "torque_nm = 99", "limits.torque_nm = 99: must be at most 5.0"),
        ("[status]", '[status]\nread_group = "no such"', "status.read_group = 'no such': there is no such group"),
    ],
)
def test_the_daemon_refuses_with_status_78_and_one_sentence_before_it_makes_anything(
    tmp_path: Path, example_text: str, old: str, new: str, message: str, option: list[str], capsys: Capture
) -> None:
    socket, path = tmp_path / "folder" / "s", tmp_path / "mudskipper.toml"
    path.write_text(example_text.replace(SOCKET, str(socket)).replace(old, new), encoding="utf-8")
    assert main(["--config", str(path), *option]) == EXIT_CONFIGURATION == 78
    said = capsys.readouterr().err
    assert said.startswith(f"mudskipperd: {message}") and said.count("\n") == 1 and not socket.parent.exists()


@pytest.mark.parametrize(
    ("gait", "warned"),
    [
        ("extraction_speed_m_s = 0.2", True),
        ("extraction_speed_m_s = 0.2\npause_s = 0.19", True),
        ("extraction_speed_m_s = 0.2\npause_s = 0.2", False),
        ("extraction_speed_m_s = 0.5", False),
    ],
)
def test_a_slow_extraction_right_after_the_stance_is_warned_of(example_text: str, gait: str, warned: bool) -> None:
    """In simulation its k_e is 22 % too small, with standard errors of 8 %."""
    warnings = parse_configuration(example_text.replace("[gait]\n", f"[gait]\n{gait}\n")).warnings
    assert [each.partition(":")[0].split(" = ")[0] for each in warnings] == ["gait.pause_s"] * warned


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_no_protocol_is_warned_of(example_text: str, protocol: str) -> None:
    assert parse_configuration(example_text.replace('"walking"', f'"{protocol}"')).warnings == ()


WEAK = {  # a section with a bound beyond twice its default, and the refusal without a reason
    "faults": ("silence_s = 2.0", "faults.silence_s = 2.0: must be at most 0.0526"),
    "faults watchdog": ("longest_watchdog_s = 10.0", "faults.longest_watchdog_s = 10.0: must be at most 0.6"),
    "limits": ("adduction_min_deg = -180.0", "limits.adduction_min_deg = -180.0: must be at least -150"),
    "limits margin": ("position_margin_deg = 90.0", "limits.position_margin_deg = 90.0: must be at most 20"),
    "motion": ("longest_hold_s = 0.0", "motion.longest_hold_s = 0.0: must be more than 0 and at most 1200"),
}


@pytest.mark.parametrize("case", WEAK)
def test_weak_protection_needs_a_reason_and_is_shown(case: str, tmp_path: Path, capsys: Capture) -> None:
    given, refusal = WEAK[case]
    path, text = tmp_path / "mudskipper.toml", f"{minimal_text()}\n[{case.split()[0]}]\n{given}\n[safety]\nweakened = "
    for no_reason in ('""', '" "'):
        path.write_text(text + no_reason, encoding="utf-8")
        assert main(["--config", str(path), "--check-config"]) == 78
        assert f"{refusal}, twice its default, or [safety] weakened" in capsys.readouterr().err
    path.write_text(f'{text}"a bench in air"', encoding="utf-8")
    assert main(["--config", str(path), "--check-config"]) == 0
    shown = f"protection is weakened (a bench in air): {case.split()[0]}.{given}"
    assert capsys.readouterr().err == f"mudskipperd: warning: {shown}\n"
    assert load_configuration(path).warnings == (shown,)


@pytest.mark.parametrize("reason", ["a robot", "a\\u001bb", "x" * 201])
def test_a_reason_without_weak_protection_or_that_cannot_be_shown_is_refused(reason: str, tmp_path: Path) -> None:
    path = tmp_path / "mudskipper.toml"
    path.write_text(f'{minimal_text()}\n[safety]\nweakened = "{reason}"', encoding="utf-8")
    with pytest.raises(ConfigurationError, match="safety.weakened = .*: must be"):
        load_configuration(path)


def test_a_stance_is_clipped_at_the_limit_of_the_sweep_motor_whatever_the_adduction_motor(
    configuration: Configuration,
) -> None:
    """A larger torque constant takes less current for the torque limit."""
    other = {
        joint: replace(drive, torque_constant_nm_a=0.166) if joint.endswith("adduction") else drive
        for joint, drive in configuration.drive.items()
    }
    limits_a = [each.current_limit_a for each in configuration.flipper_drives]
    assert [each.current_limit_a for each in replace(configuration, drive=other).flipper_drives] == limits_a
