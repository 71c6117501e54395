"""``mbw report``: writing of a result's page as one self-contained HTML file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from identification.words import InputError, WorkbenchError
from mbw.diagnose import files as diagnosed
from mbw.diagnose.page import render as diagnosis_page
from mbw.files import page_path, write_page
from mbw.identify.files import MODES_JSON
from mbw.identify.files import PAGE as MODES_PAGE
from mbw.identify.verb import render_result as modes_page
from mbw.match import result as matched
from mbw.match.page import render as match_page
from mbw.messages import SCREEN
from mbw.tune.page import render as tuning_page
from tuning import read_result
from tuning.files.result import TUNED_JSON


@dataclass(frozen=True)
class _Kind:
    """Kind of result, by the verb that wrote it.

    Args:
        verb: verb that wrote it.
        files: names of files; any of them identifies the kind.
        page: file name of the page.
        render: function that returns the page of a folder, or of such a file.
    """

    verb: str
    files: tuple[str, ...]
    page: str
    render: Callable[[Path], str]


# In a folder with results of several verbs the first kind counts.
_RESULT_KINDS = (
    _Kind("tune", (TUNED_JSON,), "report.html", lambda path: tuning_page(read_result(path))),
    _Kind("identify", (MODES_JSON,), MODES_PAGE, modes_page),
    _Kind(
        "diagnose",
        (diagnosed.VERDICT, diagnosed.SHOWN),
        diagnosed.PAGE,
        lambda path: diagnosis_page(diagnosed.read_result(path)),
    ),
    _Kind(
        "match",
        (matched.MATCH_JSON,),
        matched.PAGE,
        lambda path: match_page(matched.read_result(path)),
    ),
)


def run_options(result: Path, out: Path | None) -> None:
    """Run the verb with the values of its options."""
    run(result, out)


def run(path: Path, out: Path | None) -> Path:
    """Write the page of a result.

    Args:
        path: folder of the result, or its tuned.json, modes.json, verdict.json or match.json.
        out: an .html file or a folder; None for the folder of the result.

    Returns:
        The path of the page.

    Raises:
        InputError: the folder holds no result, or the page cannot be written.
    """
    kind = _kind(path)
    target = page_path(path, out, kind.page)
    write_page(_render(kind, path), target)
    SCREEN.say(f"report in {target}")
    return target


def _render(kind: _Kind, path: Path) -> str:
    """Return the page of a result, which may have been altered since the verb wrote it.

    Raises:
        InputError: the files of the result contradict each other or themselves.
    """
    try:
        return kind.render(path)
    except (WorkbenchError, KeyboardInterrupt):
        raise
    except Exception as error:  # whatever an altered number or name leads to
        raise InputError(
            f"{path} contradicts itself ({type(error).__name__}: {error}): it was altered or is of "
            f"another version, so run mbw {kind.verb} again"
        ) from error


def _kind(path: Path) -> _Kind:
    for kind in _RESULT_KINDS:
        if any(
            (path / name).is_file() if path.is_dir() else path.name == name for name in kind.files
        ):
            return kind
    raise InputError(
        f"{path} holds no result: name a folder that mbw tune, identify, diagnose or match wrote"
    )
