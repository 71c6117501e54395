"""Notebooks as pages, made at build from their saved outputs: nothing is run, nothing is loaded.

Text, code, tables (HTML), SVG and PNG pictures, and plotly figures are shown. Plotly's script comes
from the installed package and is written to the site.
"""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import plotly
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PLOTLY = "application/vnd.plotly.v1+json"
SCRIPT = "assets/plotly.min.js"


def on_files(files: Files, config: MkDocsConfig, **_: object) -> Files:
    """Replace every notebook by a page of its name, and add plotly's script where one needs it.

    Args:
        files: of the site.
        config: of the site.
    """
    for file in [file for file in files if file.src_uri.endswith(".ipynb")]:
        notebook = json.loads(Path(file.abs_src_path).read_text(encoding="utf-8"))
        depth = file.src_uri.count("/") + bool(config.use_directory_urls)
        text = "\n\n".join(notebook_markdown(notebook, "../" * depth))
        files.remove(file)
        files.append(File.generated(config, page_name(file.src_uri), content=text))
        if SCRIPT in text and SCRIPT not in files.src_uris:
            script = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"
            files.append(File.generated(config, SCRIPT, abs_src_path=str(script)))
    return files


def on_config(config: MkDocsConfig, **_: object) -> MkDocsConfig:
    """Let the navigation name notebooks by their own names.

    Args:
        config: of the site.
    """
    config.nav = _rename_notebooks(config.nav)
    return config


def on_page_markdown(markdown: str, **_: object) -> str:
    """Let links to notebooks, which readers of the repository need, point to their pages.

    Args:
        markdown: of a page.
    """
    return re.sub(r"(\]\((?![a-z]+:)[^)\s]+)\.ipynb(#[^)\s]*)?\)", r"\1.md\2)", markdown)


def page_name(notebook: str) -> str:
    """Return the name of the page that is made from a notebook."""
    return notebook.removesuffix(".ipynb") + ".md"


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


def _rename_notebooks(entry: list | dict | str) -> list | dict | str:
    """Return a part of the navigation in which notebooks have the names of their pages."""
    if isinstance(entry, list):
        return [_rename_notebooks(item) for item in entry]
    if isinstance(entry, dict):
        return {key: _rename_notebooks(value) for key, value in entry.items()}
    return page_name(entry) if entry.endswith(".ipynb") else entry
