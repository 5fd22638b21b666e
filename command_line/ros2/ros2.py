"""`mudskipper ros2`: shows a running robot to computers with ROS 2, in a process of its own and without ROS.

It reads the daemon's rows as `mudskipper live` does, makes the same standard messages, and speaks as rmw_zenoh
does. It takes no set-points. A walk is under the daemon's lease (leased_walk.py).
"""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from command_line import exit_codes
from command_line.errors import explain
from command_line.live.live import pass_on
from command_line.ros2.leased_walk import LeasedWalk
from command_line.shared_options import Socket
from experiments.study.option import Option, OptionError
from firmware_host.configuration.socket_paths import rows_path
from operator_client.row_subscription import RowSubscription
from operator_client.status_client import StatusClient

NAMESPACE = re.compile(r"/?([A-Za-z_]\w*(/[A-Za-z_]\w*)*)", re.ASCII)
Act: TypeAlias = Callable[[], str]


def ros_namespace(text: str) -> str:
    """Return it with a slash in front. Raises OptionError where ROS does not know it as one."""
    found = NAMESPACE.fullmatch(text)
    if not found:
        raise OptionError(f"{text}: must be words of letters, digits and _, such as mud1 or lab/mud1")
    return f"/{found[1]}"


def ros2(
    *,
    socket: Socket,
    router: Annotated[str, Option("Zenoh router of the ROS 2 computers", metavar="ADDRESS")] = "tcp/localhost:7447",
    domain: Annotated[int, Option("the other computers' ROS_DOMAIN_ID", low=0, high=232)] = 0,
    namespace: Annotated[
        str, Option("of all topics and services, such as mud1", metavar="NAME", parse=ros_namespace)
    ] = "",
    distribution: Annotated[Literal["jazzy", "humble"], Option("of ROS 2 there, or a newer one: jazzy")] = "jazzy",
    allow_drive: Annotated[bool, Option("also serve 'clear' and 'walk'")] = False,
) -> int:
    from command_line.ros2.own_messages import LAPTOP_FILES
    from command_line.ros2.ros_audience import RosAudience
    from command_line.ros2.ros_node import RosNode, connect

    try:
        with connect(router) as session:
            node = RosNode(session, domain, namespace, hashed=distribution != "humble")
            audience = RosAudience(session, node, partial(_read_map, socket))
            for name, act in _services(Path(socket), allow_drive).items():
                node.serve(name, partial(_attempt, act))
            node.watch_others()
            place = f"{namespace or '/'} in domain {domain} by {router}"
            print(f"ROS 2 {distribution}: {place}. Files for the laptop: {LAPTOP_FILES}. Ctrl-C ends.", flush=True)
            pass_on(RowSubscription(rows_path(Path(socket))), audience)
    except KeyboardInterrupt:
        return exit_codes.OK


def _read_map(socket: Socket) -> list[dict[str, Any]]:
    with StatusClient(socket) as client:
        return client.read_map()


def _services(socket: Path, allow_drive: bool) -> dict[str, Act]:
    walk = LeasedWalk(socket)
    ends: dict[str, Act] = {"stop": partial(walk.end, "stop"), "disarm": partial(walk.end, "disarm")}
    return ends | ({"clear": walk.clear, "walk": walk.walk} if allow_drive else {})


def _attempt(act: Act) -> tuple[bool, str]:
    """Return whether an order succeeded, and what became of it or why it was refused."""
    try:
        return True, act()
    except Exception as problem:  # noqa: BLE001 - `explain` raises again what it does not know
        return False, "; ".join(explain(problem)[0])
