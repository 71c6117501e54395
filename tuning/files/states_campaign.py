"""A campaign of two tests: those of one as "before", those of another as "after" a change.

Its folder holds the measurements of both; models and controllers stay where they are. All else
that campaign.toml states must agree, since a campaign states it once for both.
"""

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification.readers.campaign_toml import CampaignSettings, find_campaign_file, read_settings
from identification.readers.controller import read_controller
from identification.readers.result_files import FORMAT
from identification.readers.toml_files import load_toml, toml_key, toml_value
from identification.words import InputError, State
from mbmodel.mjcf.source_files import possible_files, read_source_files

CAMPAIGN = "campaign.toml"
_STATES: tuple[State, State] = ("before", "after")
_OF_TESTS = {"test", "log"}
_OF_FILES = {"model", "layout"}
_OF_LOOKS = "texture"  # MJCF element of files without mechanics


def find_differences(first: Path, second: Path) -> list[str]:
    """Return what campaign.toml of two folders states differently beside the tests, by its keys.

    Files count by their content: controllers, models, and what a model reads but its textures.

    Args:
        first: folder of a campaign.
        second: folder of another one.

    Raises:
        InputError: a campaign cannot be used.
    """
    both = read_settings(first), read_settings(second)
    (source, stated), (second_source, second_stated) = both
    left, right = (
        {**dict(_flatten(settings)), **_read_controllers(path.parent, settings)}
        for path, settings in both
    )
    keys = [key for key in {**left, **right} if left.get(key) != right.get(key)]
    pairs = {(stated.model, second_stated.model)}
    pairs |= {
        (test.model, each.model)
        for test in stated.test
        for each in second_stated.test
        if test.model is not None and test.model == each.model
    }
    for model, second_model in sorted(pairs, key=str):
        if model is not None and second_model is not None:
            keys += _compare_models(source.parent / model, second_source.parent / second_model)
    return list(dict.fromkeys(keys))


def _flatten(settings: CampaignSettings) -> Iterator[tuple[str, object]]:
    """Yield dotted keys and values of all that is neither a test nor a file."""

    def walk(name: str, value: object) -> Iterator[tuple[str, object]]:
        if isinstance(value, dict) and value:
            for key, each in value.items():
                yield from walk(f"{name}.{key}" if name else str(key), each)
        elif value not in ({}, [], None):
            yield name, value

    yield from walk("", settings.model_dump(exclude=_OF_TESTS | _OF_FILES, exclude_defaults=True))


def _read_controllers(folder: Path, settings: CampaignSettings) -> dict[str, object]:
    """Return the numbers of the controllers in files of their own, by their keys."""
    return {
        f"loop.{name}.controller": [
            np.asarray(part).tolist()
            for part in vars(read_controller(folder / table.controller)).values()
        ]
        for name, table in settings.loop.items()
        if isinstance(table.controller, str)
    }


def _compare_models(first: Path, second: Path) -> list[str]:
    """Return what differs in two models: their texts, or files that equal texts name."""
    left, right = (read_source_files(path) for path in (first, second))
    if [each.path.read_bytes() for each in left] != [each.path.read_bytes() for each in right]:
        return [f"the model {first.name}"]
    pairs = zip(possible_files(left), possible_files(right), strict=True)
    return [
        f"the {tag} {name}"
        for (tag, name, file), (*_, second_file) in pairs
        if tag != _OF_LOOKS and file.is_file() and second_file.is_file()
        if file.read_bytes() != second_file.read_bytes()
    ]


def write_states_campaign(
    first: Path, second: Path, place: Path, folder: Path, *, two_machines: bool = False
) -> None:
    """Write the campaign of two tests.

    Args:
        first: folder of the campaign whose tests are before.
        second: folder of the campaign whose tests are after.
        place: existing folder into which files are written.
        folder: where these files are in the end, from which paths count.
        two_machines: whether both are machines of one drawing, not one machine.

    Raises:
        InputError: a file cannot be read or copied.
    """
    sources = [find_campaign_file(path) for path in (first, second)]
    extra = {"two_machines": True} if two_machines else {}
    text = _table_text(_read_head(sources[0], folder, extra))
    for source, state in zip(sources, _STATES, strict=True):
        for number, stated in enumerate(_list_tests(source), start=1):
            file = source.parent / str(stated["file"])
            name = f"{state}{number}_{file.name}"
            _copy(file, place / name)
            test = _move_model({**stated, "file": name, "state": state}, source, folder)
            text += "\n[[test]]\n" + _table_text(test)
    (place / CAMPAIGN).write_text(text, encoding="utf-8")


