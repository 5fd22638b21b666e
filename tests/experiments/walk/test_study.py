"""The command looks at the robot before it walks."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from control.records import Rig
from experiments.robot.bench_errors import BenchError
from experiments.studies.walk import study
from experiments.study.session import Session
from experiments.trials import mud_trials
from tests.experiments.synthetic_strides import CONFIGURATION
from tests.scripted_operator import ScriptedOperator


def test_a_flipper_that_the_robot_does_not_have_is_refused_before_it_walks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = replace(CONFIGURATION, rig=Rig(("right",)))
    robot = SimpleNamespace(configuration=alone, close=lambda: None)  # any call would fail
    monkeypatch.setattr(mud_trials, "DaemonRobot", lambda socket: robot)
    session = Session(tmp_path, ScriptedOperator(), lambda done, total: None, socket=tmp_path / "socket")
    with pytest.raises(BenchError, match="no left flipper.*give --flipper right"):
        study(session, mud=(("49.5", 61.0),), flipper="left")
