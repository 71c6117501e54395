"""Self-contained HTML pages from templates, with plotly, style, scripts and packed arrays."""

import base64
import hashlib
import json
from collections.abc import Container, Iterable
from html import escape
from importlib.resources import files
from string import Template

import numpy as np
from plotly.offline import get_plotlyjs

from mbw.page.glossary import explain_words
from tuning.files.schema import InputRow

# Resolution of 16-bit numbers; page/common.js decodes them with these values.
_STEPS_PER_DECADE = 1500  # of a magnitude's logarithm
_STEPS_PER_DEGREE = 100  # of a phase


def fill_template(
    template: str,
    data: object,
    *,
    scripts: Iterable[str],
    styles: Iterable[str] = (),
    **fields: str,
) -> str:
    """Return a page as HTML, from a template of this package and the frame of all pages.

    Args:
        template: file name of the template; its text stands between title and script.
        data: data of the scripts, written as JSON.
        scripts: file names of the page's scripts; they follow the script of all pages.
        styles: file names of the page's style sheets; they follow that of all pages.
        fields: HTML for the fields of frame and template: ``$title``, ``$subtitle`` and others.
    """
    main = explain_words(Template(read_fragment(template)).substitute(fields))
    code = "".join(read_asset(name) for name in ("page/common.js", *scripts))
    code = f"\nconst DATA = {_script_json(data)};\n{code}\n"
    plotly = get_plotlyjs()
    return Template(read_asset("page/frame.html")).substitute(
        {name: fields[name] for name in ("title", "subtitle")},
        main=main,
        style="".join(read_asset(name) for name in ("page/colours.css", "page/style.css", *styles)),
        policy=_content_policy(plotly, code),
        plotly=plotly,
        code=code,
    )


def _content_policy(*scripts: str) -> str:
    """Return the content-security policy of a page that runs these scripts and no others.

    A page loads nothing and sends nothing. Names of a user's files that would reach the page as
    HTML could not run. Styles stand inline, since plotly sets them; pictures are data of the page.
    """
    hashes = (
        base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode() for text in scripts
    )
    allowed = " ".join(f"'sha256-{text}'" for text in hashes)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )


def read_fragment(name: str) -> str:
    """Return a part of a page; its field ``$picture`` becomes the HTML of the 3-D picture."""
    return read_asset(name).replace("$picture", read_asset("page/picture.html"))


def read_asset(name: str) -> str:
    """Return the content of a text file of this package."""
    return files("mbw").joinpath(name).read_text("utf-8")


def _script_json(value: object) -> str:
    """Return JSON in which no ``<`` can end the script element around it."""
    return json.dumps(value, allow_nan=False).replace("<", "\\u003c")


def warning_boxes(texts: Iterable[str], notes: Container[str] = ()) -> str:
    """Return HTML of sentences in boxes: red for what endangers the result, grey for notes.

    Args:
        texts: sentences on the result.
        notes: those among them that only say what the result covers.
    """
    return "".join(
        f'<div class="{"note" if text in notes else "warn"}">{escape(text)}</div>' for text in texts
    )


def badge(text: str, good: bool | None) -> str:
    """Return HTML of a few words in a coloured pill: green if good, red if not, grey for None."""
    kind = "plain" if good is None else "good" if good else "trouble"
    return f'<span class="badge {kind}">{escape(text)}</span>'


def input_files(rows: Iterable[InputRow]) -> str:
    """Return HTML of the files that were read, with their hashes; empty without any."""
    files = ", ".join(
        f'{escape(row.file)} <code title="SHA-256 {escape(row.sha256)}">{escape(row.sha256[:10])}'
        "</code>"
        for row in rows
    )
    return f"Input files: {files}." if files else ""


def pack_real(values: np.ndarray) -> str:
    """Return real numbers in single precision, base64-encoded."""
    return _base64(values, "<f4")


def pack_complex(values: np.ndarray) -> str:
    """Return complex numbers in single precision, base64-encoded; real part first."""
    return _base64(values, "<c8")


def pack_magnitudes(values: np.ndarray) -> str:
    """Return magnitudes as 16-bit steps of their logarithm, base64-encoded.

    The error is below 0.1 %; zero and nan become "no value".
    """
    return _base64(_log_steps(values), "<i2")


def pack_polar(values: np.ndarray) -> str:
    """Return complex numbers as 16-bit magnitude and phase (hundredths of a degree), base64."""
    degrees = np.degrees(np.angle(np.nan_to_num(values)))
    phases = np.round(_STEPS_PER_DEGREE * degrees)
    return _base64(np.stack([_log_steps(np.abs(values)), phases], axis=-1), "<i2")


def _log_steps(values: np.ndarray) -> np.ndarray:
    is_positive = np.isfinite(values) & (values > 0)
    steps = np.round(_STEPS_PER_DECADE * np.log10(np.where(is_positive, values, 1.0)))
    return np.where(is_positive, np.clip(steps, 1 - 2**15, 2**15 - 1), -(2**15))


def pack_integers(values: np.ndarray) -> str:
    """Return integers of 32 bits, base64-encoded."""
    return _base64(values, "<i4")


def _base64(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()
