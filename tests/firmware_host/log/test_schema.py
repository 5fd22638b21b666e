"""Rows of other versions are read with the layouts in their logs."""

from math import isnan

import pytest

from firmware_host.log.rows import EVENT, ROW_KINDS
from firmware_host.log.schema import Field, LayoutError, RowKind, read_definition

SMALL = RowKind(
    "/small",
    "test_msgs/msg/Small",
    (
        Field("stamp_s", "float64"),
        Field("force_n", "float32", each=("a", "b")),
        Field("count", "uint8", formerly=("tally",)),
        Field("ok", "bool"),
    ),
)


@pytest.mark.parametrize("kind", ROW_KINDS)
def test_each_kind_s_own_definition_describes_it(kind: RowKind) -> None:
    read = read_definition(kind, kind.definition)
    assert (read.layout.format, read.offsets) == (kind.layout.format, kind.offsets)
    assert [field.name for field in read.fields] == [field.name for field in kind.fields]


def test_a_field_is_aligned_to_its_size() -> None:
    kind = read_definition(SMALL, "bool ok\nfloat64 stamp_s\nuint8 count\nfloat32[2] force_n\n")
    assert kind.offsets == [4, 12, 20, 24]
    row = kind.encode_named(ok=True, stamp_s=3.0, count=2, force_n=(1.0, 2.0))
    assert kind.decode(row) == {"ok": True, "stamp_s": 3.0, "count": 2, "force_n": (1.0, 2.0)}
    assert kind.stamp_s(row) == 3.0


def test_a_former_name_is_read_under_the_present_one() -> None:
    assert [field.name for field in read_definition(SMALL, "uint8 tally\n").fields] == ["count"]
    assert [field.name for field in read_definition(SMALL, "uint8 tally\nuint8 count\n").fields] == ["tally", "count"]


def test_a_missing_value_is_nan_zero_false_or_empty() -> None:
    values = SMALL.decode(SMALL.encode_named())
    assert isnan(values["stamp_s"]) and all(map(isnan, values["force_n"]))
    assert (values["count"], values["ok"]) == (0, False)
    assert EVENT.decode(EVENT.encode_named(stamp_s=1.0)) == {"stamp_s": 1.0, "text": ""}


@pytest.mark.parametrize("text", ["Header h", "uint8[] count", "float32 force_n", "string count", "string a\nbool ok"])
def test_a_definition_that_cannot_be_decoded_is_refused(text: str) -> None:
    with pytest.raises(LayoutError):
        read_definition(SMALL, text)
