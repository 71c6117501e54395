"""Rivals of the established causes, whose own plants no file holds."""

from collections.abc import Collection

from diagnosis import Verdict
from mbw.page.numbers import format_percent


def rival_names(verdict: Verdict, held: Collection[str]) -> list[str]:
    """Return each cause that may be there in place of those that augmented.xml holds.

    They are the other causes of the verdict, with their probabilities, and those that the data
    hardly distinguish from the causes that are held.

    Args:
        held: causes of augmented.xml, as ``effect@location``.
    """
    further = {
        name: cause.probability
        for cause in verdict.causes
        if (name := f"{cause.effect}@{cause.location}") not in held
    }
    names = [f"{name} ({format_percent(share)})" for name, share in further.items()]
    confounded = (
        name
        for pair in verdict.twins
        if any(site in held for site in pair)
        for name in pair
        if name not in held and name not in further
    )
    return [*names, *(f"{name} (confounded)" for name in dict.fromkeys(confounded))]


def rival_sentence(verdict: Verdict, held: Collection[str]) -> str:
    """Return that the plants of rivals are not computed; empty without any.

    Args:
        held: causes of augmented.xml, as ``effect@location``.
    """
    names = rival_names(verdict, held)
    if not names or not held:
        return ""
    return (
        f"In place of {', '.join(held)} there may be {', '.join(names)}: "
        f"{'its plant is' if len(names) == 1 else 'their plants are'} not computed"
    )
