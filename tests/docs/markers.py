"""Markers between which the figures of a Markdown page stand, and their replacement."""

import re
from collections.abc import Callable, Mapping

OPENING = re.compile(r"<!-- bench:([a-z0-9_-]+) -->")
CLOSING = "<!-- /bench -->"
MARKED = re.compile(rf"{OPENING.pattern}(.*?){re.escape(CLOSING)}", re.DOTALL)
# What a rate with its interval or its number of cases looks like in prose.
RATE_IN_PROSE = re.compile(r"\d %\s+\[\d|\bn = \d|\d of \d+ (?:campaigns|cases|machines)")


class MarkerError(ValueError):
    """A marker that is not closed or whose key no figure has."""


def regenerate(text: str, figures: Mapping[str, Callable[[], str]]) -> str:
    """Return a page with every marked figure made anew.

    A figure of one line stands within its sentence; one of several lines, a table, between blank
    lines.

    Args:
        text: Markdown with markers.
        figures: what makes the figure of each key.
    """
    marked = [match.span() for match in MARKED.finditer(text)]
    for match in OPENING.finditer(text):
        if not any(start == match.start() for start, _ in marked):
            raise MarkerError(f"marker {match[0]} is not closed by {CLOSING}")

    def replacement(match: re.Match[str]) -> str:
        key = match[1]
        if key not in figures:
            raise MarkerError(f"no figure {key}; python -m tests.docs --list prints all keys")
        figure = figures[key]()
        begins_line = text[: match.start()].endswith("\n") or match.start() == 0
        if begins_line and "\n" not in figure:
            raise MarkerError(f"figure {key} begins a line, which Markdown then takes for HTML")
        inside = f"\n\n{figure}\n\n" if "\n" in figure else figure
        return f"<!-- bench:{key} -->{inside}{CLOSING}"

    return MARKED.sub(replacement, text)


def unmarked_table_lines(text: str) -> list[str]:
    """Return the lines of tables with digits that stand outside markers, equations and code."""
    return [
        line
        for line in _unmarked(text).splitlines()
        if line.lstrip().startswith("|") and re.search(r"\d", re.sub(r"`[^`]*`", "", line))
    ]


def unmarked_rates(text: str) -> list[str]:
    """Return the measured rates in prose that stand outside markers, equations and code."""
    return [match[0] for match in RATE_IN_PROSE.finditer(_unmarked(text))]


def _unmarked(text: str) -> str:
    """Return a page without marked figures, equations in lines, and blocks of code."""
    text = re.sub(r"\$[^$\n]+\$", "", MARKED.sub("", text))
    return re.sub(r"^(```+).*?^\1", "", text, flags=re.DOTALL | re.MULTILINE)
