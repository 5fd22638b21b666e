"""Each depth rule gives its walk order and configuration."""

from typing import get_args

from control.parameters.adaptation_parameters import Method
from experiments.trackway.depth_rule import METHODS, chosen_by, configuration_for, constant_depth


def test_a_constant_depth_is_ordered_and_not_adapted() -> None:
    rule = constant_depth(0.035)
    assert rule.name == "3.5 cm"
    assert (rule.order.depth_m, rule.order.adaptive) == (0.035, False)


def test_every_method_of_the_adaptation_can_be_chosen() -> None:
    assert get_args(Method) == METHODS
    for method in METHODS:
        configuration = configuration_for(chosen_by(method))
        assert configuration.adaptation.method == method
        assert configuration.estimation.method == ("paper" if method == "paper" else "default")
        assert chosen_by(method).name == method
