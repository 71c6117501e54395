"""Compare the JSON files of two versions: every key and number alike, digit by digit."""

import difflib
import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Difference:
    """One place where two JSON files differ.

    Attributes:
        place: keys and indices that lead there, joined by dots.
        before: what the earlier version wrote, as JSON.
        after: what the later version wrote, as JSON.
        is_sentence: whether both are sentences, whose words may change.
    """

    place: str
    before: str
    after: str
    is_sentence: bool = False


def compare_files(before: Path, after: Path) -> list[Difference]:
    """Compare two JSON files value by value, without a tolerance.

    Args:
        before: file that the earlier version wrote.
        after: file that the later version wrote.
    """
    texts = [path.read_text(encoding="utf-8") for path in (before, after)]
    return list(compare_values(*(json.loads(text) for text in texts)))


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
            yield _difference(f"{place} (keys)", list(before), list(after))
        for key in (key for key in before if key in after):
            yield from compare_values(before[key], after[key], f"{place}.{key}".lstrip("."))
    elif isinstance(before, list) and isinstance(after, list):
        if len(before) != len(after):
            yield _difference(f"{place} (length)", before, after)
        for index, pair in enumerate(zip(before, after, strict=False)):
            yield from compare_values(*pair, f"{place}.{index}".lstrip("."))
    elif not _equal(before, after):
        is_sentence = _is_sentence(before) and _is_sentence(after)
        yield _difference(place, before, after, is_sentence)


def changed_numbers(difference: Difference) -> tuple[list[str], list[str]]:
    """Return the numbers that a changed sentence lost and gained.

    Args:
        difference: of two sentences.
    """
    before, after = (
        Counter(re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text))
        for text in (difference.before, difference.after)
    )
    return sorted((before - after).elements()), sorted((after - before).elements())


def show_difference(difference: Difference) -> str:
    """Return a difference as lines to be read, of sentences the words that changed."""
    if not difference.is_sentence:
        return f"{difference.place}: {difference.before} became {difference.after}"
    lines = difflib.ndiff([difference.before], [difference.after])
    return "\n".join([f"{difference.place}:", *(f"  {line.rstrip()}" for line in lines)])


def _equal(before: object, after: object) -> bool:
    if type(before) is not type(after):
        return False
    if isinstance(before, float):
        return repr(before) == repr(after)  # the sign of zero and NaN included
    return before == after


def _is_sentence(value: object) -> bool:
    return isinstance(value, str) and any(character.isspace() for character in value)


def _difference(place: str, before: object, after: object, is_sentence: bool = False) -> Difference:
    return Difference(place, json.dumps(before), json.dumps(after), is_sentence)
