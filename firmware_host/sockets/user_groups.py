"""Resolves the configured groups to the rights of the sockets, once, at the start.

A name service may be slow, and a tick cannot wait.
"""

import grp
import os
from contextlib import suppress

from firmware_host.configuration.configuration import StatusParameters
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.sockets.rights import Group, Rights

VIEWERS = "mudskipper-view"  # which the installation makes: its members read, and do not drive


def load_rights(parameters: StatusParameters) -> Rights:
    """Resolve the configured groups; raises ConfigurationError for a group that does not exist."""
    groups, problems = [], []
    for key, name, usual in (
        ("read_group", parameters.read_group, VIEWERS),
        ("drive_group", parameters.drive_group, ""),
    ):
        try:
            groups.append(_find_group(name, usual))
        except KeyError:
            missing = f"status.{key} = {name!r}: there is no such group"
            problems.append(f"{missing}; make it with 'groupadd {name}', or leave the key out")
    if problems:
        raise ConfigurationError(problems)
    readers, operators = groups
    return Rights(readers, operators, os.geteuid(), parameters.anyone_may_stop)


def _find_group(name: str, usual: str) -> Group:
    """Return the group with this name; for an empty one the usual group, or the daemon's own. Raises KeyError."""
    if name:
        return Group(name, grp.getgrnam(name).gr_gid)
    with suppress(KeyError):
        return Group(usual, grp.getgrnam(usual).gr_gid)
    own = os.getegid()
    try:
        return Group(grp.getgrgid(own).gr_name, own)
    except KeyError:
        return Group(str(own), own)
