"""Decodes motion capture in a process of its own, so that datagrams from a network never reach the loop's process.

`NatNetBridge` is the loop's side: it starts this module as a program, which receives NatNet (natnet_client.py) and
passes on what the loop needs over a pair of Unix sockets: 16 bytes for each position, as those of pose_port.py, and
its report as JSON, four times a second. No library is used: of those on PyPI, `natnet` knows neither the rate of the
server's clock nor a version from the configuration, misreads the flags from 4.1 on and ends its thread at a malformed
packet; the others are samples of the SDK. It serves the tests of our decoder as a reference.
"""

import json
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict

from drivers.pose.natnet_client import NatNetClient
from drivers.pose.natnet_sockets import Direction, NatNetParameters
from drivers.pose.pose_port import MOST_MESSAGES_PER_READ, NO_SOURCE, POSE, PoseReport, PoseSourceError

LONGEST_START_S = 20.0  # of the program, on a busy computer
LONGEST_END_S = 2.0
REPORT_S = 0.25
LONGEST_MESSAGE = 4096
ENDED, RESTART = "the program that receives NatNet has ended.", "restart the daemon"


class NatNetBridge:
    """Implements PositionStream. Owns the program, and its newest report. Start it before the loop's priority rises."""

    def __init__(self, parameters: NatNetParameters, direction: Direction) -> None:
        """Start the program and waits until its sockets are open; raises PoseSourceError where they do not open."""
        self._link, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        arguments = json.dumps([asdict(parameters), direction])
        command = [sys.executable, "-P", "-m", "drivers.pose.natnet_bridge", arguments]
        # Ctrl-C and the service's stop reach the program too; it ends when the loop's side closes.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGABRT})
        try:
            self._program = subprocess.Popen(command, stdin=far.fileno())
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            far.close()
        self._link.settimeout(LONGEST_START_S)
        self._report = NO_SOURCE._replace(trouble="the program that receives NatNet did not start")
        with suppress(TimeoutError):
            self._on_message(self._link.recv(LONGEST_MESSAGE))
        if not self._report.source:
            self.close()
            raise PoseSourceError(self._report.trouble)
        self._link.setblocking(False)

    def receive(self, now_s: float) -> Iterator[tuple[float, float]]:
        """Yield the positions that the program has passed on since, oldest first; never waits."""
        for _ in range(MOST_MESSAGES_PER_READ):
            try:
                message = self._link.recv(LONGEST_MESSAGE)
            except OSError:  # nothing more, or the program has ended
                return
            if len(message) == POSE.size:
                yield POSE.unpack(message)
            else:
                self._on_message(message)

    def _on_message(self, message: bytes) -> None:
        """Handle a report; an empty message means that the program has ended."""
        if message:
            self._report = PoseReport(*json.loads(message))
        else:
            self._report = self._report._replace(trouble=ENDED, what_to_do=RESTART)

    def report(self) -> PoseReport:
        return self._report

    def close(self) -> None:
        """End the program, which notices that this side closes."""
        self._link.close()
        try:
            self._program.wait(LONGEST_END_S)
        except subprocess.TimeoutExpired:
            self._program.kill()


def serve(client: NatNetClient, link: socket.socket) -> None:
    """Pass positions and reports on until the loop's side closes."""
    sent, sent_s = NO_SOURCE, 0.0
    while True:
        ready, _, _ = select.select([link, *client.sockets.opened], [], [], REPORT_S)
        if link in ready:  # the loop sends nothing: its side is closed
            return
        now_s = time.monotonic()
        messages = [POSE.pack(*position) for position in client.receive(now_s)]
        report = client.report()
        if report.source != sent.source or now_s - sent_s >= REPORT_S:
            sent, sent_s = report, now_s
            messages.insert(0, json.dumps(report).encode())
        for message in messages:
            link.send(message)


def main() -> None:
    parameters, direction = json.loads(sys.argv[1])
    with socket.socket(fileno=0) as link, suppress(ConnectionError):  # the loop's side may close at any time
        try:
            client = NatNetClient(NatNetParameters(**parameters), direction)
        except PoseSourceError as problem:
            link.send(json.dumps(PoseReport(trouble=str(problem))).encode())
        else:
            link.send(json.dumps(client.report()).encode())
            serve(client, link)


if __name__ == "__main__":
    main()
