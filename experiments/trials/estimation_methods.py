"""Several estimation methods on the same strides: the daemon's own, and others in a replay of its log.

default             in torque space, with bounds where the mud does not yield (estimation/flipper.py)
paper               the published one, without compensation (estimation/paper.py)
paper compensated   the same, with half of the body's drag added to the thrust while the body advances
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from estimation.estimation_parameters import EstimationParameters, PaperEstimationParameters
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.reports import stride_report
from logs.files.log_reader import Log
from logs.replay import replay_log

DEFAULT, PAPER, COMPENSATED = "default", "paper", "paper compensated"
Strides = list[dict[str, Any]]


def configured_method(parameters: EstimationParameters) -> str:
    """Return the name of the configured method."""
    compensated = parameters.method == "paper" and parameters.paper.compensation
    return COMPENSATED if compensated else parameters.method


def with_method(parameters: EstimationParameters, method: str) -> EstimationParameters:
    """Return the same parameters with another method."""
    if method == DEFAULT:
        return replace(parameters, method="default")
    return replace(parameters, method="paper", paper=PaperEstimationParameters(method == COMPENSATED))


def strides_by_method(
    own: Strides, log: Log, configuration: Configuration, flipper: str, methods: Sequence[str]
) -> dict[str, Strides]:
    """Return one flipper's strides of one walk; `own` are the daemon's, by the configured method."""
    configured = configured_method(configuration.estimation)
    by_method = {configured: own}
    for method in methods:
        if method != configured:
            other = replace(configuration, estimation=with_method(configuration.estimation, method))
            by_method[method] = [stride_report(stride) for stride in replay_log(Path("log"), log, other).strides]
    return {
        method: [stride for stride in strides if stride["flipper"] == flipper] for method, strides in by_method.items()
    }
