"""Sentences on the gap at each level of the hits, and on laws that such tests cannot tell apart."""

from diagnosis.verdict.schema import LevelGapRow, Verdict
from diagnosis.verdict.sentences import effect_noun
from mbw.diagnose.effect_parameters import number

_MIN_STATED_PROBABILITY = 0.5  # of a cause whose law is stated


def level_sentences(verdict: Verdict) -> list[str]:
    """Return sentences on the gap at each level, on a foretold level and on laws that look alike.

    Args:
        verdict: verdict with its gap.
    """
    sentences = []
    steps = [words for row in verdict.gap.levels if (words := _fall_words(row))]
    if steps:
        sentences.append(f"Gap in times the noise, level by level: {', '.join(steps)}.")
    foretold = verdict.gap.foretold
    if foretold is not None and (words := _fall_words(foretold)):
        sentences.append(
            f"Fits to the other levels alone foretell the tests at {words}: without the effect, "
            "then with it."
        )
    for cause in verdict.causes:
        if cause.laws and cause.probability >= _MIN_STATED_PROBABILITY:
            laws = f"{', '.join(cause.laws[:-1])} or {cause.laws[-1]}"
            sentences.append(
                f"The {effect_noun(cause.effect)} may be a {laws} element: FRFs at a few levels do "
                "not tell them apart."
            )
    return sentences


def _fall_words(row: LevelGapRow) -> str:
    """Return level and gap before and after, such as ``40 N 5.1 to 1.2``."""
    before, after = row.retuned.excess, row.after.excess
    if before is None or after is None:
        return ""
    return f"{row.level:g} {row.unit} {number(before)} to {number(after)}"
