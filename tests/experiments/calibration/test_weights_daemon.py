"""The weighing of a real robot has a daemon of its own, in real time."""

from pathlib import Path

from experiments.calibration.robots import running_daemon
from firmware_host.configuration.loading import parse_configuration
from operator_client.status_client import StatusClient
from tests.running_bench import Bench


def test_the_daemon_of_the_weights_ends_with_them(own_bench: Bench, tmp_path: Path) -> None:
    own_bench.stop_daemon()
    configuration = parse_configuration(own_bench.configuration.read_text(encoding="utf-8"))
    with running_daemon(configuration, tmp_path) as socket, StatusClient(socket) as client:
        assert client.call("status")["robot"] == "simulated"
    assert not socket.exists()
    own_bench.restart_daemon()
    own_bench.wait_until_ready()
