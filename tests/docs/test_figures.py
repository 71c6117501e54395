"""Figures of README and docs stand between markers and follow from the committed results."""

import pytest

from tests.docs.figures import FIGURES
from tests.docs.formats import significant
from tests.docs.markers import (
    MarkerError,
    regenerate,
    unmarked_rates,
    unmarked_table_lines,
)
from tests.docs.pages import DOCS, markdown_pages
from tests.docs.results import ROOT

PAGES = [str(page.relative_to(ROOT)) for page in markdown_pages()]


@pytest.mark.parametrize("page", PAGES)
def test_figures_are_those_of_the_results(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    assert regenerate(text, FIGURES) == text, "python -m tests.docs makes the figures anew"


@pytest.mark.parametrize("page", PAGES)
def test_rates_stand_between_markers(page):
    assert unmarked_rates((ROOT / page).read_text(encoding="utf-8")) == []


def test_tables_of_benchmarks_stand_between_markers():
    assert unmarked_table_lines((DOCS / "benchmarks.md").read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("key", FIGURES)
def test_every_figure_has_a_value(key):
    text = FIGURES[key]()
    assert text
    assert text == text.strip()
    assert (key.endswith("-table") or key == "headlines") == ("\n" in text)


def test_every_bench_is_on_the_page_of_benchmarks():
    page = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    results = {path.stem for path in (ROOT / "tests" / "bench" / "results").glob("*.json")}
    assert [name for name in sorted(results) if f"make bench ONLY={name}`" not in page] == []


def test_every_table_is_on_the_page_of_benchmarks():
    page = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    tables = [key for key in FIGURES if key.endswith("-table")]
    assert [key for key in tables if f"<!-- bench:{key} -->" not in page] == []


def test_a_wrong_figure_is_replaced():
    text = "It takes <!-- bench:time -->3<!-- /bench --> s.\n<!-- bench:rows --><!-- /bench -->\n"
    figures = {"time": lambda: "2", "rows": lambda: "| a |\n| - |"}
    expected = (
        "It takes <!-- bench:time -->2<!-- /bench --> s.\n"
        "<!-- bench:rows -->\n\n| a |\n| - |\n\n<!-- /bench -->\n"
    )
    assert regenerate(text, figures) == expected
    assert regenerate(expected, figures) == expected


@pytest.mark.parametrize(
    "text",
    [
        "It takes <!-- bench:time -->3",
        "It takes <!-- bench:time --><!-- bench:time -->3<!-- /bench -->",
        "It takes <!-- bench:no-such -->3<!-- /bench -->",
        "It takes\n<!-- bench:time -->3<!-- /bench --> s.",
    ],
)
def test_markers_that_are_wrong_are_refused(text):
    with pytest.raises(MarkerError):
        regenerate(text, {"time": lambda: "2"})


def test_figures_without_markers_are_seen():
    table = "| a | b |\n| --- | --- |\n| speed | 17 |\n"
    assert unmarked_table_lines(table) == ["| speed | 17 |"]
    assert unmarked_table_lines(f"<!-- bench:k -->\n\n{table}\n<!-- /bench -->") == []
    assert unmarked_table_lines("| `mode 7` | text |") == []
    assert unmarked_rates("It is 97.4 % [91, 99].") == ["4 % [9"]
    assert unmarked_rates("It is true (n = 20).") == ["n = 2"]
    assert unmarked_rates("A 95 % interval, and the 325 campaigns.") == []


def test_headline_of_intervals_states_tuned_stiffness():
    (row,) = [line for line in FIGURES["headlines"]().splitlines() if "95 % intervals" in line]
    assert "tuned stiffness" in row
    assert "7200" in row


def test_the_table_of_readme_is_short():
    assert len(FIGURES["headlines"]().splitlines()) <= 2 + 10


def test_numbers_are_rounded_to_significant_digits():
    values = [0.0, 0.05, 9.996, 17.39, 21628.9, -3.099, 5.3e-13, None]
    texts = ["0", "0.0500", "10.0", "17.4", "21600", "-3.10", "5.30e-13", ""]
    assert list(map(significant, values)) == texts
