"""Compare what two versions wrote: keys, numbers, arrays and lines alike, digit by digit.

Pages and pictures (``IGNORED``) may differ; so may sentences in JSON, whose numbers may not.
"""

import difflib
import fnmatch
import json
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.io import loadmat

IGNORED = {".html", ".png", ".gif", ".svg"}
LINES = {".xml", ".urdf", ".csv", ".toml", ".txt", ".uff", ".unv", ".obj"}
_DATE = re.compile(r"\d\d-\w{3}-\d\d +\d\d:\d\d:\d\d")  # when a universal file was written
_MAT_HEADER = {"__header__", "__version__", "__globals__"}


@dataclass(frozen=True)
class Difference:
    """One place where two files differ.

    Attributes:
        file: path in the folder of results.
        place: keys and indices that lead there, joined by dots; a line, or the name of an array.
        before: what the earlier version wrote.
        after: what the later version wrote.
        is_sentence: whether both are sentences with the same numbers, whose words may change.
    """

    file: str
    place: str
    before: str
    after: str
    is_sentence: bool = False

    def __str__(self) -> str:
        """Return it as lines to be read, of sentences the words that changed."""
        if not self.is_sentence:
            return f"{self.file}, {self.place}: {self.before} became {self.after}"
        lines = difflib.ndiff([self.before], [self.after])
        return "\n".join([f"{self.file}, {self.place}:", *(f"  {line.rstrip()}" for line in lines)])


def compare_folders(
    before: Path, after: Path, ignored: Collection[str] = ()
) -> Iterator[Difference]:
    """Yield each place where two folders of results differ.

    Args:
        before: folder that the earlier version wrote.
        after: folder that the later version wrote.
        ignored: names of files that are not compared.
    """
    files = [
        {
            str(path.relative_to(folder)): path
            for path in sorted(folder.rglob("*"))
            if path.is_file() and path.suffix not in IGNORED and path.name not in ignored
        }
        for folder in (before, after)
    ]
    for name in sorted(files[0].keys() | files[1].keys()):
        pair = [each.get(name) for each in files]
        if pair[0] is None or pair[1] is None:
            yield Difference(name, "file", *("no" if path is None else "yes" for path in pair))
        else:
            yield from (replace(each, file=name) for each in compare_files(pair[0], pair[1]))


def compare_files(before: Path, after: Path) -> Iterator[Difference]:
    """Yield each place where two files differ, without a tolerance.

    Args:
        before: file that the earlier version wrote.
        after: file that the later version wrote.
    """
    if before.read_bytes() == after.read_bytes():
        return
    kind = before.suffix
    if kind == ".json":
        texts = [path.read_text(encoding="utf-8") for path in (before, after)]
        yield from compare_values(*(json.loads(text) for text in texts))
    elif kind in (".npz", ".mat"):
        yield from compare_arrays(*(_read_arrays(path) for path in (before, after)))
    elif kind in LINES:
        lines = [path.read_text(encoding="utf-8").splitlines() for path in (before, after)]
        yield from compare_lines(*([_DATE.sub("", line) for line in each] for each in lines))
    else:
        yield Difference("", "bytes", *(f"{path.stat().st_size}" for path in (before, after)))


def compare_lines(before: Sequence[str], after: Sequence[str]) -> Iterator[Difference]:
    """Yield the lines that changed, came or went; the place is the first of them.

    Args:
        before: lines of the earlier version.
        after: lines of the later version.
    """
    matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
    for kind, start, end, first, last in matcher.get_opcodes():
        if kind != "equal":
            place = f"line {start + 1}" if end > start else "(new line)"
            yield _difference(place, list(before[start:end]), list(after[first:last]))


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    if path.suffix == ".mat":
        return {k: v for k, v in loadmat(path).items() if k not in _MAT_HEADER}
    with np.load(path, allow_pickle=False) as data:
        return dict(data)


