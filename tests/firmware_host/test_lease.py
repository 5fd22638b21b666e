"""A lease is lost by silence or disconnection, and stays lost until it is released or reset."""

import pytest

from firmware_host.lease import Lease

HALF_S = 0.5


@pytest.fixture
def lease() -> Lease:
    """Return a lease that Anna holds from 10.0 s to 10.5 s."""
    lease = Lease()
    lease.renew("anna", 10.0, HALF_S)
    return lease


def test_without_a_lease_nothing_is_lost() -> None:
    lease = Lease()
    assert not lease.held and not lease.lost(1e9)
    lease.hang_up("anna")
    assert not lease.lost(1e9)


def test_a_lease_that_is_renewed_in_time_is_never_lost() -> None:
    lease = Lease()
    for number in range(100):
        now_s = 10.0 + 0.2 * number
        assert not lease.lost(now_s)
        assert lease.renew("anna", now_s, HALF_S) is None
    assert lease.held and lease.holder == "anna"


def test_a_renewal_replaces_the_earlier_deadline() -> None:
    lease = Lease()
    lease.renew("anna", 10.0, 5.0)
    lease.renew("anna", 11.0, HALF_S)
    assert not lease.lost(11.5) and lease.lost(11.51)


def test_a_late_renewal_does_not_restore_the_lease(lease: Lease) -> None:
    refused = lease.renew("anna", 10.6, HALF_S)
    assert refused is not None and "anna has lost the lease" in refused
    assert lease.lost(10.7) and lease.lost(0.0) and not lease.held


def test_a_holder_that_disconnects_loses_the_lease_at_once(lease: Lease) -> None:
    lease.hang_up("ben")
    assert not lease.lost(10.1)
    lease.hang_up("anna")
    assert lease.lost(10.1)


def test_a_holder_may_disconnect_after_its_release() -> None:
    lease = Lease()
    assert lease.release("ben") is None  # without a lease too
    lease.renew("anna", 10.0, HALF_S)
    assert lease.release("anna") is None
    lease.hang_up("anna")
    assert not lease.lost(1e9) and not lease.held


def test_a_refused_program_neither_renews_nor_frees_the_lease(lease: Lease) -> None:
    assert "0.4 s" in (lease.renew("ben", 10.1, HALF_S) or "")  # until it is free
    assert lease.release("ben") is not None
    assert lease.held and lease.lost(10.51)


def test_a_lost_lease_is_freed_only_by_its_holder(lease: Lease) -> None:
    """Otherwise a robot would move on after its program has died. The holder's release may be read after its end."""
    lease.hang_up("anna")
    assert lease.renew("ben", 10.1, HALF_S) is not None
    assert lease.release("ben") is not None
    lease.oust("ben")
    assert lease.lost(10.1)
    assert lease.release("anna") is None
    assert not lease.lost(1e9)
    assert lease.renew("ben", 10.2, HALF_S) is None


def test_a_lease_that_runs_out_is_lost_from_the_update_on(lease: Lease) -> None:
    lease.update(10.5)
    assert lease.held and not lease.lost(10.5)
    lease.update(10.51)
    assert not lease.held and lease.lost(10.0) and lease.holder == "anna"


def test_only_the_holder_moves_the_robot_if_there_is_one() -> None:
    lease = Lease()
    assert lease.refusal("anna", 10.0) is lease.refusal("ben", 10.0) is None
    lease.renew("anna", 10.0, HALF_S)
    assert lease.refusal("anna", 10.1) is None
    assert "anna operates the robot" in (lease.refusal("ben", 10.1) or "")
    assert "anna has lost the lease" in (lease.refusal("ben", 10.6, take_over=True) or "")  # the robot stops
    lease.reset()
    assert lease.refusal("ben", 10.7) is None


def test_an_ousted_program_is_refused_until_it_connects_again(lease: Lease) -> None:
    assert lease.refusal("ben", 10.1, take_over=True) is None
    lease.oust("ben")
    assert not lease.held and not lease.lost(99.0)
    lease.reset()  # called when the torque goes off
    for refused in (
        lease.refusal("anna", 10.2),
        lease.refusal("anna", 10.2, take_over=True),
        lease.renew("anna", 10.2, 1.0),
    ):
        assert refused == "taken over: ben wanted the robot; begin again when it is free"
    lease.hang_up("anna")
    assert not lease.lost(99.0) and lease.renew("anna", 99.0, 1.0) is None


def test_a_holder_cannot_oust_itself(lease: Lease) -> None:
    lease.oust("anna")
    assert lease.held and lease.refusal("anna", 10.1) is None
