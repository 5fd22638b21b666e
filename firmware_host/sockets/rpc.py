"""MessagePack-RPC as the status socket understands it: it decodes requests and rejects malformed ones.

A request is [0, id, method, params], its answer [1, id, error, result] (the MessagePack-RPC specification). Params are
a flat map from names to plain values or short arrays of them, which is all that the methods take; other nested values,
non-finite numbers and extension types are refused. Lengths are bounded before memory is allocated: a header of three
bytes may announce 65535 elements, for which the unpacker makes room at once, and headers can be nested.
"""

from math import isfinite
from typing import Any

import msgpack

REQUEST, RESPONSE = 0, 1
LONGEST_REQUEST = 4 * 1024  # bytes
LONGEST_METHOD = 64
MOST_PARAMS = 16
PARTS = 4  # of a request
LONGEST_ARRAY = 8  # numbers of a param; an announced array takes memory before its elements come

NOT_PERMITTED = "not permitted: "  # prefix of a refusal for missing rights
FOR_MEMBERS = "for members of the group "  # precedes the name of the group
LONGEST = f"at most {MOST_PARAMS} params, arrays of at most {LONGEST_ARRAY}"
SHAPE = f"a request is [0, id, method, params] in MessagePack, with {LONGEST}"

TOO_LONG = f"a request has at most {LONGEST_REQUEST} bytes"


class RefusedError(Exception):
    """The daemon understood a request and refuses it; the text says why."""


class MalformedError(Exception):
    """A message is not a request; the text describes a request."""


def make_unpacker(read_bytes: int) -> msgpack.Unpacker:
    """Make an unpacker for data that arrives in pieces of at most `read_bytes`."""
    return msgpack.Unpacker(
        max_buffer_size=LONGEST_REQUEST + read_bytes,
        max_array_len=LONGEST_ARRAY,
        max_map_len=MOST_PARAMS,
        max_str_len=LONGEST_REQUEST,
        max_bin_len=LONGEST_REQUEST,
        max_ext_len=LONGEST_REQUEST,
        raw=False,
    )


def read_shape(message: Any) -> tuple[int, str, Any]:
    """Return number, method and params of a request; raises MalformedError."""
    if not isinstance(message, list) or len(message) != PARTS:
        raise MalformedError(SHAPE)
    kind, number, method, params = message
    if type(kind) is not int or kind != REQUEST or type(number) is not int or number < 0:
        raise MalformedError(SHAPE)
    if not isinstance(method, str) or len(method) > LONGEST_METHOD or not isinstance(params, list | dict):
        raise MalformedError(SHAPE)
    return number, method, params


def read_params(params: Any) -> dict[str, Any]:
    """Return the params, which are a map, or a list that contains one map; raises RefusedError."""
    if isinstance(params, list):
        params = params[0] if params else {}
    if not isinstance(params, dict) or not all(isinstance(key, str) for key in params):
        raise RefusedError("params must be a map from names to values")
    for key, value in params.items():
        for each in value if isinstance(value, list) else [value]:
            if each is not None and not isinstance(each, bool | int | float | str):
                plain = "a number, a text, true, false, nothing or an array of numbers"
                raise RefusedError(f"{key[:LONGEST_METHOD]}: must be {plain}")
            if isinstance(each, float) and not isfinite(each):
                raise RefusedError(f"{key[:LONGEST_METHOD]} = {each}: must be a finite number")
    return params