def write_campaign_with_model(
    source: Path,
    model: str,
    place: Path,
    folder: Path,
    delays: Mapping[str, float] | None = None,
) -> None:
    """Write the campaign.toml of a campaign with another model; its measurements stay.

    Args:
        source: campaign.toml.
        model: file name of the model in the folder.
        place: existing folder into which the file is written.
        folder: where it is in the end, from which paths count.
        delays: that are added to those of control loops [s], by the loop's name.

    Raises:
        InputError: campaign.toml cannot be read.
    """
    head = _read_head(source, folder, {})
    for name, delay in (delays or {}).items():
        loop = head["loop"][name]
        loop["delay"] = float(loop.get("delay", 0.0)) + delay
    text = _table_text({**head, "model": model})
    for stated in _list_tests(source):
        file = _relative(source.parent / str(stated["file"]), folder)
        text += "\n[[test]]\n" + _table_text(_move_model({**stated, "file": file}, source, folder))
    (place / CAMPAIGN).write_text(text, encoding="utf-8")


def write_campaign_with_tests(
    source: Path, tests: Sequence[Mapping[str, Any]], place: Path, folder: Path
) -> None:
    """Write the campaign.toml of a campaign with other tests, whose files lie in the folder.

    Args:
        source, place, folder: as for ``write_campaign_with_model``.
        tests: content of each ``[[test]]``.

    Raises:
        InputError: campaign.toml cannot be read.
    """
    text = _table_text(_read_head(source, folder, {}))
    for test in tests:
        text += "\n[[test]]\n" + _table_text(_move_model(dict(test), source, folder))
    (place / CAMPAIGN).write_text(text, encoding="utf-8")


def _read_head(source: Path, folder: Path, extra: dict[str, Any]) -> dict[str, Any]:
    """Return all that campaign.toml states beside its tests, with paths from another folder."""
    base = load_toml(source)
    stated = {key: value for key, value in base.items() if key not in (*_OF_TESTS, "format")}
    head: dict[str, Any] = {"format": FORMAT, **stated, **extra}
    head = _move_model(head, source, folder)
    for loop in head.get("loop", {}).values():
        if isinstance(loop.get("controller"), str):
            loop["controller"] = _relative(source.parent / loop["controller"], folder)
    return head


def _move_model(table: dict[str, Any], source: Path, folder: Path) -> dict[str, Any]:
    """Return a table whose model, if it names one, has its path from another folder."""
    if "model" not in table:
        return table
    return {**table, "model": _relative(source.parent / str(table["model"]), folder)}


def _table_text(table: dict[str, Any]) -> str:
    """Return the lines of a table of TOML."""
    return "".join(f"{toml_key(key)} = {toml_value(value)}\n" for key, value in table.items())


def _list_tests(source: Path) -> list[dict[str, Any]]:
    """Return the [[test]] tables of a campaign, its [log] among them."""
    content = CampaignSettings.add_log(load_toml(source))  # type: ignore[operator]  # pydantic
    if not content.get("test"):
        raise InputError(f"{source} has no [[test]]: restore the file that was read")
    return [dict(test) for test in content["test"]]


def _relative(path: Path, folder: Path) -> str:
    """Return the path of a file from a folder, with slashes."""
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # two drives of Windows
        return path.resolve().as_posix()


def _copy(file: Path, target: Path) -> None:
    """Copy a measurement.

    Raises:
        InputError: it cannot be copied.
    """
    try:
        shutil.copyfile(file, target)
    except OSError as error:
        raise InputError(
            f"{file} cannot be copied to {target.parent} ({error.strerror}): name another folder "
            "with --out"
        ) from error
