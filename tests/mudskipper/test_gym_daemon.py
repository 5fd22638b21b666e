"""The Gymnasium environment of a daemon, in real time."""

import numpy as np
import pytest

from mudskipper.client import Client
from mudskipper.gym import MudWalk
from tests.command_line.command_lines import output
from tests.mudskipper.test_gym import walked_stride
from tests.running_bench import Bench


def test_a_daemon_feels_and_pays_as_lockstep_does() -> None:
    """It wakes up at other times, and energy is from 50 reports a second. A computer that halts changes a stride."""
    lockstep = walked_stride("lockstep")
    assert any(walked_stride("daemon") == pytest.approx(lockstep, rel=0.25) for _ in range(4))


def test_an_operator_arms_the_robot_of_a_socket_before_each_reset_and_close_stops_it(own_bench: Bench) -> None:
    with MudWalk(backend="daemon", socket=own_bench.socket, operated=True, duration_s=1.0) as walk:
        with pytest.raises(RuntimeError, match="idle"):
            walk.reset()
        with Client(own_bench.socket) as operator:
            operator.arm()
            operator.wait_for("hold")
            walk.reset()
            _, _, fault, over, info = walk.step(np.zeros(3, np.float32))
            assert over and not fault and info["advance_m"] > 0.01
            with pytest.raises(RuntimeError, match="idle"):
                walk.reset()
            output("arm", "--wait", "--socket", str(own_bench.socket))  # the flippers may still fall
            assert operator.wait_for("hold")["lease"] is None
            walk.reset()
            walk.close()  # in the middle of an episode
            assert "lease_lost" in operator.wait_for("idle")["notice"]
