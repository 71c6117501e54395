"""Result of ``mbw identify``, and reading it back from its files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from identification.readers.result_files import read_result_arrays, read_result_json
from identification.result.schema import IdentifiedModesFile
from identification.words import InputError, Layout

MODES_JSON, MODES_NPZ, BODY_NPZ = "modes.json", "modes.npz", "body_frfs.npz"


@dataclass(frozen=True, eq=False)
class IdentificationResult:
    """Modal model with everything that its files and its page show.

    Args:
        summary: names and modes, as in modes.json.
        arrays: arrays by name, as in modes.npz.
    """

    summary: IdentifiedModesFile
    arrays: dict[str, Any]
    layout: Layout


def read_result(path: Path) -> IdentificationResult:
    """Read the result that ``mbw identify`` wrote.

    Args:
        path: folder of the result, or its modes.json.

    Raises:
        InputError: the folder holds no result, or one of another version.
    """
    folder = path if path.is_dir() else path.parent
    summary = read_result_json(folder / MODES_JSON, IdentifiedModesFile, "mbw identify")
    arrays = read_result_arrays(folder / MODES_NPZ, "mbw identify")
    try:
        layout = Layout(
            tuple(arrays["layout_bodies"].tolist()),
            arrays["layout_centres"],
            tuple(arrays["layout_points"].tolist()),
            arrays["layout_body_of"],
            arrays["layout_positions"],
            arrays["layout_axes"],
        )
        _ = arrays["as_solid"]  # the newest array: a file without it is of an older version
    except (KeyError, ValueError, TypeError) as error:
        raise InputError(
            f"{folder} holds no result of this version of mbw identify: identify the campaign again"
        ) from error
    return IdentificationResult(summary, arrays, layout)
