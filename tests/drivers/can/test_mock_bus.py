"""The bus within one process: which port receives which frames, and in which order."""

from drivers.can.frames import Frame
from drivers.can.mock_bus import LONGEST_QUEUE, MockBus


def test_all_other_ports_receive_frames_in_order_and_no_port_its_own() -> None:
    bus = MockBus()
    sender, first, second = bus.open(), bus.open(), bus.open()
    sent = [Frame(0x10, b"\x01"), Frame(0x20, is_remote=True), Frame(0x18FEF100, b"\x02", is_extended=True)]
    for frame in sent:
        sender.send(frame)
    assert first.receive() == second.receive() == sent
    assert sender.receive() == first.receive() == []
    first.close()
    sender.send(sent[0])
    assert first.receive() == []


def test_an_unread_port_loses_its_oldest_frames() -> None:
    bus = MockBus()
    sender, listener = bus.open(), bus.open()
    for number in range(LONGEST_QUEUE + 3):
        sender.send(Frame(number % 0x800, number.to_bytes(2, "little")))
    kept = [int.from_bytes(frame.data, "little") for frame in listener.receive()]
    assert kept == list(range(3, LONGEST_QUEUE + 3))
