"""What all self-contained HTML pages share: plotly, style, script, numbers as text, their file."""

import base64
import json
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np
from plotly.offline import get_plotlyjs

from identification.words import InputError
from tuning import files_of

_DECADE, _HUNDREDTHS = 1500, 100  # as page.js reads them


def fill(template: str, data: object, *, script: str, style: str = "", **fields: str) -> str:
    """A page from a template of this package.

    Args:
        template: file name; it stands between title and script.
        data: what the script works on, as JSON.
        script: the page's own, after that of all pages.
        style: likewise.
        fields: the places of page and template, as HTML: ``$title``, ``$subtitle`` and its own.
    """
    whole = text_of("page.html").replace("$main", text_of(template))
    return Template(whole).substitute(
        fields,
        script=script,
        style=text_of("page.css") + style,
        plotly=get_plotlyjs(),
        common=text_of("page.js"),
        data=_script_json(data),
    )


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


def page_file(path: Path, out: Path | None, name: str) -> Path:
    """Where the page of a result goes.

    Args:
        path: the result, a folder or a file in it.
        out: an .html file or a folder; the result's own folder if None.
        name: of the page in a folder.
    """
    target = out or (path if path.is_dir() else path.parent)
    return target if target.suffix == ".html" else target / name


def write_page(text: str, target: Path) -> None:
    """Write a page, whole or not at all, in the place of one of that name.

    Raises:
        InputError: it cannot be written.
    """
    try:
        with files_of(target.parent) as place:
            (place / target.name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): name another") from error


def check_names(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder into which a result cannot be written, before the work is done.

    Raises:
        InputError: it cannot be made or written, or holds folders in the places of the files.
    """
    with files_of(folder) as place:
        for name in names:
            if (folder / name).is_dir():
                raise InputError(f"{folder / name} is a folder: name another")
        (place / ".probe").touch()
        (place / ".probe").unlink()


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
