"""What the site makes of equations and of notebooks."""

import pytest

pytest.importorskip("latex2mathml", reason="the extra docs is not installed")

from tests.docs.equations import mathml
from tests.docs.notebook_pages import link_pages, notebook_markdown, output_markdown


def test_letters_of_other_alphabets_are_their_own_characters():
    assert "<mi>&#x1D5B3;</mi>" in mathml(r"d^{\mathsf T}", "inline")
    assert "<mi>&#x211D;</mi>" in mathml(r"\mathbb R", "inline")
    assert "<mi>&#x1D73D;</mi>" in mathml(r"\boldsymbol\theta", "inline")
    assert "<mtext>i</mtext>" in mathml(r"\mathrm{i}\omega", "inline")


def test_bars_stand_close_and_accents_are_accents():
    assert mathml("|H|", "inline").count('lspace="0" rspace="0"') == 2
    assert '<mover accent="true">' in mathml(r"\ddot q", "block")


def test_aligned_equations_become_a_table():
    assert "<mtable" in mathml(r"\begin{aligned} a &= b \\ c &= d \end{aligned}", "block")


@pytest.mark.parametrize("latex", [r"\nosuchcommand x", "a & b"])
def test_unknown_latex_is_refused(latex):
    with pytest.raises(ValueError, match="unknown LaTeX"):
        mathml(latex, "inline")


def test_notebook_becomes_a_page():
    figure = {"application/vnd.plotly.v1+json": {"data": [{"y": [1, 2]}], "layout": {}}}
    outputs = [
        {"output_type": "stream", "text": ["two\n", "lines\n"]},
        {"output_type": "display_data", "data": figure},
    ]
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n", "text"]},
        {"cell_type": "code", "source": ["x = 1"], "outputs": outputs},
    ]
    script, title, code, text, picture = notebook_markdown({"cells": cells}, "../../")
    assert script == '<script src="../../assets/plotly.min.js"></script>'
    assert (title, code) == ("# Title\ntext", "```python\nx = 1\n```")
    assert text == "```text\ntwo\nlines\n```"
    assert 'Plotly.newPlot("output-1-1"' in picture


def test_outputs_take_their_richest_form():
    data = {"text/plain": ["x"], "text/html": ["<b>x</b>\n", "\n", "<i>y</i>"]}
    html = output_markdown({"output_type": "execute_result", "data": data}, "name")
    assert html == "<div><b>x</b>\n<i>y</i></div>"
    svg = {"text/plain": ["x"], "image/svg+xml": ["<svg></svg>"]}
    assert "<svg>" in output_markdown({"output_type": "display_data", "data": svg}, "name")


def test_notebook_with_an_error_is_refused():
    with pytest.raises(ValueError, match="ZeroDivisionError"):
        output_markdown({"output_type": "error", "ename": "ZeroDivisionError"}, "name")


def test_links_to_notebooks_point_to_their_pages():
    text = "[a](../b.ipynb#c), [d](e.ipynb), [f](https://g.org/h.ipynb)"
    expected = "[a](../b.md#c), [d](e.md), [f](https://g.org/h.ipynb)"
    assert link_pages(text) == expected
