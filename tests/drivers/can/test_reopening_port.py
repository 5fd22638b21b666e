"""A port that vanishes and comes back, over mock ports, with a clock that the test advances."""

from collections.abc import Callable, Iterable

import pytest

from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus, MockPort
from drivers.can.port_health import BusState
from drivers.can.reopening_port import RETRY_S, NotOpenError, ReopeningPort

FRAME = Frame(0x009, bytes(8))
BUS_OFF = 0x040


class ListeningPort(MockPort):
    """Stores the ids that it was asked to listen to."""

    ids: frozenset[int] | None = None

    def listen_to(self, ids: Iterable[int]) -> None:
        self.ids = frozenset(ids)


class Adapter:
    """An adapter that is plugged in or not, with every port that was opened on it."""

    def __init__(self, plugged: bool = True) -> None:
        self.plugged = plugged
        self.bus = MockBus()
        self.peer = self.bus.open()
        self.opened: list[ListeningPort] = []
        self.tries = 0

    def open(self) -> MockPort:
        self.tries += 1
        if not self.plugged:
            raise NotOpenError("there is no such interface")
        self.opened.append(ListeningPort(self.bus))
        self.bus.ports.append(self.opened[-1])
        return self.opened[-1]

    def vanish(self) -> None:
        self.plugged = False
        self.opened[-1].state = BusState.OFF
        self.opened[-1].last_error = "No such device"
        self.opened[-1].failed_sends, self.opened[-1].error_frames = 3, 2


def run(port: ReopeningPort, since_s: float, for_s: float, done: Callable[[], bool] = lambda: False) -> float:
    """Run ticks of 0.1 s until `done` or the end, and return the time."""
    now_s = since_s
    while now_s < since_s + for_s and not done():
        port.receive()
        port.reopen(now_s)
        now_s += 0.1
    return now_s


def state_of(port: ReopeningPort) -> BusState:
    return port.state


def test_without_waiting_a_port_that_does_not_open_is_refused() -> None:
    with pytest.raises(NotOpenError, match="no such interface"):
        ReopeningPort(Adapter(plugged=False).open, wait=False)


def test_a_port_that_is_waited_for_is_off_and_says_why() -> None:
    port = ReopeningPort(Adapter(plugged=False).open, wait=True)
    port.send(FRAME)
    assert (port.state, port.last_error) == (BusState.OFF, "there is no such interface")
    assert (port.failed_sends, port.last_send_error) == (1, "there is no such interface")
    assert list(port.receive()) == []


def test_a_port_that_vanishes_is_closed_opened_again_when_it_is_back_and_active_once_it_hears_something() -> None:
    adapter = Adapter()
    port = ReopeningPort(adapter.open, wait=False)
    assert state_of(port) is BusState.ACTIVE
    adapter.vanish()
    run(port, 0.0, 3.0)
    assert (port.state, port.last_error) == (BusState.OFF, "there is no such interface")
    assert adapter.opened[0] not in adapter.bus.ports
    adapter.plugged = True
    run(port, 3.0, 3.0, lambda: len(adapter.opened) == 2)
    assert state_of(port) is BusState.OFF
    adapter.peer.send(FRAME)
    assert list(port.receive()) == [FRAME]
    assert state_of(port) is BusState.ACTIVE
    port.send(FRAME)
    assert adapter.peer.receive() == [FRAME]
    run(port, 6.0, 3.0)
    assert len(adapter.opened) == 2


def test_counts_only_grow_over_all_the_ports_there_were_and_failed_sends_count_at_once() -> None:
    adapter = Adapter()
    port = ReopeningPort(adapter.open, wait=False)
    adapter.opened[0].lost_frames = 5
    adapter.vanish()
    run(port, 0.0, 1.5)  # closed meanwhile, and not open yet
    port.send(FRAME)
    assert (port.failed_sends, port.error_frames, port.lost_frames) == (4, 2, 5)
    adapter.plugged = True
    run(port, 1.5, 3.0, lambda: len(adapter.opened) == 2)
    adapter.opened[1].full, adapter.opened[1].lost_frames = True, 2
    for count in (5, 6, 7):
        port.send(FRAME)
        assert (port.failed_sends, port.last_send_error) == (count, "No buffer space available")
    port.receive()
    assert (port.failed_sends, port.error_frames, port.lost_frames) == (7, 2, 7)


