"""A world file is accepted as it is written, or refused as a whole with all its problems."""

from dataclasses import replace
from pathlib import Path

import pytest

from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from simulation.harness.blocks import on_blocks
from simulation.harness.lockstep import Lockstep
from simulation.harness.world import (
    load_world,
    parse_world,
)
from simulation.mud.clay import Clay, clay_of_water
from simulation.mud.disturbances import LAB
from simulation.mud.ground_contact import Ground
from simulation.mud.grounds.sand import Sand
from simulation.mud.grounds.thixotropic_mud import ThixotropicMud
from simulation.mud.layer import Layer
from simulation.mud.stones import Stone
from simulation.mud.unevenness import Ridges
from tests.folders import EXAMPLE_WORLD as EXAMPLE

SHORTEST = """\
[[segment]]
start_m = 0
end_m = 0.5
strength_pa = 2000
"""
SECOND = """
[[segment]]
start_m = 0.5
end_m = 1.0
water_percent = 48.5
"""
LAYER = "[[segment.layer]]\ntop_m = 0.01\nbottom_m = 0.02\nfactor = 3.0\n"
STONE = "[[stone]]\nstart_m = 0.2\nend_m = 0.3\ntop_m = 0.02\n"


def problems_of(text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        parse_world(text)
    return caught.value.problems


def test_the_example_has_the_values_that_it_documents() -> None:
    world = load_world(EXAMPLE)
    crusted = Clay("1500 Pa", 1500.0, (Layer(0.0, 0.004, 1.5), Layer(0.025, 0.035, 0.5)))
    assert [segment.ground for segment in world.track.segments] == [clay_of_water(48.5), crusted, clay_of_water(46.0)]
    assert [segment.end_m for segment in world.track.segments] == pytest.approx([0.6, 1.2, 1.8])
    assert world.track.stones == (Stone(0.40, 0.46, 0.015),)
    assert world.track.ridges == Ridges(0.002, 0.25)
    assert world.track.ground_at(0.3) != clay_of_water(48.5)
    assert world.disturbances == replace(LAB, current_noise_a=0.0, current_limit_a=0.0)  # the drives have them
    assert world.robot_changes["body_mass_kg"] == 1.0 and world.drive_changes["encoder_counts"] == 16384


def test_a_segment_may_be_sand_or_thixotropic() -> None:
    sand = SECOND.replace("water_percent = 48.5", "sand = 'spatial'\nstiffness_n_m3 = 1e6\n")
    segments = parse_world(SHORTEST + "[segment.thixotropy]\n" + sand).track.segments
    expected: list[Ground] = [ThixotropicMud(Clay("2000 Pa", 2000.0)), Sand("spatial sand", 1e6, spatial=True)]
    assert [segment.ground for segment in segments] == expected


@pytest.mark.parametrize(
    ("added", "key", "bound"),
    [
        ("[ridge]\n", "ridge", ""),
        ("[robot]\nflipper_length_m = 0.1\n", "robot.flipper_length_m", ""),  # as the robot's configuration says
        ("[robot]\nfixed_base = true\n", "robot.fixed_base", ""),
        ("[robot]\nbody_mass_kg = 0.5\nrail_damping_n_s_m = 501.0\n", "robot.rail_damping_n_s_m", "500"),
        ("[drives]\nnode_id = 3\n", "drives.node_id", ""),
        ("[ridges]\namplitude_m = 0.5\n", "ridges.amplitude_m", "0.01"),
        ("[random_strength]\nrelative_spread = -0.1\n", "random_strength.relative_spread", "0.0"),
        ("[disturbances]\nremoulding = 1.5\n", "disturbances.remoulding", "1.0"),
        ("[drives]\nencoder_counts = true\n", "drives.encoder_counts", "True"),
        (STONE.replace("0.3", "0.2"), "stone 1.end_m", "start_m = 0.2"),
        (STONE.replace("0.02", "-0.02"), "stone 1.top_m", "0.0"),
        (STONE.replace("end_m = 0.3\n", ""), "stone 1.end_m is missing", ""),
        (STONE + STONE, "stone 2.start_m", "0.3"),
        ("[ridges]\namplitude_m = 0.01\n" + STONE.replace("0.02", "0.005"), "stone 1.top_m", "ridges.amplitude_m"),
        ("stone = 3\n", "stone", "[[stone]]"),
        (
            "[disturbances]\nsample_period_s = 0.004\n[drives]\nencoder_period_s = 0.002\n",
            "drives.encoder_period_s",
            "disturbances.sample_period_s",
        ),
        (SECOND.replace("48.5", "60"), "segment 2.water_percent", "56.0"),
        (SECOND.replace("48.5", "43.9"), "segment 2.water_percent", "44.0"),
        (SECOND.replace("water_percent = 48.5", "strength_pa = -5"), "segment 2.strength_pa", "50.0"),
        (SECOND.replace("48.5", "'wet'"), "segment 2.water_percent", "'wet'"),
        (SECOND + "strength_pa = 900", "segment 2.water_percent", "strength_pa = 900"),
        (SECOND.replace("water_percent = 48.5", ""), "segment 2", "strength_pa"),
        (SECOND.replace("water_percent = 48.5", "sand = 'gravel'"), "segment 2.sand", "spatial"),
        (SECOND + "sand = 'spatial'", "segment 2.water_percent", "sand = 'spatial'"),
        (SECOND + "stiffness_n_m3 = 2e6", "segment 2.stiffness_n_m3", "sand"),
        (SECOND + "[segment.thixotropy]\nrecovery_s = -1\n", "segment 2.thixotropy.recovery_s", "0.1"),
        (SECOND.replace("0.5", "0.4"), "segment 2.start_m", "overlap"),
        (SECOND.replace("0.5", "0.6"), "segment 2.start_m", "gap"),
        (SECOND.replace("1.0", "0.5"), "segment 2.end_m", "start_m = 0.5"),
        (SECOND.replace("1.0", "1" + "0" * 400), "segment 2.end_m", ""),  # beyond all floats
        (LAYER.replace("0.02", "0.005"), "segment 1.layer 1.bottom_m", "top_m = 0.01"),
        (LAYER.replace("3.0", "0"), "segment 1.layer 1.factor", "0.01"),
        (LAYER + LAYER, "segment 1.layer 2.top_m", "0.02"),
        (SECOND + LAYER.replace("3.0", "20"), "segment 2.layer 1.factor", "17.9"),
    ],
)
def test_an_invalid_value_is_refused_with_key_and_bound(added: str, key: str, bound: str) -> None:
    (reported,) = problems_of(added + SHORTEST if added.startswith("stone =") else SHORTEST + added)
    assert reported.split(":")[0].split(" = ")[0] == key
    assert bound in reported


@pytest.mark.parametrize(
    "text",
    [
        SHORTEST.replace("start_m = 0", "start_m = 0.1"),
        "[ridges]\namplitude_m = 0.002\n",
        "segment = []\n",
        "[segment]\nstart_m = 0\n",
    ],
)
def test_a_world_without_a_beginning_or_without_mud_is_refused(text: str) -> None:
    assert all("segment" in problem for problem in problems_of(text))


def test_wrong_values_are_reported_together_and_then_all_contradictions() -> None:
    values = "depth_m = 3\n" + SHORTEST.replace("2000", "-1")
    contradictions = (
        SHORTEST + SECOND.replace("0.5", "0.7") + LAYER.replace("0.02", "0.0") + STONE.replace("0.3", "0.1")
    )
    keys = ["segment 2.layer 1.bottom_m", "segment 2.start_m", "stone 1.end_m"]
    for wrong, expected in ((values, ["depth_m", "segment 1.strength_pa"]), (contradictions, keys)):
        assert sorted(reported.split(":")[0].split(" = ")[0] for reported in problems_of(wrong)) == expected


@pytest.mark.parametrize("contents", [None, b"\xff\xfe", b"[[segment]\n", b"segment = 3\n"])
def test_what_is_wrong_with_a_file_is_reported_with_its_name(tmp_path: Path, contents: bytes | None) -> None:
    path = tmp_path / "world.toml"
    if contents is not None:
        path.write_bytes(contents)
    with pytest.raises(ConfigurationError, match=str(path)):
        load_world(path)


def test_a_base_is_fixed_where_the_configuration_fixes_it(configuration: Configuration) -> None:
    on_a_bench = replace(configuration, estimation=replace(configuration.estimation, fixed_base=True))
    world, free = parse_world(SHORTEST), parse_world(SHORTEST + "[robot]\nfree_body = true\n")
    assert world.plant(on_a_bench).fixed_base and not world.plant(configuration).fixed_base
    assert on_blocks(configuration).plant(configuration).fixed_base
    assert free.plant(configuration).free_body
    with pytest.raises(ConfigurationError) as caught:
        free.plant(on_a_bench)
    assert "robot.free_body" in str(caught.value) and "estimation.fixed_base" in str(caught.value)


def test_a_lockstep_runs_in_a_world(configuration: Configuration) -> None:
    world = parse_world(
        SHORTEST + "[robot]\nbody_mass_kg = 2.0\n[drives]\nencoder_counts = 4096\n"
        "[disturbances]\ncurrent_noise_a = 0.3\n"
    )
    drives = world.drives(configuration)
    lockstep = Lockstep(configuration, world.track, plant=world.plant(configuration), drives=drives)
    plant = lockstep.robot.plant
    assert (plant.track, plant.parameters.body_mass_kg) == (world.track, 2.0)
    assert plant.parameters.disturbances == world.disturbances
    for joint, drive in zip(configuration.drive.values(), lockstep.robot.drives, strict=False):
        assert (drive.parameters.encoder_counts, drive.parameters.current_noise_a) == (4096, 0.3)
        assert drive.parameters.torque_constant_nm_a == joint.torque_constant_nm_a


def test_a_body_of_another_shape_keeps_the_configured_height_of_its_joints(configuration: Configuration) -> None:
    higher = replace(configuration, geometry=replace(configuration.geometry, axis_height_m=0.07))
    for given, expected_m in (("width_m = 0.1", 0.07), ("axis_above_belly_m = 0.05", 0.05)):
        world = parse_world(SHORTEST + "[robot]\nfree_body = true\n[robot.body]\n" + given)
        assert world.plant(higher).body.axis_above_belly_m == expected_m
