"""Fills records from a TOML file, or lists everything that is wrong with the file.

A record is a frozen dataclass that states default, unit and bounds next to each field. The reader makes a pydantic
model of it and of the records in it, which refuses unknown keys, other types, NaN and infinity, and values out of
bounds; each problem becomes one message with key, value and bound. Tables of an array are counted from 1.
"""

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    create_model,
)
from pydantic_core import PydanticCustomError

from control.bounds import Bounds
from control.computing.suggestion import similar_name
from firmware_host.configuration.file_problems import ConfigurationError, UnreadableFileError

NUMBER_OF_TABLE = re.compile(r" \d+( \(.*?\))?")  # and its name, in a message
LARGEST_FILE_BYTES = 100_000  # ten times those of a robot or a world; the rows' socket sends it in one packet


@dataclass(frozen=True)
class ChangesOf:
    """Annotates a dict of those fields of a record that the file sets: `Annotated[dict[str, Any], ChangesOf(…)]`."""

    record: type
    without: frozenset[str] = frozenset()


def read_text(path: Path) -> str:
    """Return the text of a file; raises ConfigurationError."""
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE_BYTES + 1)
        if len(data) > LARGEST_FILE_BYTES:
            raise ConfigurationError([f"{path}: must have at most {LARGEST_FILE_BYTES} bytes"])
        return data.decode("utf-8-sig")
    except OSError as problem:
        raise UnreadableFileError([f"{path}: {problem.strerror}"]) from problem
    except UnicodeDecodeError as problem:
        line = data.count(b"\n", 0, problem.start) + 1
        raise ConfigurationError([f"{path}: not UTF-8 text (at line {line}); save the file as UTF-8"]) from problem


def parse_document(text: str, file: Path | None = None) -> dict[str, Any]:
    """Return the tables of a text; raises ConfigurationError, which names the file."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        last = text.count("\n", 0, len(text.rstrip())) + 1
        why = str(problem).replace("at end of document", f"at the end, line {last}")
        why = f"not a TOML file: {why}; fix it there: key = value, words in quotes, sections in [brackets]"
    except RecursionError:
        why = "not a TOML file that can be read: it is nested too deep"
    except ValueError:
        why = "not a TOML file that can be read: a number or a date is beyond all size"
    raise ConfigurationError([f"{file}: {why}" if file else why])


def rename_former_keys(document: dict[str, Any], former: Mapping[str, str]) -> list[str]:
    """Rename keys such as `log.min_free_share` in place; return a warning for each.

    Raises ConfigurationError where a file gives both names.
    """
    warnings = []
    for key, name in former.items():
        section, _, former_name = key.rpartition(".")
        table = document.get(section)
        if not isinstance(table, dict) or former_name not in table:
            continue
        inner, _, last = name.rpartition(".")  # a key may have moved into a section of its own
        target = table.setdefault(inner, {}) if inner else table
        if not isinstance(target, dict) or last in target:
            raise ConfigurationError([f"{key}: is the former name of {section}.{name}; remove {former_name}"])
        target[last] = table.pop(former_name)
        warnings.append(f"{key} is now {section}.{name}: rename it, the next version refuses the former name")
    return warnings


class RecordReader:
    """Reads the fields of one record, except those that no file may hold.

    `hints` replace the annotations of fields whose type depends on the file.
    """

    def __init__(self, record: type, without: Collection[str] = (), hints: dict[str, Any] | None = None) -> None:
        self._model = _model_of(record, without, hints)

    def problems(self, document: Mapping[str, Any]) -> list[str]:
        try:
            self.read(document)
        except ConfigurationError as problem:
            return problem.problems
        return []

    def read(self, document: Mapping[str, Any]) -> dict[str, Any]:
        """Return the record's fields. Raises ConfigurationError."""
        try:
            return dict(self._model.model_validate(document))
        except ValidationError as problem:
            raise ConfigurationError([self._message(error, document) for error in problem.errors()]) from problem

    def _message(self, error: Any, document: Any) -> str:
        key = _key(error["loc"], document)
        if error["type"] != "extra_forbidden":
            return _message(key, error)
        *path, name = error["loc"]
        similar = similar_name(str(name), _keys_at(self._model, path))
        return f"{key}: there is no such key{f'; did you mean {similar}?' if similar else ''}"


def _model_of(record: type, without: Collection[str] = (), others: dict[str, Any] | None = None) -> type[BaseModel]:
    """Make a pydantic model with a record's fields, defaults and bounds; `others` replace some of its annotations."""
    hints = get_type_hints(record, include_extras=True) | (others or {})
    definitions: dict[str, Any] = {}
    for item in fields(record):
        if item.name in without:
            continue
        default = item.default if item.default is not MISSING else ...
        if item.default_factory is not MISSING:
            default = Field(default_factory=item.default_factory)
        definitions[item.name] = (_checked_hint(hints[item.name]), default)
    settings = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    return create_model(record.__name__, __config__=settings, **definitions)


