"""What all self-contained HTML pages share: plotly, style, script, numbers as text, their file."""

import base64
import json
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from string import Template

import numpy as np
from plotly.offline import get_plotlyjs

_DECADE, _HUNDREDTHS = 1500, 100  # as page.js reads them


def fill(
    template: str,
    data: object,
    *,
    scripts: Iterable[str],
    styles: Iterable[str] = (),
    **fields: str,
) -> str:
    """A page from a template of this package.

    Args:
        template: file name; it stands between title and script.
        data: what the scripts work on, as JSON.
        scripts: file names of the page's own, after that of all pages.
        styles: likewise.
        fields: the places of page and template, as HTML: ``$title``, ``$subtitle`` and its own.
    """
    whole = text_of("page/frame.html").replace("$main", piece(template))
    return Template(whole).substitute(
        fields,
        script="".join(text_of(name) for name in scripts),
        style="".join(text_of(name) for name in ("page/style.css", *styles)),
        plotly=get_plotlyjs(),
        common=text_of("page/common.js"),
        data=_script_json(data),
    )


def piece(name: str) -> str:
    """Part of a page from this package; ``$picture`` in it is where the machine moves."""
    return text_of(name).replace("$picture", text_of("page/picture.html"))


def text_of(name: str) -> str:
    """A text file of this package."""
    return files("mbw").joinpath(name).read_text("utf-8")


def _script_json(value: object) -> str:
    """JSON that cannot end the script element it stands in."""
    return json.dumps(value, allow_nan=False).replace("<", "\\u003c")


def warnings(texts: Iterable[str]) -> str:
    """Sentences that a reader must not miss."""
    return "".join(f'<div class="warn">{escape(text)}</div>' for text in texts)


def badge(text: str, good: bool | None) -> str:
    """A few words in a coloured pill: green or red, grey if neither."""
    kind = "plain" if good is None else "good" if good else "trouble"
    return f'<span class="badge {kind}">{escape(text)}</span>'


def packed(values: np.ndarray) -> str:
    """Real numbers in single precision."""
    return _base64(values, "<f4")


def packed_complex(values: np.ndarray) -> str:
    """Complex numbers in single precision, real and imaginary part in turn."""
    return _base64(values, "<c8")


def packed_sizes(values: np.ndarray) -> str:
    """Sizes as 16 bits: steps of their logarithm, less than 0.1 % off; zero and nan as none."""
    return _base64(_steps(values), "<i2")


def packed_polar(values: np.ndarray) -> str:
    """Complex numbers, steps of the logarithm and hundredths of a degree in turn."""
    degrees = np.degrees(np.angle(np.nan_to_num(values)))
    turns = np.round(_HUNDREDTHS * degrees)
    return _base64(np.stack([_steps(np.abs(values)), turns], axis=-1), "<i2")


def _steps(values: np.ndarray) -> np.ndarray:
    known = np.isfinite(values) & (values > 0)
    steps = np.round(_DECADE * np.log10(np.where(known, values, 1.0)))
    return np.where(known, np.clip(steps, 1 - 2**15, 2**15 - 1), -(2**15))


def packed_integers(values: np.ndarray) -> str:
    """Whole numbers of 32 bits."""
    return _base64(values, "<i4")


def _base64(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()
