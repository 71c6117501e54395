"""Page of ``mbw excite``: power over lines, one period in time, coherence, expected intervals."""

from html import escape
from pathlib import Path

import numpy as np

from identification.words import capitalise
from identification.words.file_access import read_bytes
from mbw.excite.schema import ExcitationFile
from mbw.excite.summary import describe_forecast, describe_signal, describe_sliding
from mbw.page.html import fill_template, pack_real, warning_boxes
from tuning.excitation.design import Excitation
from tuning.excitation.prediction import predict_coherence

PAGE = "excitation.html"
_MAX_PERIOD_POINTS = 4096  # of a period that is drawn


def read_page(path: Path) -> str:
    """Return the page in a folder of ``mbw excite``.

    Raises:
        InputError: the page cannot be read.
    """
    folder = path if path.is_dir() else path.parent
    return read_bytes(folder / PAGE, "run mbw excite again").decode("utf-8")


def render(excitation: Excitation, summary: ExcitationFile) -> str:
    """Return the HTML page."""
    plan = excitation.plan
    every = 1 + plan.samples // _MAX_PERIOD_POINTS
    amplitude = np.sqrt(2 * excitation.power)
    data = {
        "freq": pack_real(plan.freq_hz),
        "time": pack_real(np.arange(plan.samples)[::every] / plan.rate_hz),
        "drives": [
            {
                "name": row.drive,
                "unit": row.unit,
                "amplitude": pack_real(amplitude[:, k]),
                "period": pack_real(excitation.periods[0, k, ::every]),
            }
            for k, row in enumerate(summary.drives)
        ],
        "coherence": [
            {"name": f"{row.output} by {row.drive}", "values": pack_real(row.coherence)}
            for row in predict_coherence(excitation)
        ],
        "limits": [row.model_dump() for row in summary.limits],
        "parameters": [row.model_dump() for row in summary.parameters],
    }
    sentences = [f"{capitalise(text)}." for text in describe_forecast(summary)]
    sliding = "".join(f"<li>{escape(describe_sliding(row))}</li>" for row in summary.sliding)
    return fill_template(
        "excite/template.html",
        data,
        scripts=["excite/page.js"],
        title=escape(f"{excitation.model.machine.name}: excitation"),
        subtitle=escape(describe_signal(summary)),
        warnings=warning_boxes(summary.remarks, summary.remarks),
        lead=escape(" ".join(sentences)),
        sliding=f"<ul>{sliding}</ul>" if sliding else "",
    )
