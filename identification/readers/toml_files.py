"""TOML files under a schema: whatever is wrong becomes one sentence that names the key."""

import json
import math
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin
from unicodedata import category

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, create_model

from identification.readers.result_files import check_format
from identification.words import MAX_INPUT_MAGNITUDE, InputError
from identification.words.file_access import read_text

# A layout of 10,000 sites has 1 MB; Python reads 1 MB of TOML in about two seconds.
_MAX_CHARACTERS = 4_000_000
_KEY_LINE = re.compile(r"(?m)^[ \t]*([A-Za-z0-9_\"'.-]+)[ \t]*=")
_MAX_INTEGER = 2**63 - 1  # TOML 1.0: integers have 64 bits
TomlModel = TypeVar("TomlModel", bound=BaseModel)
# Kinds of a value that is a file's name or a table, so that its errors are those of its kind.
FILE_TAG, TABLE_TAG = "<file>", "<table>"


class TomlTable(BaseModel):
    """Table that refuses unknown keys, NaN, infinity and values of another type."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


def table_of(record: type, bounds: Callable[[str], Mapping[str, Any]]) -> type[TomlTable]:
    """Return a table with a key for each field of a record, of its type and with its default.

    Args:
        record: dataclass whose fields have defaults.
        bounds: returns the bounds of a key, such as ``{"ge": 0}``, by its name.
    """
    keys: dict[str, Any] = {
        each.name: (each.type, Field(default=each.default, **bounds(each.name)))
        for each in fields(record)
    }
    return create_model(record.__name__, __base__=TomlTable, **keys)


def _check_file_name(name: str) -> str:
    """Return the name of a file unless it holds a control character, such as NUL or a new line."""
    if any(category(character) == "Cc" for character in name):
        raise ValueError("a file's name holds no control characters: correct it")
    return name


_MAX_TURN_RAD = 6.3  # just above a full turn: larger values are degrees by mistake

FileName = Annotated[str, Field(min_length=1), AfterValidator(_check_file_name)]
# Rotation vector [rad].
Turn = Annotated[
    list[Annotated[float, Field(ge=-_MAX_TURN_RAD, le=_MAX_TURN_RAD)]],
    Field(min_length=3, max_length=3),
]


def read_toml(path: Path, model: type[TomlModel]) -> TomlModel:
    """Read a TOML file and check every key against a model; ``format`` may stand in any.

    Raises:
        InputError: the file is missing or not UTF-8, its syntax is wrong (with the line), a key is
            unknown or has a wrong value, or its format is newer.
    """
    content = load_toml(path)
    check_format(content.pop("format", None), path)
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{path}: {_describe_first_error(error, model)}") from error


def load_toml(path: Path) -> dict[str, object]:
    """Read a TOML file without checking its keys.

    Raises:
        InputError: the file is missing or not UTF-8, its syntax is wrong (with the line), it is
            nested too deeply, or a number is larger than any of a machine.
    """
    text = read_text(path, "name a TOML file")
    if len(text) > _MAX_CHARACTERS:
        raise InputError(
            f"{path} holds {len(text) / 1e6:.3g} million characters, at most "
            f"{_MAX_CHARACTERS / 1e6:g} are read: shorten it, most of all {_longest_key(text)}"
        )
    try:
        content = tomllib.loads(text)
        _refuse_extreme_numbers(path, content, ())
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: TOML syntax: {error}; correct that line") from error
    except RecursionError as error:
        raise InputError(f"{path} is nested too deeply: write plain tables and lists") from error
    except ValueError as error:  # Python reads integers of at most 4300 digits
        raise InputError(f"{path} holds an integer of thousands of digits: correct it") from error
    return content


def _longest_key(text: str) -> str:
    """Return the key of a TOML text whose value is longest; "its tables" if it has no key."""
    keys = list(_KEY_LINE.finditer(text))
    ends = [*(key.start() for key in keys[1:]), len(text)]
    spans = [(end - key.end(), key[1]) for key, end in zip(keys, ends, strict=True)]
    return max(spans)[1] if spans else "its tables"


def _refuse_extreme_numbers(path: Path, value: object, keys: tuple[str, ...]) -> None:
    """Refuse integers beyond 64 bits and numbers beyond any of a machine; name the key."""
    if isinstance(value, dict):
        for key, item in value.items():
            _refuse_extreme_numbers(path, item, (*keys, key))
    elif isinstance(value, list):
        for number, item in enumerate(value, start=1):
            _refuse_extreme_numbers(path, item, (*keys, str(number)))
    elif isinstance(value, int) and abs(value) > _MAX_INTEGER:
        raise InputError(f"{path}: {'.'.join(keys)} is an integer of more than 64 bits: correct it")
    elif isinstance(value, float) and math.isfinite(value) and abs(value) > MAX_INPUT_MAGNITUDE:
        raise InputError(
            f"{path}: {'.'.join(keys)} = {value:g} is larger than any quantity of a machine: "
            f"give at most {MAX_INPUT_MAGNITUDE:g}, in SI units"
        )


def _describe_first_error(error: ValidationError, model: type[BaseModel]) -> str:
    """Return a sentence on a misspelt key of a TOML file if there is one, else on its first error.

    A misspelt key comes first since the key that it stands for is then missing, too.
    """
    faults = error.errors(include_url=False)
    unknown = [fault for fault in faults if fault["type"] == "extra_forbidden"]
    for fault in unknown:
        if near := _nearest_key(model, fault["loc"]):
            return f"unknown key {_key_path(fault['loc'])}: did you mean {near}?"
    fault = faults[0]
    where = _key_path(fault["loc"])
    if fault["type"] == "extra_forbidden":
        return f"unknown key {where}: correct its spelling or remove it"
    if fault["type"] == "missing":
        return f"key {where} is missing: add it"
    if fault["type"] in ("model_type", "dict_type"):  # pydantic names the class there
        return f"{where} = {fault['input']!r}: Input should be a table"
    if fault["type"] == "too_long" and isinstance(fault["input"], list):
        limit = fault["ctx"]["max_length"]
        return f"{where} has {len(fault['input'])} entries, at most {limit} are read: give fewer"
    return f"{where} = {fault['input']!r}: {fault['msg'].removeprefix('Value error, ')}"


def _key_path(location: tuple[int | str, ...]) -> str:
    """Return the path of a key with dots; items of lists count from 1."""
    steps = (str(step + 1) if isinstance(step, int) else step for step in location)
    return ".".join(step for step in steps if step not in (FILE_TAG, TABLE_TAG))


def _nearest_key(model: type[BaseModel], location: tuple[int | str, ...]) -> str | None:
    """Return the key of a table that is spelt most like an unknown one; None if none is near.

    Args:
        model: model of the file.
        location: location of the unknown key, as pydantic gives it.
    """
    *steps, wrong = location
    kinds: list[object] = [model]
    for step in steps:
        kinds = [inner for kind in kinds for inner in _step_into(kind, step)]
    models = [m for kind in kinds for m in _plain_kinds(kind) if _is_model(m)]
    keys = {f.alias or name: name for m in models for name, f in m.model_fields.items()}
    near = get_close_matches(str(wrong).lower().replace("-", "_"), keys, 1)
    return near[0] if near else None


def _step_into(kind: object, step: int | str) -> list[object]:
    """Return the kinds of value that a step of a location leads to."""
    if step in (FILE_TAG, TABLE_TAG):
        return [kind]
    inner: list[object] = []
    for plain in _plain_kinds(kind):
        if _is_model(plain):
            fields = {f.alias or name: f.annotation for name, f in plain.model_fields.items()}
            inner += [fields[step]] if step in fields else []
        elif get_origin(plain) in (dict, list, tuple):
            inner += get_args(plain)[-1:]
    return inner


def _plain_kinds(kind: object) -> list[Any]:
    """Return the members of a union, without annotations."""
    origin = get_origin(kind)
    if origin is Annotated:
        return _plain_kinds(get_args(kind)[0])
    if origin in (Union, UnionType):
        return [plain for member in get_args(kind) for plain in _plain_kinds(member)]
    return [kind]


def _is_model(kind: object) -> bool:
    """Return whether a kind of value is a table with known keys."""
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def tag_file_or_table(value: object) -> str:
    """Return the kind of a value that is a file's name or a table."""
    return TABLE_TAG if isinstance(value, dict | BaseModel) else FILE_TAG


def toml_key(name: str) -> str:
    """Return a name as a key of a table, in quotes where TOML needs them."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)


def toml_value(value: object) -> str:
    """Return a value as TOML on one line: texts, numbers, lists and inline tables.

    Args:
        value: as ``load_toml`` returns it; texts in JSON are texts in TOML.
    """
    if isinstance(value, dict):
        pairs = ", ".join(f"{toml_key(name)} = {toml_value(each)}" for name, each in value.items())
        return f"{{{pairs}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    return json.dumps(value, ensure_ascii=False)
