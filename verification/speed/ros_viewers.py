"""Viewers of a robot in ROS 2, as processes: a Zenoh router, `mudskipper ros2`, and three subscribers to all topics."""

import json
import os
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import zenoh

CLIENTS = 3


def start_ros_viewers(status_socket: Path) -> list[subprocess.Popen[bytes]]:
    """Start the processes, `mudskipper ros2` first."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp/127.0.0.1:{server.getsockname()[1]}"
    others = [subprocess.Popen([sys.executable, "-m", __name__, each, address]) for each in ("router", "peer")]
    command = [sys.executable, "-m", "command_line.main", "ros2", "--router", address]
    environment = os.environ | {"MUDSKIPPER_SOCKET": str(status_socket)}
    return [subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL), *others]


def open_session(mode: str, address: str) -> zenoh.Session:
    """Open a session as rmw_zenoh does: its nodes are peers that the router introduces to each other."""
    configuration = zenoh.Config()
    configuration.insert_json5("mode", json.dumps(mode))
    configuration.insert_json5("scouting/multicast/enabled", "false")
    endpoints = "listen/endpoints" if mode == "router" else "connect/endpoints"
    configuration.insert_json5(endpoints, json.dumps([address]))
    return zenoh.open(configuration)


if __name__ == "__main__":
    with ExitStack() as opened:
        for _ in range(1 if sys.argv[1] == "router" else CLIENTS):
            session = opened.enter_context(open_session(*sys.argv[1:]))
            if sys.argv[1] == "peer":
                opened.enter_context(session.declare_subscriber("0/**", lambda sample: sample.payload.to_bytes()))
        while True:
            time.sleep(1.0)
