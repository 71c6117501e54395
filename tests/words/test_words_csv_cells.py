"""CSV tables: names that a spreadsheet would compute are text, numbers stay numbers."""

import ast
import io
from pathlib import Path

import pytest

from identification.readers.csv_tables import read_csv_rows
from identification.words.csv_cells import cell_text, name_of_cell, write_csv

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("=HYPERLINK(1):+tx", "+tx", "-a", "@SUM(1)", "\tx", "plain", "'quoted", "")


@pytest.mark.parametrize("name", NAMES)
def test_no_name_begins_like_a_formula_and_each_reads_back(name, tmp_path):
    text = io.StringIO()
    write_csv(text, [[name, "end"]])
    assert not text.getvalue().lstrip('"').startswith(("=", "+", "-", "@", "\t"))
    (tmp_path / "t.csv").write_text(text.getvalue(), encoding="utf-8")
    assert read_csv_rows(tmp_path / "t.csv", "")[0] == [name, "end"]
    assert name_of_cell(str(cell_text(name))) == name


@pytest.mark.parametrize("number", ["-1.5e-3", "+2", "-inf", "(1-2j)", -3.0, 7])
def test_numbers_stay(number):
    assert cell_text(number) == number


def test_every_table_is_written_by_one_function():
    packages = ("identification", "mbmodel", "tuning", "diagnosis", "mbw", "mbworkbench")
    writers = [
        path.relative_to(ROOT)
        for package in packages
        for path in (ROOT / package).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and ast.unparse(node) in ("csv.writer", "csv.DictWriter")
    ]
    assert writers == [Path("identification/words/csv_cells.py")]
