"""The text of each refused request: why the robot refuses it in its present mode, and what to do."""

from control.modes import Mode, Refusal, Request
from firmware_host.operator.fault_texts import fault_message

IN_MODE: dict[Mode, str] = {
    Mode.BOOT: "not every drive was heard yet; see 'mudskipper check'",
    Mode.IDLE: "the drives are idle; 'mudskipper arm' first",
    Mode.ARMING: "the drives are being armed; try again in a moment",
    Mode.HOLD: "the robot already holds its pose",
    Mode.WALKING: "the robot walks; 'mudskipper stop' first",
    Mode.STOPPING: "the robot is stopping; try again in a moment",
    Mode.FAULT: "a fault is present; read 'mudskipper status', then 'mudskipper clear'",
    Mode.DAMPING: "a fault lets the joints sink; wait until they rest",
}


def refusal_text(refusal: Refusal) -> str:
    """Return why the robot refuses a request in its present mode, and what to do."""
    if refusal.faults:
        return " ".join(fault_message(fault) for fault in refusal.faults)
    if refusal.request is Request.CLEAR and refusal.mode is Mode.HOLD:
        return "nothing to clear: the robot holds its pose"
    return IN_MODE[refusal.mode]
