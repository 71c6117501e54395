"""``python -m tests.docs.notebook [FILE ...]``: run notebooks and save their outputs in them.

Without a file, all notebooks of the docs are run.
Cells are run by Python itself, as Jupyter would, without a kernel. The value of a cell's last
expression becomes its output: as text, as an HTML table, or as a plotly figure.
"""

import ast
import contextlib
import io
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import plotly.graph_objects as go

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))
PLOTLY = "application/vnd.plotly.v1+json"


def run_notebook(path: Path) -> dict:
    """Return a notebook with the outputs of all its code cells, run in order.

    Args:
        path: path of the notebook. Its cells run in its folder, as Jupyter starts it; folders that
            they make by ``tempfile`` are gone afterwards.
    """
    notebook = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, object] = {"__name__": "__notebook__"}
    with (
        tempfile.TemporaryDirectory() as scratch,
        patch.object(tempfile, "tempdir", scratch),
        contextlib.chdir(path.parent),
    ):
        for number, cell in enumerate(notebook["cells"]):
            if cell["cell_type"] == "code":
                cell["execution_count"] = number
                cell["outputs"] = list(_run_cell("".join(cell["source"]), names))
    return notebook


def write_notebook(notebook: dict, path: Path) -> None:
    """Write a notebook as JSON, with one key a line as Jupyter does."""
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _run_cell(source: str, names: dict[str, object]) -> Iterator[dict]:
    """Yield the outputs of one cell: what it prints, then the value of its last expression."""
    tree = ast.parse(source)
    is_value = bool(tree.body) and isinstance(tree.body[-1], ast.Expr) and not source.endswith(";")
    last = ast.Expression(tree.body.pop().value) if is_value else None  # type: ignore[attr-defined]
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), names)  # the notebook is ours
        value = eval(compile(last, "<cell>", "eval"), names) if last else None
    if printed.getvalue():
        yield {"output_type": "stream", "name": "stdout", "text": printed.getvalue()}
    if value is not None:
        yield {
            "output_type": "execute_result",
            "execution_count": None,
            "metadata": {},
            "data": _forms_of(value),
        }


def _forms_of(value: object) -> dict:
    """Return the forms in which a notebook shows a value, by their MIME types."""
    if isinstance(value, go.Figure):
        return {PLOTLY: json.loads(value.to_json()), "text/plain": "a plotly figure"}
    forms = {"text/plain": repr(value)}
    table = getattr(value, "_repr_html_", None)
    if table is not None:
        forms["text/html"] = table()
    return forms


if __name__ == "__main__":
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    for file in map(Path, sys.argv[1:] or NOTEBOOKS):
        write_notebook(run_notebook(file), file)
