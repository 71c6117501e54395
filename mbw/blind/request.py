"""Request of a blind test: all that determines its cases, kept in the folder of the test.

A folder with another request is refused, so that no test continues the cases of another one.

A shard is every n-th case of a test: shards run apart, and ``mbw blind merge`` joins them.
"""

import hashlib
import json
import shutil
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from identification import read_settings
from identification.words import InputError, UsageError
from identification.words.file_access import read_bytes
from mbmodel.mjcf.read import current_reading
from mbw.blind.case import HASHES, REQUEST_JSON, TREES
from mbw.blind.user_test import find_model, is_campaign
from mbw.output_folder import RECORD
from truth import Choice, TruthError, read_station

_CASE_FILES = ("cases", "sealed", HASHES)  # what an interrupted test continues from


@dataclass(frozen=True)
class Shard:
    """Part of the cases of a test.

    Args:
        number: number of the shard, from 1.
        count: number of shards.
    """

    number: int
    count: int

    @classmethod
    def read(cls, text: str, cases: int) -> "Shard":
        """Read ``2/3``, the second of three shards.

        Args:
            text: the text.
            cases: number of cases of the whole test.

        Raises:
            UsageError: no such shard, or a shard without a case.
        """
        number, _, count = text.partition("/")
        if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
            raise UsageError(f"--shard {text!r}: give i/n, such as 2/3 for the second of three")
        if int(count) > cases:
            raise UsageError(f"--shard {text}: {cases} cases cannot be shared among {count} shards")
        return cls(int(number), int(count))

    def __str__(self) -> str:
        """Return the text that ``read`` reads."""
        return f"{self.number}/{self.count}"

    def numbers(self, cases: int) -> range:
        """Return the numbers of its cases.

        Args:
            cases: number of cases of the whole test.
        """
        return range(self.number - 1, cases, self.count)


def build_request(
    model: str,
    seed: int,
    band: tuple[float, float] | None,
    *,
    shard: Shard | None = None,
    cases: int = 0,
    choice: Choice | None = None,
) -> dict[str, object]:
    """Return what determines the cases of a test.

    Shards state the number of all cases and the version, so that they can be checked and joined.

    Args:
        model: MJCF of the machine, or ``trees``.
        seed: seed of the whole test.
        band: band of the verdicts [Hz]; None for the frequency lines with coherence.
        shard: the part that is run; None for all cases.
        cases: number of cases of the whole test; used for a shard alone.
        choice: effects, places and sizes that are drawn; None for the whole deck.

    Raises:
        InputError: the model cannot be read.
    """
    request: dict[str, object] = {
        "model": _fingerprint(model),
        "seed": seed,
        "band": None if band is None else list(band),
    }
    if choice is not None and choice != Choice():
        request["choice"] = json.loads(json.dumps(asdict(choice)))
    if without := current_reading().without:
        request["without"] = sorted(set(without))
    if shard is not None:
        request |= {"cases": cases, "version": version("mbworkbench"), "shard": str(shard)}
    return request


def prepare_folder(request: dict[str, object], out: Path, *, overwrite: bool) -> None:
    """Write the request into a new folder, or check that an existing folder has the same one.

    Raises:
        InputError: the folder holds something else, or cannot be written.
    """
    note = out / REQUEST_JSON
    if note.is_file() and not _is_of_another_test(note, request):
        return
    if any(path.name != RECORD for path in out.iterdir()):
        if not overwrite:
            what = "exists and is not the folder of a blind test"
            if note.is_file():
                what = "holds a blind test of another model, seed, band, choice or shard"
            raise InputError(
                f"{out} {what}: name another folder with --out, or start anew with --overwrite"
            )
        for name in _CASE_FILES:
            path = out / name
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    try:
        note.write_text(json.dumps(request) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}): name another") from error


def read_request(folder: Path) -> dict[str, Any]:
    """Return what determined the cases of a test's folder.

    Raises:
        InputError: it is not the folder of a blind test.
    """
    remedy = "name folders that mbw blind has written"
    try:
        request = json.loads(read_bytes(folder / REQUEST_JSON, remedy))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{folder / REQUEST_JSON} cannot be read ({error}): {remedy}") from error
    if not (isinstance(request, dict) and {"model", "seed", "band"} <= request.keys()):
        raise InputError(f"{folder / REQUEST_JSON} holds no request of a blind test: {remedy}")
    return request


def _is_of_another_test(note: Path, request: dict[str, object]) -> bool:
    try:
        return bool(json.loads(note.read_text("utf-8")) != request)
    except (OSError, ValueError, RecursionError):  # its writing was interrupted: no case exists yet
        return False


def _fingerprint(model: str) -> str:
    """Return the hash of an MJCF and of the files that it reads.

    Raises:
        InputError: the model cannot be read.
    """
    if model == TREES:
        return TREES
    if is_campaign(Path(model)):
        return _hash_campaign(Path(model))
    text = read_bytes(Path(model), f"name an MJCF file, or {TREES!r} for random machines")
    try:
        station = read_station(Path(model), current_reading().without)
    except TruthError as error:
        raise InputError(str(error)) from error
    combined = hashlib.sha256(text)
    contents = [mesh.content for mesh in station.meshes]
    if station.source is not None:
        contents = [content for _, content in sorted(station.source.files.items())]
    for content in contents:
        combined.update(hashlib.sha256(content).digest())
    return combined.hexdigest()


def _hash_campaign(path: Path) -> str:
    """Return the hash of campaign.toml, of the files of its tests, and of its model.

    Raises:
        InputError: one of them cannot be read.
    """
    source, settings = read_settings(path)
    combined = hashlib.sha256(read_bytes(source, "name a campaign"))
    for test in settings.test:
        content = read_bytes(source.parent / test.file, "correct file in campaign.toml")
        combined.update(hashlib.sha256(content).digest())
    combined.update(_fingerprint(str(find_model(path))).encode())
    return combined.hexdigest()
