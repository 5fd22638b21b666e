"""A watchdog that is proven by silence, against simulated ones: on, off, slow, and interrupted proofs."""

from math import isnan

import pytest

from control.rate import PERIOD_S
from drivers.odrive05.watchdog_proof import WatchdogProof

HEARTBEAT_S = 0.1
LONGEST_S = 2.0


class Drive:
    """An idle drive whose watchdog any frame feeds, and a program that sends in every tick unless it must not."""

    def __init__(self, timeout_s: float, expired: bool = False, configured_s: float = 0.1) -> None:
        self.proof = WatchdogProof(configured_s, HEARTBEAT_S)
        self.timeout_s = timeout_s
        self.expired = expired
        self.fit = True
        self.fed_s = self.now_s = self.read_before_s = 0.0
        self.due_s = 0.037
        self.cleared = 0
        self.pause_s = 0.0  # of the program, in the next tick

    def tick(self) -> None:
        self.read_before_s, self.now_s = self.now_s, self.now_s + PERIOD_S + self.pause_s
        self.pause_s = 0.0
        if 0.0 < self.timeout_s < self.now_s - self.fed_s:
            self.expired = True
        while self.due_s <= self.now_s:
            self.due_s += HEARTBEAT_S
            self.proof.on_heartbeat(self.expired, self.fit, self.now_s, self.read_before_s)
        if self.proof.must_clear:
            self.proof.begin_again()
            self.expired, self.cleared = False, self.cleared + 1
        if not self.proof.silent:
            self.fed_s = self.now_s

    def run(self, duration_s: float = LONGEST_S) -> float:
        """Runs until the proof is concluded; returns its result."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s and not self.proof.concluded:
            self.tick()
        return self.proof.watchdog_s


@pytest.mark.parametrize("expired", [False, True])
@pytest.mark.parametrize("timeout_s", [0.1, 0.05, 0.15, 0.2])
def test_a_watchdog_that_expires_within_two_heartbeats_of_its_time_is_proven(timeout_s: float, expired: bool) -> None:
    drive = Drive(timeout_s, expired)
    assert drive.run() == pytest.approx(0.1, abs=1e-9)
    assert drive.now_s < 1.0 and drive.cleared == int(expired)
    assert not drive.proof.silent  # and from then on it is fed


def test_a_watchdog_that_expires_much_earlier_has_the_time_in_which_it_did() -> None:
    drive = Drive(0.05, configured_s=0.5)
    assert 0.05 <= drive.run() < 0.05 + HEARTBEAT_S + 2.0 * PERIOD_S


@pytest.mark.parametrize("timeout_s", [0.0, 0.5, 10.0])
def test_a_watchdog_that_does_not_expire_in_its_time_is_off(timeout_s: float) -> None:
    drive = Drive(timeout_s)
    assert drive.run() == 0.0
    assert drive.now_s < 1.0 and not drive.proof.silent


def test_one_heartbeat_is_not_enough_because_the_drive_may_not_have_been_fed_before_it() -> None:
    """Just before it expires, a slow watchdog looks like a quick one."""
    drive = Drive(10.0)
    drive.fed_s = -9.9
    assert drive.run() == 0.0


def test_a_pause_of_the_program_proves_nothing() -> None:
    drive = Drive(0.9)
    while not drive.proof.silent:
        drive.tick()
    drive.pause_s = 1.0
    drive.tick()
    assert drive.expired and isnan(drive.proof.watchdog_s) and not drive.proof.silent
    assert drive.run() == 0.0


@pytest.mark.parametrize("when", ["silent", "not silent"])
def test_a_command_meanwhile_lets_it_begin_again(when: str) -> None:
    drive = Drive(0.1)
    while drive.proof.silent is not (when == "silent"):
        drive.tick()
    drive.proof.begin_again()
    assert not drive.proof.silent
    assert drive.run() == pytest.approx(0.1)
