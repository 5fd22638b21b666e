"""Lists the exit statuses of `mudskipper` with their meanings. The reference and the help print this table."""

OK = 0
UNHEALTHY = 1
USAGE = 2
NO_DAEMON = 3
NOT_PERMITTED = 4
REFUSED = 5
TORQUE_UNKNOWN = 6
CONFIGURATION = 78
TIMED_OUT = 124
INTERRUPTED = 130
MEANINGS = {
    OK: "done",
    UNHEALTHY: "a check failed, a fault is latched, or a file cannot be read",
    USAGE: "wrong command line",
    NO_DAEMON: "no daemon answers",
    NOT_PERMITTED: "not permitted",
    REFUSED: "the daemon refuses that in its present state",
    TORQUE_UNKNOWN: "torque unknown: cut motor power",
    CONFIGURATION: "the configuration is wrong",
    TIMED_OUT: "the robot did not get there in time",
    INTERRUPTED: "interrupted, as by Ctrl-C",
}
