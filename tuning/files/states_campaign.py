"""A campaign of two tests: those of one as "before", those of another as "after" a change.

Its folder holds the measurements of both; models and controllers stay where they are. All else
that campaign.toml states must agree, since a campaign states it once for both.
"""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from identification.readers.campaign_toml import CampaignSettings, find_campaign_file, read_settings
from identification.readers.result_files import FORMAT
from identification.readers.toml_files import load_toml, toml_key, toml_value
from identification.words import InputError, State
from mbmodel.mjcf.source_files import read_source_files

CAMPAIGN = "campaign.toml"
_STATES: tuple[State, State] = ("before", "after")
_OF_TESTS = {"test", "log"}
_OF_FILES = {"model", "layout"}


def find_differences(first: Path, second: Path) -> list[str]:
    """Return what campaign.toml of two folders states differently beside the tests, by its keys.

    Args:
        first: folder of a campaign.
        second: folder of another one.

    Raises:
        InputError: a campaign cannot be used, or states itself what is before and after.
    """
    both = read_settings(first), read_settings(second)
    for path, settings in both:
        if any(test.state for test in settings.test):
            raise InputError(
                f"{path} states tests before and after a change itself: call mbw diagnose "
                f"{path.parent}, or compare campaigns without states"
            )
    (source, stated), (second_source, second_stated) = both
    left, right = (dict(_flatten(settings)) for _, settings in both)
    keys = [key for key in {**left, **right} if left.get(key) != right.get(key)]
    pairs = {(stated.model, second_stated.model)}
    pairs |= {
        (test.model, each.model)
        for test in stated.test
        for each in second_stated.test
        if test.model is not None and test.model == each.model
    }
    for model, second_model in sorted(pairs, key=str):
        if _read_model(source.parent, model) != _read_model(second_source.parent, second_model):
            keys.append(f"the model {model}")
    return keys


def _flatten(settings: CampaignSettings) -> Iterator[tuple[str, object]]:
    """Yield dotted keys and values of all that is neither a test nor a file."""

    def walk(name: str, value: object) -> Iterator[tuple[str, object]]:
        if isinstance(value, dict) and value:
            for key, each in value.items():
                yield from walk(f"{name}.{key}" if name else str(key), each)
        elif value not in ({}, [], None):
            yield name, value

    yield from walk("", settings.model_dump(exclude=_OF_TESTS | _OF_FILES, exclude_defaults=True))


def _read_model(folder: Path, name: str | None) -> list[bytes]:
    """Return the content of the XML files of a model; empty without a model."""
    if name is None:
        return []
    return [file.path.read_bytes() for file in read_source_files(folder / name)]


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
    base = load_toml(sources[0])
    head: dict[str, Any] = {
        key: value for key, value in base.items() if key not in (*_OF_TESTS, "format")
    }
    head = {"format": FORMAT, **head, **({"two_machines": True} if two_machines else {})}
    if "model" in head:
        head["model"] = _relative(sources[0].parent / str(head["model"]), folder)
    for loop in head.get("loop", {}).values():
        if isinstance(loop.get("controller"), str):
            loop["controller"] = _relative(sources[0].parent / loop["controller"], folder)
    text = "".join(f"{toml_key(key)} = {toml_value(value)}\n" for key, value in head.items())
    for source, state in zip(sources, _STATES, strict=True):
        for number, stated in enumerate(_list_tests(source), start=1):
            file = source.parent / str(stated["file"])
            name = f"{state}{number}_{file.name}"
            _copy(file, place / name)
            test = {**stated, "file": name, "state": state}
            if "model" in test:  # the same content in both folders
                test["model"] = _relative(sources[0].parent / str(test["model"]), folder)
            lines = (f"{toml_key(key)} = {toml_value(value)}\n" for key, value in test.items())
            text += "\n[[test]]\n" + "".join(lines)
    (place / CAMPAIGN).write_text(text, encoding="utf-8")


def _list_tests(source: Path) -> list[dict[str, Any]]:
    """Return the [[test]] tables of a campaign, its [log] among them."""
    content = CampaignSettings.add_log(load_toml(source))  # type: ignore[operator]  # pydantic
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
