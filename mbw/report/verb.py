"""``mbw report``: writing of a result's page as one self-contained HTML file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from identification.result.stored_result import MODES_JSON
from identification.words import InputError, UsageError, WorkbenchError
from identification.words.file_access import real_path
from mbw.blind import page as graded
from mbw.compare import result as compared
from mbw.diagnose.page import render as diagnosis_page
from mbw.excite import page as excited
from mbw.excite.schema import EXCITATION_JSON
from mbw.files import page_path, write_json
from mbw.identify.files import PAGE as MODES_PAGE
from mbw.identify.page import render_result as modes_page
from mbw.match import result as matched
from mbw.match.page import render as match_page
from mbw.messages import SCREEN
from mbw.output_folder import OutputRequest, open_output_folder, page_folder, source_of
from mbw.predict import page as predicted
from mbw.results import diagnosed_files as diagnosed
from mbw.tune import page as tuned
from mbw.tune.mode_table_page import MODE_TABLE_PAGE
from mbw.tune.mode_table_page import render as mode_table_page
from tuning import read_result
from tuning.files.mode_table_result import MODE_TABLE_JSON, read_mode_table_result
from tuning.files.plant_folder import SHOWN, VERDICT
from tuning.files.result import TUNED_JSON


@dataclass(frozen=True)
class _Kind:
    """Kind of result, by the verb that wrote it.

    Args:
        verb: name of the verb.
        files: names of files; any of them identifies the kind, and the first is the result.
        page: file name of the page.
        render: function that returns the page of a folder, or of such a file.
    """

    verb: str
    files: tuple[str, ...]
    page: str
    render: Callable[[Path], str]


# In a folder with results of several verbs the first kind counts.
_RESULT_KINDS = (
    _Kind("tune", (TUNED_JSON,), tuned.PAGE, lambda path: tuned.render(read_result(path))),
    _Kind(
        "tune",
        (MODE_TABLE_JSON,),
        MODE_TABLE_PAGE,
        lambda path: mode_table_page(read_mode_table_result(path)),
    ),
    _Kind("identify", (MODES_JSON,), MODES_PAGE, modes_page),
    _Kind(
        "diagnose",
        (VERDICT, SHOWN),
        diagnosed.PAGE,
        lambda path: diagnosis_page(diagnosed.read_result(path)),
    ),
    _Kind(
        "match",
        (matched.MATCH_JSON,),
        matched.PAGE,
        lambda path: match_page(matched.read_result(path)),
    ),
    _Kind("blind", (graded.GRADES,), graded.PAGE, graded.render_folder),
    _Kind("compare", (compared.COMPARED_JSON,), compared.PAGE, compared.read_page),
    _Kind("predict", (predicted.PAGE,), predicted.PAGE, predicted.read_page),
    _Kind("excite", (EXCITATION_JSON,), excited.PAGE, excited.read_page),
)


def run(
    result: Path, out: Path | None, *, json: Path | None = None, overwrite: bool = False
) -> Path:
    """Write the page of a result.

    Args:
        result: folder of the result, or its JSON file in it.
        out: an .html file or a folder; None for the folder of the result, or for one of its name in
            the current folder if it is built in.
        json: file that gets a copy of its JSON; None for none.
        overwrite: whether a page of another campaign or model may be replaced.

    Returns:
        The path of the page.

    Raises:
        InputError: the folder holds no result, or the page cannot be written.
    """
    kind = _kind(result)
    folder = result if result.is_dir() else result.parent
    target = page_path(out or page_folder(result), kind.page)
    text = _render(kind, result)
    source = source_of(folder, kind.files[0])
    # A result without a record was copied or made by an earlier version: its page may be renewed.
    is_own = source is None and real_path(target.parent) == real_path(folder)
    request = OutputRequest(
        kind.verb, source or folder, target.parent, (target.name,), overwrite, adopts=is_own
    )
    with open_output_folder(request) as output, output.write() as place:
        (place / target.name).write_text(text, encoding="utf-8")
    SCREEN.say(f"report in {target}")
    if json is not None:
        write_json(_read_json(result), json)
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


def _read_json(path: Path) -> str:
    """Return the JSON of a result.

    Raises:
        UsageError: a result of ``mbw predict`` is a page alone.
    """
    kind = _kind(path)
    if kind.verb == "predict":
        raise UsageError(
            f"{path} holds a page and no JSON: mbw predict MODEL --json FILE writes it"
        )
    folder = path if path.is_dir() else path.parent
    return (folder / kind.files[0]).read_text(encoding="utf-8").rstrip()


def _kind(path: Path) -> _Kind:
    for kind in _RESULT_KINDS:
        if any(
            (path / name).is_file() if path.is_dir() else path.name == name for name in kind.files
        ):
            return kind
    raise InputError(
        f"{path} holds no result: name a folder that mbw tune, identify, diagnose, match, blind, "
        "predict or excite wrote"
    )