def _keys_at(model: type[BaseModel], path: Sequence[object]) -> set[str]:
    """Return the names of the fields at a place in a document, of every record that it may be there."""
    models = [model]
    for part in path:
        inner = [each.model_fields[str(part)].annotation for each in models if str(part) in each.model_fields]
        models = [found for hint in inner for found in _models_in(hint)] or models  # a name or number of a table
    return {name for each in models for name in each.model_fields}


def _models_in(hint: Any) -> Iterator[type[BaseModel]]:
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        yield hint
    for inner in get_args(hint):
        yield from _models_in(inner)


def _checked_hint(hint: Any) -> Any:
    """Return the type that pydantic checks for a field; a checked table becomes a record again."""
    if get_origin(hint) is Annotated:
        kind, *extras = get_args(hint)
        choice = next((extra for extra in extras if isinstance(extra, OneOf)), None)
        if choice:
            return choice.checked_hint()
        changes = next((extra for extra in extras if isinstance(extra, ChangesOf)), None)
        if changes:
            return Annotated[_model_of(changes.record, changes.without), AfterValidator(_given_fields)]
        bounds = next((extra for extra in extras if isinstance(extra, Bounds)), None)
        kind = _checked_hint(kind)
        return Annotated[kind, Field(ge=bounds.minimum, le=bounds.maximum)] if bounds else kind
    if get_origin(hint) is dict:
        return dict[str, _checked_hint(get_args(hint)[1])]  # type: ignore[misc]
    if get_origin(hint) is tuple:
        return _checked_tuple(get_args(hint))
    if get_origin(hint) is list:
        return list[_checked_hint(get_args(hint)[0])]  # type: ignore[misc]
    if get_origin(hint) is UnionType:
        return Union[tuple(map(_checked_hint, get_args(hint)))]  # noqa: UP007
    if not (is_dataclass(hint) and isinstance(hint, type)):
        return hint
    return Annotated[_model_of(hint), AfterValidator(lambda checked: hint(**dict(checked)))]


def _checked_tuple(items: tuple[Any, ...]) -> Any:
    """Return the type of an array in the file that becomes a tuple of any length, or of as many items as named."""
    inner, length = _checked_hint(items[0]), None if items[-1] is ... else len(items)
    checked = Annotated[list[inner], Field(min_length=length or 0, max_length=length), AfterValidator(tuple)]  # type: ignore[valid-type]
    return checked if is_dataclass(items[0]) else Annotated[checked, BeforeValidator(_require_array)]


def _require_array(value: object) -> object:
    if not isinstance(value, list):
        raise PydanticCustomError("array", "must be an array, in [brackets]")
    return value


@dataclass(frozen=True)
class OneOf:
    """A table that is one of several records: the value of its `key` names the record."""

    key: str
    records: Mapping[str, type]
    default: str

    def checked_hint(self) -> Any:
        tagged = tuple(Annotated[_checked_hint(record), Tag(_tag(name))] for name, record in self.records.items())
        return Annotated[Union.__getitem__(tagged), Discriminator(self._tag_of)]

    def _tag_of(self, table: Any) -> str:
        return _tag(table.get(self.key, self.default) if isinstance(table, dict) else self.default)


def _tag(name: object) -> str:
    """Return the tag of a record among several; `_key` leaves it out of the path of a key."""
    return f"<{name}>"


def _given_fields(checked: BaseModel) -> dict[str, Any]:
    """Return only the fields that the file sets; the part that makes the record has the others."""
    return {name: value for name, value in checked if name in checked.model_fields_set}


def _key(location: tuple[str | int, ...], document: Any) -> str:
    """`limits.torque_nm`, `segment 2.layer 1.factor`, `phase 1 (insertion).speed_m_s` where a table has a name."""
    key = ""
    for part in location:
        if isinstance(part, int):
            document = document[part]
            name = document.get("name") if isinstance(document, dict) else None
            key += f" {part + 1}" + (f" ({name})" if isinstance(name, str) else "")
        elif isinstance(document, Mapping) and not part.startswith("<"):  # no tag of one of several records or types
            document = document.get(part)
            key += f".{part}" if key else part
    return key


def shown(value: Any) -> str:
    """Return the text of any value of the file."""
    try:
        return repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits, tables within tables
        return "beyond all size"


def _message(key: str, error: Any) -> str:
    """`limits.torque_nm = 9.0: must be at most 5.0`."""
    value = shown(error["input"])
    bounds = error.get("ctx", {})
    match error["type"]:
        case "missing":
            return f"{key} is missing"
        case "greater_than_equal":
            return f"{key} = {value}: must be at least {bounds['ge']}"
        case "less_than_equal":
            return f"{key} = {value}: must be at most {bounds['le']}"
        case "list_type":
            return f"{key} = {value}: must be tables, each under [[{NUMBER_OF_TABLE.sub('', key)}]]"
        case "model_type":
            return f"{key} = {value}: must be a table, {{ key = value, ... }}"
        case _:
            return f"{key} = {value}: {error['msg'].removeprefix('Input ').lower()}"
