"""``mbw report``: a result as one self-contained HTML file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from identification.words import InputError
from mbw.diagnose import files as diagnosed
from mbw.diagnose.page import render as diagnosis_page
from mbw.files import page_file, write_page
from mbw.identify.files import MODES_JSON
from mbw.identify.files import PAGE as MODES_PAGE
from mbw.identify.verb import page_of as modes_page
from mbw.match import result as matched
from mbw.match.page import render as match_page
from mbw.messages import SCREEN
from mbw.tune.page import render as tuning_page
from tuning import read_result
from tuning.files.result import TUNED_JSON


@dataclass(frozen=True)
class _Kind:
    """What a verb leaves.

    Args:
        files: any of them tells that it was there.
        page: name of the page beside them.
        text: the page of a folder, or of such a file.
    """

    files: tuple[str, ...]
    page: str
    text: Callable[[Path], str]


# In a folder of several verbs the first counts.
_KINDS = (
    _Kind((TUNED_JSON,), "report.html", lambda path: tuning_page(read_result(path))),
    _Kind((MODES_JSON,), MODES_PAGE, modes_page),
    _Kind(
        (diagnosed.VERDICT, diagnosed.SHOWN),
        diagnosed.PAGE,
        lambda path: diagnosis_page(diagnosed.read_result(path)),
    ),
    _Kind((matched.MATCH_JSON,), matched.PAGE, lambda path: match_page(matched.read_result(path))),
)


def run(path: Path, out: Path | None) -> Path:
    """Write the page of a result.

    Args:
        path: its folder, or its tuned.json, modes.json, verdict.json or match.json.
        out: an .html file or a folder; the result's own folder if None.

    Returns:
        The file.

    Raises:
        InputError: the folder holds no result, or the file cannot be written.
    """
    kind = _kind(path)
    target = page_file(path, out, kind.page)
    write_page(kind.text(path), target)
    SCREEN.say(f"report in {target}")
    return target


def _kind(path: Path) -> _Kind:
    for kind in _KINDS:
        if any(
            (path / name).is_file() if path.is_dir() else path.name == name for name in kind.files
        ):
            return kind
    raise InputError(
        f"{path} holds no result: name what mbw tune, identify, diagnose or match wrote"
    )