def compare_arrays(
    before: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray]
) -> Iterator[Difference]:
    """Yield each array that differs in name, type, shape or any bit of its values.

    Args:
        before: arrays of the earlier version, by name.
        after: arrays of the later version, by name.
    """
    if list(before) != list(after):
        yield _difference(_name_keys(before, after), list(before), list(after))
    for name in (name for name in before if name in after):
        first, second = before[name], after[name]
        kinds = [f"{array.dtype}{array.shape}" for array in (first, second)]
        if kinds[0] != kinds[1]:
            yield Difference("", name, *kinds)
        elif _bits(first) != _bits(second):
            yield Difference("", name, "values", _largest_change(first, second))


def _name_keys(before: Mapping[str, object], after: Mapping[str, object]) -> str:
    """Return which keys came and went, such as ``(keys +format -old)``; their order may differ."""
    came = [f"+{key}" for key in after if key not in before]
    went = [f"-{key}" for key in before if key not in after]
    order = (
        [] if [k for k in before if k in after] == [k for k in after if k in before] else ["order"]
    )
    return f"(keys {' '.join(came + went + order)})"


def _bits(array: np.ndarray) -> object:
    """Return what must agree of an array: its bytes, or the words in cells of MATLAB."""
    return repr(array.tolist()) if array.dtype.hasobject else array.tobytes()


def _largest_change(before: np.ndarray, after: np.ndarray) -> str:
    """Return how far apart two arrays are, of numbers relative to the largest one."""
    if before.dtype.kind not in "fcui":
        return "others"
    with np.errstate(all="ignore"):
        size = np.nanmax(np.abs(after - before)) / np.nanmax(np.abs(before))
    return f"values that differ by {size:.1e} of the largest"


def compare_values(before: object, after: object, place: str = "") -> Iterator[Difference]:
    """Yield each place where two decoded JSON values differ.

    Keys, their order, the length of lists, types and numbers must agree exactly. A text without
    white space is a name and must agree too; texts with white space are sentences.

    Args:
        before: value of the earlier version.
        after: value of the later version.
        place: where both stand in their files.
    """
    if isinstance(before, dict) and isinstance(after, dict):
        if list(before) != list(after):
            yield _difference(
                f"{place} {_name_keys(before, after)}".lstrip(), list(before), list(after)
            )
        for key in (key for key in before if key in after):
            yield from compare_values(before[key], after[key], f"{place}.{key}".lstrip("."))
    elif isinstance(before, list) and isinstance(after, list):
        if len(before) != len(after):
            yield _difference(f"{place} (length)", before, after)
        for index, pair in enumerate(zip(before, after, strict=False)):
            yield from compare_values(*pair, f"{place}.{index}".lstrip("."))
    elif not _equal(before, after):
        is_sentence = all(map(_is_sentence, (before, after))) and not any(
            changed_numbers(str(before), str(after))
        )
        yield _difference(place, before, after, is_sentence=is_sentence)


def changed_numbers(before: str, after: str) -> tuple[list[str], list[str]]:
    """Return the numbers that a sentence lost and gained.

    Args:
        before: sentence of the earlier version.
        after: sentence of the later version.
    """
    numbers = [
        Counter(re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text))
        for text in (before, after)
    ]
    lost, gained = numbers[0] - numbers[1], numbers[1] - numbers[0]
    return sorted(lost.elements()), sorted(gained.elements())


def is_allowed(file: str, place: str, allowed: Sequence[Mapping[str, str]]) -> str | None:
    """Return why a difference is meant; None if it is not.

    Args:
        file: group and path of the file.
        place: in the file.
        allowed: rows of ``allowed.toml``, whose ``file`` and ``key`` are patterns of a shell.
    """
    for row in allowed:
        if fnmatch.fnmatchcase(file, row["file"]) and fnmatch.fnmatchcase(place, row["key"]):
            return row["reason"]
    return None


def _equal(before: object, after: object) -> bool:
    if type(before) is not type(after):
        return False
    if isinstance(before, float):
        return repr(before) == repr(after)  # the sign of zero and NaN included
    return before == after


def _is_sentence(value: object) -> bool:
    return isinstance(value, str) and any(character.isspace() for character in value)


def _difference(
    place: str, before: object, after: object, *, is_sentence: bool = False
) -> Difference:
    return Difference("", place, json.dumps(before), json.dumps(after), is_sentence)
