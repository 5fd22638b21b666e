"""Drives the robot by hand, with a dead-man: `mudskipper joy`.

While the dead-man is held, this program renews the lease. When it is released it closes its connection, and the daemon
handles that as any lost lease: the robot stops, raises its flippers and switches torque off. The same happens when the
gamepad vanishes, or when this program dies or hangs.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Annotated, Any

from command_line import exit_codes
from command_line.errors import CommandError
from command_line.operation.attended_walk import LEASE_S, RENEWAL_S, LiveLine
from command_line.operation.confirmation import disarm, stop
from command_line.operation.operation import LEAST_DEPTH_CM
from command_line.operation.pads import (
    ARM,
    DEAD_MAN,
    DEEPER,
    DEVICE_KEYS,
    QUIT,
    SHALLOWER,
    STOP,
    WALK,
    Controls,
    Pad,
    device_pad,
    terminal_pad,
)  # fmt: skip
from command_line.screen import complain
from command_line.shared_options import Socket
from drivers.input_keys import InputKeys, find_devices
from experiments.study.option import Option
from operator_client.status_client import CallRefusedError, NoDaemonError, StatusClient

POLL_S = 0.02
AGAIN_S = 0.3  # until a control that stays pressed acts again
DEPTH_STEP_M = 0.005
GAMEPAD_KEYS = (
    "R1 is the dead-man, START arms, the lower button walks, the right one stops, the cross changes the depth"
)
TERMINAL_KEYS_TEXT = "SPACE is the dead-man, a arms, w walks, s stops, the arrows change the depth, q ends"
Report = dict[str, Any]


class HandDrive:
    """Owns the connection that has the lease, while the dead-man is held."""

    def __init__(self, connect: Callable[[], StatusClient], depth_m: float | None = None) -> None:
        """`depth_m` is that of the next walk; without it the depth adapts."""
        self._connect, self.depth_m = connect, depth_m
        self._client: StatusClient | None = None
        self._must_release = True  # a dead-man that is held from the start may be stuck
        self._renew_s = 0.0
        self._acted_s: dict[str, float] = {}
        self.message = ""

    @property
    def engaged(self) -> bool:
        return self._client is not None

    @property
    def depth_text(self) -> str:
        return "adaptive" if self.depth_m is None else f"{100.0 * self.depth_m:.1f} cm"

    def step(self, controls: Controls, report: Report, now_s: float) -> None:
        """Act on the controls; a refused lease ends the attempt until the dead-man is pressed again."""
        if not controls.held:
            self.let_go()
            self._must_release = False
        elif not self._must_release:
            try:
                client = self._renewed(now_s)
            except CallRefusedError as problem:
                self.message, self._must_release = str(problem), True
                self.let_go()
                return
            for control in {STOP} & controls.pressed or controls.pressed - {DEAD_MAN}:  # a stop overrules the others
                if now_s - self._acted_s.get(control, float("-inf")) >= AGAIN_S:
                    self._acted_s[control] = now_s
                    self._act(client, control, report)

    def let_go(self) -> None:
        """Lose the lease, which stops a robot that moves."""
        if self._client is not None:
            self._client.close()
        self._client = None

    def end(self) -> None:
        """Stop the robot on purpose, which is no fault of a lost lease."""
        if self._client is not None:
            with suppress(CallRefusedError, NoDaemonError):
                self._client.call("stop")
                self._client.call("release")
        self.let_go()

    def _renewed(self, now_s: float) -> StatusClient:
        if self._client is None:
            self._client, self._renew_s = self._connect(), now_s
            self.message = ""
        if now_s >= self._renew_s:
            self._client.call("lease", for_s=LEASE_S)
            self._renew_s = now_s + RENEWAL_S
        return self._client

    def _act(self, client: StatusClient, control: str, report: Report) -> None:
        mode = report["mode"]
        try:
            if control == ARM and mode in ("idle", "boot", "fault"):
                client.call("arm")
            elif control == WALK and mode != "walking":
                client.call("walk", **({} if self.depth_m is None else {"depth_m": self.depth_m}))
            elif control == STOP:
                client.call("stop")
            elif control in (DEEPER, SHALLOWER):
                self._change_depth(client, DEPTH_STEP_M if control == DEEPER else -DEPTH_STEP_M, report)
        except CallRefusedError as problem:
            self.message = str(problem)

    def _change_depth(self, client: StatusClient, step_m: float, report: Report) -> None:
        depth_m = round((self.depth_m or report["next_depth_m"]) + step_m, 4)
        if report["mode"] == "walking":
            client.call("depth", depth_m=depth_m)
        self.depth_m = max(depth_m, LEAST_DEPTH_CM / 100.0)


@contextmanager
def opened_pad(device: str, keyboard: bool) -> Iterator[Pad]:
    """Yield the pad; its errors name the device. Raises CommandError where there is none."""
    if keyboard:
        with terminal_pad() as pad:
            print(TERMINAL_KEYS_TEXT)
            yield pad
        return
    keys = InputKeys(device or _find_gamepad(), DEVICE_KEYS)
    if DEAD_MAN not in {DEVICE_KEYS[name] for name in keys.keys}:
        raise CommandError(f"{keys.name} has no dead-man: neither BTN_TR nor KEY_SPACE")
    print(f"{keys.name}: {GAMEPAD_KEYS}")
    yield device_pad(keys)


def _find_gamepad() -> str:
    """Return the only gamepad. Raises CommandError."""
    found = find_devices("BTN_SOUTH")
    if len(found) != 1:
        raise CommandError(
            f"{len(found)} gamepads are connected: {', '.join(found) or 'none in /dev/input that this user may read'};"
            " name one with --device, or drive with --keyboard"
        )
    return found[0]


def joy(
    *,
    socket: Socket,
    device: Annotated[
        str, Option("gamepad or keyboard in /dev/input (default: the only gamepad)", metavar="PATH", alternative="pad")
    ] = "",
    keyboard: Annotated[bool, Option("the keys of this terminal: hold one, and it repeats", alternative="pad")] = False,
    depth: Annotated[
        float | None, Option("insertion depth (default: adaptive)", unit="cm", low=LEAST_DEPTH_CM, high=20.0)
    ] = None,
) -> int:
    """Drive until Ctrl-C. A robot that is driven stops, its torque goes off, and every drive confirms that."""
    drive = HandDrive(partial(StatusClient, socket), None if depth is None else depth / 100.0)
    status, ended = exit_codes.OK, ""
    with opened_pad(device, keyboard) as pad, StatusClient(socket) as client:
        try:
            follow(pad, drive, client)
        except KeyboardInterrupt:
            status = exit_codes.INTERRUPTED
        except OSError as problem:
            ended = f"{problem.strerror or problem}: the gamepad or terminal is gone"
        endings = (stop, disarm) if drive.engaged else ()
        drive.let_go() if ended else drive.end()
    for end in endings:
        if (stopped := end(socket=socket)).print(as_json=False):
            return stopped.status
    if ended:
        raise CommandError(ended)
    return status


def follow(pad: Pad, drive: HandDrive, client: StatusClient) -> None:
    """Drive until the key that ends it. Raises OSError where the pad is gone."""
    line, show_s, report, said = LiveLine(), 0.0, client.call("status"), ""
    try:
        while QUIT not in (controls := pad(time.monotonic())).pressed:
            now_s = time.monotonic()
            if controls.pressed or now_s >= show_s:
                report = client.call("status")
            drive.step(controls, report, now_s)
            if drive.message != said:
                line.end()
                complain(*filter(None, [drive.message]))
                said = drive.message
            if now_s >= show_s:
                line.show(report, f"{'held' if drive.engaged else 'released'}, next {drive.depth_text}")
                show_s = now_s + RENEWAL_S
            time.sleep(POLL_S)
    finally:
        line.end()
