"""Places and directions of a verdict in words."""

from identification.words import Dof, UsageError
from mbmodel import WORLD

LEVELS = "levels"  # instead of a direction: from one visit to a level to the next


def name_direction(dof: str | None) -> str:
    """Return a direction or test in words, such as ``along z``, ``x and y`` or ``set-up b``.

    Args:
        dof: such as ``tz``, ``tx+ty``, ``acc11:+ty``, a set-up, or ``levels`` for the tests of each
            level; None for an empty text.
    """
    if dof is None:
        return ""
    if dof == LEVELS:
        return "tests of each level"
    if "+" in dof and ":" not in dof:
        return " and ".join(part[1:] for part in dof.split("+"))
    if len(dof) == 2 and dof[0] in "tr":
        return f"{'along' if dof[0] == 't' else 'about'} {dof[1]}"
    try:
        return f"hit at {Dof.parse(dof)}"
    except (UsageError, ValueError):
        return f"set-up {dof}"


def name_place(location: str) -> str:
    """Return the name of a place, such as ``acc1 and acc2`` of ``sensor:acc1+acc2``.

    Names of bodies may hold hyphens; then those of a pair stay as the location joins them.
    """
    kind, _, name = location.partition(":")
    if kind == "pair" and name.count("-") == 1:
        lower, upper = name.split("-")
        return f"{'the ground' if lower == WORLD else lower} and {upper}"
    return name.replace("+", " and ") if kind == "sensor" else name
