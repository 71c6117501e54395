"""Notebooks as pages, made from their saved outputs: nothing is run, nothing is loaded.

Text, code, tables (HTML), SVG and PNG pictures, and plotly figures are shown.
"""

import json
import re
from collections.abc import Iterator, Mapping

PLOTLY = "application/vnd.plotly.v1+json"
SCRIPT = "assets/plotly.min.js"
LINK = re.compile(r"(\]\((?![a-z]+:)[^)\s]+)\.ipynb(#[^)\s]*)?\)")


def link_pages(markdown: str) -> str:
    """Return a page whose links to notebooks, made for the repository, lead to their pages."""
    return LINK.sub(r"\1.md\2)", markdown)


def notebook_markdown(notebook: Mapping, root: str) -> Iterator[str]:
    """Yield the Markdown of a notebook's cells and their outputs.

    Args:
        notebook: JSON of the notebook.
        root: relative address of the site's root.
    """
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
    if any(PLOTLY in output.get("data", {}) for output in outputs):
        yield f'<script src="{root}{SCRIPT}"></script>'
    for number, cell in enumerate(notebook["cells"]):
        source = "".join(cell["source"]).strip()
        if cell["cell_type"] == "markdown":
            yield source
        elif cell["cell_type"] == "code" and source:
            yield f"```python\n{source}\n```"
        for place, output in enumerate(cell.get("outputs", [])):
            yield output_markdown(output, f"output-{number}-{place}")


def output_markdown(output: Mapping, name: str) -> str:
    """Return the Markdown of one output: its richest form that needs no network.

    Args:
        output: of a cell.
        name: unique name of the output on its page.
    """
    if output["output_type"] == "stream":
        return _text_block(output["text"])
    if output["output_type"] == "error":
        raise ValueError(f"notebook: an output is the error {output['ename']}")
    data = output["data"]
    if PLOTLY in data:
        figure = json.dumps({key: data[PLOTLY].get(key) for key in ("data", "layout")})
        figure = figure.replace("</", "<\\/")
        return (
            f'<div id="{name}"></div>\n<script>{{ const figure = {figure};'
            f' Plotly.newPlot("{name}", figure.data, figure.layout, {{displaylogo: false}}); }}'
            "</script>"
        )
    if "image/svg+xml" in data:
        return f"<div>{_one_line(data['image/svg+xml'])}</div>"
    if "image/png" in data:
        image = "".join(data["image/png"]).replace("\n", "")
        return f'<img alt="output" src="data:image/png;base64,{image}">'
    if "text/html" in data:
        return f"<div>{_one_line(data['text/html'])}</div>"
    return _text_block(data["text/plain"])


def _text_block(text: str | list[str]) -> str:
    return f"```text\n{''.join(text).rstrip()}\n```"


def _one_line(markup: str | list[str]) -> str:
    """Return HTML without blank lines, which would end its block in Markdown."""
    return "\n".join(line for line in "".join(markup).splitlines() if line.strip())
