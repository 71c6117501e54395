"""``mbw blind merge``: shards of a blind test become the folder that the whole test would have."""

import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from identification.words import InputError
from mbw.blind.case import BlindCase, is_finished
from mbw.blind.page import GRADES
from mbw.blind.request import Shard, prepare_folder, read_request
from mbw.blind.running import write_hashes
from mbw.blind.verb import grade_cases
from mbw.output_folder import ResultOptions, source_of

_SHARD_KEYS = ("shard", "cases", "version")  # which the request of a whole test lacks
_DIFFERENCES = {
    "model": "another model",
    "seed": "another seed",
    "band": "another band",
    "choice": "another choice of effects, places, sizes or dirt",
    "cases": "another number of cases",
    "version": "another version of mbw",
}


def run(folders: list[Path], outputs: ResultOptions) -> Path:
    """Copy the cases of all shards into one folder, and grade them.

    Args:
        folders: folders of the shards, in any order.
        outputs: where the whole test is written.

    Returns:
        The folder of the test.

    Raises:
        InputError: shards are of different tests, or one of them is missing or not finished.
    """
    request, shards = _read_shards(folders)
    model, cases = _find_model(shards.values()), _find_cases(request, shards)
    whole = {key: value for key, value in request.items() if key not in _SHARD_KEYS}
    with outputs.open("blind", model, "blind", ()) as output:
        out = output.path.absolute()
        prepare_folder(whole, out, overwrite=outputs.overwrite)
        merged = [_copy(case, out) for case in cases]
        write_hashes(merged)
        drawn = [case for case in merged if case.sealed.is_file()]
        grade_cases(output, drawn, model.stem, outputs)
    return out


def _read_shards(folders: Sequence[Path]) -> tuple[Mapping[str, Any], dict[int, Path]]:
    """Return what the shards have in common, and their folders by number.

    Raises:
        InputError: a folder holds no shard, or shards do not make one whole test.
    """
    first: Mapping[str, Any] = {}
    shards: dict[int, Path] = {}
    count = 0
    for folder in folders:
        request = read_request(folder)
        if not {*_SHARD_KEYS} <= request.keys():
            raise InputError(f"{folder} holds a whole test, no shard: name folders of --shard")
        shard = Shard.read(request["shard"], request["cases"])
        first, count = first or request, count or shard.count
        for key, words in _DIFFERENCES.items():
            if request.get(key) != first.get(key):
                raise InputError(
                    f"{folder} has {words} than {folders[0]}: merge shards of one test"
                )
        if shard.count != count:
            raise InputError(
                f"{folder} is one of {shard.count} shards and {folders[0]} one of {count}: merge "
                "shards of one test"
            )
        if shard.number in shards:
            raise InputError(
                f"{folder} and {shards[shard.number]} are both shard {shard}: name each once"
            )
        shards[shard.number] = folder
    missing = [str(Shard(number, count)) for number in range(1, count + 1) if number not in shards]
    if missing:
        raise InputError(f"shard {', '.join(missing)} is missing: name its folder, too")
    return first, shards


def _find_model(folders: Iterable[Path]) -> Path:
    """Return the model from which the shards were made; its file need not be here.

    Raises:
        InputError: a shard has no grades.
    """
    models = []
    for folder in folders:
        model = source_of(folder, GRADES)
        if model is None:
            raise InputError(f"{folder} is not finished: run its shard again, which continues")
        models.append(model)
    return models[0]


def _find_cases(request: Mapping[str, Any], shards: Mapping[int, Path]) -> list[BlindCase]:
    """Return all cases in the folders of their shards.

    Raises:
        InputError: a case is not finished, or was altered.
    """
    count = request["cases"]
    cases = []
    for number, folder in sorted(shards.items()):
        for case_number in Shard(number, len(shards)).numbers(count):
            case = BlindCase(request["model"], request["seed"], case_number, folder)
            if not is_finished(case):
                raise InputError(
                    f"case {case.name} in {folder} is not finished or was altered: run its shard "
                    "again, which continues"
                )
            cases.append(case)
    return sorted(cases, key=lambda case: case.number)


def _copy(case: BlindCase, out: Path) -> BlindCase:
    """Copy the files of a case into the folder of the whole test."""
    copy = replace(case, out=out)
    if copy.folder.is_dir():  # of an interrupted merge
        shutil.rmtree(copy.folder)
    shutil.copytree(case.folder, copy.folder)
    if case.sealed.is_file():
        copy.sealed.parent.mkdir(exist_ok=True)
        shutil.copyfile(case.sealed, copy.sealed)
    return copy
