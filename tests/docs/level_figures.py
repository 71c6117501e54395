"""Figures of the bench of levels, from the campaigns that were diagnosed so far."""

from tests.bench.kept import of
from tests.bench.levels import FIRST, figures
from tests.docs.dirty_figures import NOT_YET, count_engines
from tests.docs.formats import significant, table


def levels_table() -> str:
    """Rates of every cell with their intervals, errors of parameters, gap closed, time."""
    cells = [
        (row["figure"], significant(row["value"], 3), row["n"])
        for row in figures(list(of(f"levels.{FIRST}").values()))
    ]
    return table(("Figure", "Value", "n [95 % interval]"), cells or [(NOT_YET, "", 0)])


def levels_campaigns() -> str:
    """Number of campaigns that were diagnosed."""
    return str(sum("left_out" not in row for row in of(f"levels.{FIRST}").values()))


def levels_engines() -> str:
    """Number of campaigns by the commit of the engine, the most first."""
    return count_engines(f"levels.{FIRST}")


FIGURES = {
    "levels-table": levels_table,
    "levels-campaigns": levels_campaigns,
    "levels-engines": levels_engines,
}
