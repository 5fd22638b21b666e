import pytest

from firmware_host.operator.counted_nouns import counted


@pytest.mark.parametrize(("number", "reported"), [(0, "0 strides"), (1, "1 stride"), (2, "2 strides")])
def test_one_is_singular(number: int, reported: str) -> None:
    assert counted(number, "stride") == reported
