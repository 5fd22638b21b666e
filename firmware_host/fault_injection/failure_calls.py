"""The methods `fail` and `failures` of the status socket, which inject failures.

The log reports each failure when it begins, with the sender of the request, and when it ends. The status lists active
failures. `disarm` ends every failure first, so that it always reaches the drives.
"""

from collections.abc import Callable
from typing import Any

from drivers.fault_injection.failure_table import EFFECTS
from drivers.fault_injection.failures import Failures, begin_text, end_text
from firmware_host.configuration.configuration import Configuration
from firmware_host.operator.operator_calls import validated
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rpc import RefusedError
from firmware_host.sockets.status_socket import Methods

FORBIDDEN = "nothing may fail on purpose here: set failures.allowed = true in the configuration, and start again"
OK, ALL = "ok", "all"

Report = Callable[[float, str], None]


def failures_of(configuration: Configuration) -> Failures | None:
    """Make the failures, or return None if the configuration does not allow any."""
    rig = configuration.rig
    return Failures(configuration.bus, joints=rig.joints) if configuration.failures.allowed else None


def with_failures(
    methods: Methods,
    failures: Failures | None,
    report: Report,
    clock: Callable[[], float],
    require_own_robot: Callable[[Caller], None],
) -> Methods:
    """Add the methods that inject failures; without failures they only refuse.

    `require_own_robot` raises RefusedError for a user who may not let the robot fail now.
    """
    if failures is None:
        nothing = {"allowed": False, "failing": [], "table": []}
        return {**methods, "fail": _refuse, "failures": lambda params, caller: nothing}
    calls = FailureCalls(failures, report, clock)

    def fail(params: dict[str, Any], caller: Caller) -> Any:
        require_own_robot(caller)
        return calls.fail(params, caller)

    def status(params: dict[str, Any], caller: Caller) -> Any:
        """Add the active failures to the status, also as warnings."""
        reported, failing = methods["status"](params, caller), calls.failing()
        warnings = [
            f"failing on purpose: {each['component']} {each['kind']}, {each['remaining_s']:.1f} s more"
            for each in failing
        ]
        return reported | {"failing": failing, "warnings": reported["warnings"] + warnings}

    def disarm(params: dict[str, Any], caller: Caller) -> Any:
        calls.end(ALL)
        return methods["disarm"](params, caller)

    added: Methods = {"fail": validated("fail", fail), "failures": validated("failures", calls.failures)}
    return {**methods, **added, "status": status, "disarm": disarm}


def _refuse(params: dict[str, Any], caller: Caller) -> Any:
    raise RefusedError(FORBIDDEN)


class FailureCalls:
    def __init__(self, failures: Failures, report: Report, clock: Callable[[], float]) -> None:
        self._failures = failures
        self._report = report
        self._clock = clock

    def fail(self, params: dict[str, Any], caller: Caller) -> list[dict[str, Any]]:
        """Make `component` fail as `kind` says for `for_s`; kind "ok" ends it. Returns the active failures."""
        component, kind, for_s = params["component"], params["kind"], float(params["for_s"])
        if kind == OK:
            self.end(component)
            return self.failing()
        refused = self._failures.refusal(component, kind, for_s)
        if refused:
            raise RefusedError(refused)
        self.end(component)  # of the one that this failure replaces
        now_s = self._clock()
        self._report(now_s, begin_text(component, kind, for_s, str(caller)))  # first: it may be the log that fails
        self._failures.begin(component, kind, now_s, for_s)
        return self.failing()

    def end(self, component: str) -> None:
        if component != ALL and component not in self._failures.families:
            raise RefusedError(self._failures.refusal(component, OK))
        failure = self._failures.end(component)
        for each in self._failures.end_all() if component == ALL else [failure] if failure else []:
            self._report(self._clock(), end_text(each))

    def failures(self, params: dict[str, Any], caller: Caller) -> dict[str, Any]:
        """Return the active failures, and all possible ones."""
        families = self._failures.families
        table = [
            {"component": name, "family": families[name], "kind": kind, "does": does}
            for name, kind, does in self._failures.table()
        ]
        return {"allowed": True, "failing": self.failing(), "table": table}

    def failing(self) -> list[dict[str, Any]]:
        """Return the active failures."""
        return [
            {
                "component": component,
                "kind": str(failure.kind),
                "remaining_s": max(0.0, failure.until_s - self._clock()),
                "does": EFFECTS[self._failures.families[component]][failure.kind],
            }
            for component, failure in self._failures.failing.items()
        ]
