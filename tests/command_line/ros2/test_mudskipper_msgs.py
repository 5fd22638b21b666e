"""The files for a computer with ROS fit the robot: a stride's definition, the model's joints, the topics of RViz."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

from command_line.live.standard_messages import ODOM, TOPICS, flipper_pose
from command_line.ros2.own_messages import LAPTOP_FILES
from control.geometry import FlipperGeometry
from control.records import FLIPPERS
from firmware_host.log.rows import STRIDE

GEOMETRY = FlipperGeometry()
MODEL = ElementTree.parse(LAPTOP_FILES / "urdf/mudskipper.urdf")


def vector(text: str) -> np.ndarray:
    return np.array(text.split(), float)


def test_the_message_of_a_stride_is_the_log_s_and_each_message_is_built() -> None:
    built = re.findall(r'"msg/(\w+)\.msg"', (LAPTOP_FILES / "CMakeLists.txt").read_text(encoding="utf-8"))
    assert built == sorted(path.stem for path in (LAPTOP_FILES / "msg").iterdir())
    assert (LAPTOP_FILES / "msg/Stride.msg").read_text(encoding="utf-8") == STRIDE.definition


@pytest.mark.parametrize("flipper", FLIPPERS)
def test_the_model_s_plate_is_where_the_kinematics_have_it(flipper: str) -> None:
    """The joints are turned one after the other, as robot_state_publisher does it."""
    angles_rad = {f"{flipper}_sweep": 0.6, f"{flipper}_adduction": -0.4}
    turned = Rotation.identity()
    for name in (f"{flipper}_adduction", f"{flipper}_sweep"):
        joint = MODEL.find(f"joint[@name='{name}']")
        assert joint is not None and joint.find("origin") is None
        axis = joint.find("axis")
        assert axis is not None
        turned *= Rotation.from_rotvec(angles_rad[name] * vector(axis.attrib["xyz"]))
    plate = MODEL.findall(f"link[@name='{flipper}_arm']/visual")[1]
    centre_m, size_m = vector(plate[0].attrib["xyz"]), vector(plate[1][0].attrib["size"])
    edge_m = centre_m - (0.0, 0.0, size_m[2] / 2.0)
    pose = flipper_pose(GEOMETRY, flipper, angles_rad[f"{flipper}_sweep"], angles_rad[f"{flipper}_adduction"])
    assert turned.apply(edge_m) == pytest.approx(pose.position_m)
    assert size_m.tolist() == [GEOMETRY.plate_thickness_m, GEOMETRY.plate_width_m, GEOMETRY.plate_height_m]


def test_rviz_shows_topics_that_are_published_and_finds_the_files() -> None:
    shown = YAML(typ="safe").load(LAPTOP_FILES / "rviz/mudskipper.rviz")["Visualization Manager"]
    topics = {display["Topic"]["Value"] for display in shown["Displays"] if "Topic" in display}
    assert topics <= TOPICS.keys() and shown["Global Options"]["Fixed Frame"] == ODOM
    launch = Path(LAPTOP_FILES, "launch/mudskipper.launch.xml").read_text(encoding="utf-8")
    remapped = {node.attrib["from"] for node in ElementTree.fromstring(launch).iter("remap")}
    assert topics | {"/tf", "/robot_description"} <= remapped
    named = re.findall(r"\$\(dirname\)/([\w./]+)", launch)
    assert len(named) == 2 and all((LAPTOP_FILES / "launch" / name).exists() for name in named)
