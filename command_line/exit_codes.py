"""Exit statuses of `mudskipper`, as documented in the README."""

OK = 0
UNHEALTHY = 1  # a check failed, a file cannot be read, a fault is latched
USAGE = 2
NO_DAEMON = 3
NOT_PERMITTED = 4
REFUSED = 5  # the daemon is in no state to do that
TIMED_OUT = 124
CONFIGURATION = 78
INTERRUPTED = 130