def test_a_controller_that_stays_out_of_the_bus_counts_as_off_however_often_it_is_opened() -> None:
    adapter = Adapter()
    port = ReopeningPort(adapter.open, wait=False)
    adapter.opened[0].on_error_frame(BUS_OFF, bytes(8))
    now_s = run(port, 0.0, 5.0, lambda: len(adapter.opened) == 3)
    assert now_s < 5.0
    assert state_of(port) is BusState.OFF
    adapter.opened[-1].on_error_frame(0x004, bytes((0, 0x08, 0, 0, 0, 0, 0, 0)))
    port.receive()
    assert state_of(port) is BusState.WARNING


def test_an_adapter_that_complains_when_it_is_closed_is_opened_all_the_same() -> None:
    adapter = Adapter()
    port = ReopeningPort(adapter.open, wait=False)

    def complain() -> None:
        raise OSError("write failed")

    adapter.opened[0].close = complain  # type: ignore[method-assign]
    adapter.opened[0].state = BusState.OFF
    run(port, 0.0, 3.0, lambda: len(adapter.opened) == 2)
    assert len(adapter.opened) == 2


def test_it_opens_again_exactly_a_retry_time_after_the_bus_went_off_and_says_so() -> None:
    adapter = Adapter()
    port = ReopeningPort(adapter.open, wait=False)
    assert not port.reopen(100.0)
    adapter.opened[0].state = BusState.OFF
    port.receive()
    assert [port.reopen(now_s) for now_s in (200.0, 200.9, 200.0 + RETRY_S)] == [False, False, True]
    assert len(adapter.opened) == 2


def test_a_try_that_fails_is_no_success_and_is_followed_by_the_next_a_retry_time_later() -> None:
    adapter = Adapter(plugged=False)
    port = ReopeningPort(adapter.open, wait=True)
    assert [port.reopen(now_s) for now_s in (10.0, 10.0 + RETRY_S, 10.9 + RETRY_S)] == [False] * 3
    assert adapter.tries == 2
    adapter.plugged = True
    assert port.reopen(10.0 + 2.0 * RETRY_S)


def test_a_bus_that_recovered_has_the_whole_retry_time_again_when_it_goes_off() -> None:
    adapter = Adapter()
    port = ReopeningPort(adapter.open, wait=False)
    for since_s in (10.0, 20.0):
        adapter.opened[0].state = BusState.OFF
        port.receive()
        assert not port.reopen(since_s) and not port.reopen(since_s + 0.9 * RETRY_S)
        adapter.opened[0].state = BusState.ACTIVE
        port.receive()
        assert not port.reopen(since_s + RETRY_S)
    assert len(adapter.opened) == 1


@pytest.mark.parametrize("ids", [frozenset({3}), None])
@pytest.mark.parametrize("plugged", [True, False])
def test_every_port_listens_to_the_ids_given_before_or_to_all(plugged: bool, ids: frozenset[int] | None) -> None:
    adapter = Adapter(plugged)
    port = ReopeningPort(adapter.open, wait=True)
    if ids is not None:
        port.listen_to(ids)
    if plugged:
        adapter.opened[0].state = BusState.OFF
    adapter.plugged = True
    run(port, 0.0, 3.0, lambda: len(adapter.opened) == 1 + plugged)
    assert [each.ids for each in adapter.opened] == [ids] * (1 + plugged)


def test_a_reason_is_remembered_until_there_is_another() -> None:
    adapter = Adapter()
    port = ReopeningPort(adapter.open, wait=False)
    reasons = [port.last_error]
    for reason in ("bus error", "", "bus off"):
        adapter.opened[0].last_error = reason
        port.receive()
        reasons.append(port.last_error)
    assert reasons == ["", "bus error", "bus error", "bus off"]
    assert port.last_send_error == ""


def test_a_port_that_opens_with_a_trouble_shows_it_at_once() -> None:
    adapter = Adapter()

    def open_passive() -> MockPort:
        port = adapter.open()
        port.state = BusState.PASSIVE if len(adapter.opened) > 1 else BusState.OFF
        return port

    port = ReopeningPort(open_passive, wait=False)
    assert [port.reopen(now_s) for now_s in (0.5, 1.5)] == [False, True]
    assert state_of(port) is BusState.PASSIVE
