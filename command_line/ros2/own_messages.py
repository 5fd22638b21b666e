"""The project's own ROS 2 messages: a stride as in the log, and the mud's map, whole after each stride."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from control.records import COEFFICIENTS
from firmware_host.log.rows import MESSAGES, STRIDE

LAPTOP_FILES = Path(__file__).with_name("mudskipper_msgs")  # a ROS 2 package: messages, launch file, RViz, URDF
MAP_TOPIC, MAP = "/mud_map", f"{MESSAGES}/MudMap"
PARTS = (("", "value", float), ("_std_error", "std_error", float), ("_at_least", "at_least", bool))
OWN = get_typestore(Stores.EMPTY)
OWN.register(get_types_from_msg(STRIDE.definition, STRIDE.schema_name))
OWN.register(get_types_from_msg((LAPTOP_FILES / "msg/MudMap.msg").read_text(encoding="utf-8"), MAP))


def map_message(stamp_s: float, pieces: Sequence[Mapping[str, Any]]) -> bytes:
    """Encode the pieces that the socket's `map` reports."""
    columns = {
        f"{name}{suffix}": np.array([(piece[name] or {}).get(key) for piece in pieces], kind)  # None becomes NaN
        for name in COEFFICIENTS
        for suffix, key, kind in PARTS
    }
    columns["position_m"] = np.array([piece["place_m"] for piece in pieces], float)
    return bytes(OWN.serialize_cdr(OWN.types[MAP](stamp_s=stamp_s, **columns), MAP))
