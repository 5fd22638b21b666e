"""The operator at a real bench answers prompts."""

import pytest

from experiments.bench.operator import BenchOperator
from tests.scripted_operator import ScriptedOperator


def nothing() -> None: ...


@pytest.mark.parametrize(("answer", "consents"), [("", True), ("n", False)])
def test_nothing_moves_without_permission(answer: str, consents: bool) -> None:
    operator = ScriptedOperator(answer)
    assert BenchOperator(operator, sure=False).allows_motion("It moves.", nothing) is consents
    assert operator.asked == ["It moves."]
