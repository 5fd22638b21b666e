"""Which robot walks by which rule."""

from typing import get_args

import pytest

from control.depth.depth_choice import AdaptationParameters, Method
from experiments.trackway.depth_rule import METHODS, chosen_by, configuration_for, constant_depth
from experiments.trials.trial import WALKING, configuration_of


def test_a_constant_depth_is_ordered_and_not_adapted() -> None:
    rule = constant_depth(0.035)
    assert rule.name == "3.5 cm"
    assert (rule.order.depth_m, rule.order.adaptive) == (0.035, False)


def test_a_method_starts_where_the_configuration_says() -> None:
    rule = chosen_by("paper", "adaptive")
    assert rule.name == "adaptive"
    assert (rule.order.depth_m, rule.order.adaptive) == (AdaptationParameters().initial_depth_m, True)


def test_every_method_of_the_adaptation_can_be_chosen() -> None:
    assert get_args(Method) == METHODS
    for method in METHODS:
        assert configuration_for(chosen_by(method)).adaptation.method == method
        assert chosen_by(method).name == method


def test_an_unknown_method_is_named() -> None:
    with pytest.raises(ValueError, match="'fog': must be one of default, paper"):
        chosen_by("fog")


def test_the_papers_choice_gets_the_papers_estimates_and_ours_gets_ours() -> None:
    assert configuration_for(chosen_by("paper")).estimation.method == "paper"
    assert configuration_for(chosen_by("default")).estimation.method == "default"


def test_but_for_the_choice_of_depth_the_robot_is_the_simulated_one() -> None:
    assert configuration_for(chosen_by("default")) == configuration_of(WALKING)
