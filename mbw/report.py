"""``mbw report``: a result as one self-contained HTML file."""

import math
from html import escape
from pathlib import Path

import numpy as np

from identification.words import Dof
from mbw.identify import is_identified, rewrite
from mbw.messages import SCREEN
from mbw.page import fill, packed, packed_complex, text_of, warnings, write_page
from mbw.remarks import remarks
from mbw.report_pairs import pairs_section
from tuning import Level, Result, TunedFile, read_result

_UNITS = {
    "accelerance": ("m/s²/N", "rad/s²/N"),
    "mobility": ("m/s/N", "rad/s/N"),
    "receptance": ("m/N", "rad/N"),
}
_COLOURS = {"as drawn": "#d9822b", "tuned": "#1f6fb8", "held out": "#7fb2e0", "noise": "#98a2b3"}


def run(path: Path, out: Path | None) -> Path:
    """Write the report of a result folder.

    Args:
        path: the folder, or its tuned.json or modes.json.
        out: an .html file or a folder; the result's own folder if None.

    Returns:
        The file.

    Raises:
        InputError: the folder holds no result, or the file cannot be written.
    """
    if is_identified(path):
        return rewrite(path, out)
    result = read_result(path)
    target = out or (path if path.is_dir() else path.parent)
    if target.suffix != ".html":
        target /= "report.html"
    write_page(render(result), target)
    SCREEN.say(f"report in {target}")
    return target


def render(result: Result) -> str:
    """The HTML of a result."""
    summary = result.summary
    return fill(
        "report_template.html",
        _data(result),
        title=escape(f"{summary.model}: model and hammer test"),
        subtitle=escape(
            f"campaign {summary.campaign}, {len(summary.tests)} tests, {summary.lines} lines "
            f"{summary.band[0]:g}..{summary.band[1]:g} Hz, "
            f"{len(summary.parameters)} parameters tuned"
        ),
        lead=escape(_lead(summary)),
        warnings=warnings(_warnings(summary)),
        parameters="".join(_parameter_rows(summary)),
        modes_drawn=_modes_table(summary, "as_drawn"),
        modes_tuned=_modes_table(summary, "tuned"),
        pairs=pairs_section(summary),
        tests=_tests_table(summary),
        provenance=escape(_provenance(summary)),
        script=text_of("report.js"),
    )


def _lead(summary: TunedFile) -> str:
    gap = summary.gap.sensors
    if gap.as_drawn.error is None or gap.tuned.error is None:
        return "No channel is quiet enough to state an error."
    text = (
        f"As drawn, the model is off by {_percent(gap.as_drawn.error)} of the measured FRFs; "
        f"tuned, by {_percent(gap.tuned.error)}"
    )
    if gap.held_out is not None and gap.held_out.error is not None:
        text += f", and by {_percent(gap.held_out.error)} on lines that the fit did not see"
        worst = max(summary.held_out_blocks, key=lambda block: block.share)
        if worst.share > 0.5:
            text += (
                f" ({100 * worst.share:.0f} % of the squared error lies in "
                f"{worst.low:g}..{worst.high:g} Hz)"
            )
    if gap.noise is None:
        return text + "."
    text += f". The noise of the measurement is {_percent(gap.noise)}"
    best = (gap.held_out or gap.tuned).error
    if best is not None and best > 1.5 * gap.noise:
        return text + ": stiffness and damping alone do not explain what remains."
    return text + ": the model is about as good as the measurement can tell."


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _warnings(summary: TunedFile) -> list[str]:
    found = []
    if not summary.fit.converged:
        found.append(f"The search ended early ({summary.fit.outcome}): {summary.fit.advice}.")
    if summary.interrupted:
        found.append("The tuning was interrupted: there are no held-out lines.")
    return found + remarks(summary)


def _parameter_rows(summary: TunedFile) -> list[str]:
    rows = []
    for row in summary.parameters:
        factor = row.tuned / row.drawn
        reach = max(-50.0, min(50.0, 25.0 * math.log2(factor)))
        left, width = (50.0, reach) if reach > 0 else (50.0 + reach, -reach)
        bound = ' <span style="color:var(--bad)">at bound</span>' if row.at_bound else ""
        rows.append(
            f'<tr><td class="name">{escape(row.name)}{bound}</td>'
            f'<td class="name">{escape(row.location)}</td>'
            f"<td>{row.drawn:.4g}</td><td>{row.tuned:.4g}</td>"
            f'<td class="name">{escape(row.unit)}</td><td>{factor:.3g}</td>'
            f'<td class="name"><span class="bar"><i style="left:{left:.1f}%;width:{width:.1f}%">'
            "</i><b></b></span></td></tr>"
        )
    return rows


def _modes_table(summary: TunedFile, key: str) -> str:
    rows = "".join(
        f"<tr><td>{number}</td><td>{mode.frequency:.2f}</td><td>{100 * mode.damping:.2f}</td></tr>"
        for number, mode in enumerate(summary.modes[key], start=1)
    )
    return (
        "<table><thead><tr><th>mode</th><th>frequency / Hz</th><th>damping / %</th></tr></thead>"
        f"<tbody>{rows}</tbody></table>"
    )


def _tests_table(summary: TunedFile) -> str:
    rows = "".join(
        f'<tr><td class="name">{escape(test.file)}</td>'
        f'<td class="name">{escape(test.reference)}</td>'
        f"<td>{'' if test.level is None else f'{test.level:g}'}</td>"
        f"<td>{'' if test.averages is None else test.averages}</td><td>{test.channels}</td>"
        f'<td class="name">{escape(test.variance_from)}</td></tr>'
        for test in summary.tests
    )
    return (
        '<table><thead><tr><th class="name">file</th><th class="name">hammer</th><th>level / N</th>'
        '<th>averages</th><th>channels</th><th class="name">noise from</th></tr></thead>'
        f"<tbody>{rows}</tbody></table>"
    )


def _provenance(summary: TunedFile) -> str:
    fit = summary.fit
    text = (
        f"{fit.outcome.capitalize()} after {fit.evaluations} evaluations; "
        f"{fit.agreeing_starts} of {fit.starts} starts within 2 % of the best cost."
    )
    if blocks := summary.held_out_blocks:
        width = blocks[0].high - blocks[0].low
        text += f" Held-out blocks of {width:g} Hz in five folds."
    return text


def _data(result: Result) -> dict[str, object]:
    level, summary = result.levels["bodies"], result.summary
    outputs = [Dof.parse(label) for label in level.outputs]
    places = [test.split(" in ", 1) for test in level.tests]
    unit, unit_rotation = _UNITS[summary.quantity]
    return {
        "freq": packed(result.freq_hz),
        "measured": _packed_complex(level, "measured"),
        "drawn": _packed_complex(level, "as_drawn"),
        "tuned": _packed_complex(level, "tuned"),
        "noise": packed(level.noise.T),
        "channels": [
            {
                "body": dof.point,
                "direction": dof.direction[1:],
                "reference": place[0],
                "file": place[1],
            }
            for dof, place in zip(outputs, places, strict=True)
        ],
        "bodies": list(dict.fromkeys(dof.point for dof in outputs)),
        "files": list(dict.fromkeys(place[1] for place in places)),
        "unit": unit,
        "unit_rotation": unit_rotation,
        "gap": _gap_bars(summary),
        "where": [
            {"body": row.body, "share": row.share, "excess": row.excess}
            for row in summary.remaining_gap
        ],
    }


def _gap_bars(summary: TunedFile) -> list[dict[str, object]]:
    levels = (summary.gap.sensors, summary.gap.bodies)
    series = {
        "as drawn": [level.as_drawn.error for level in levels],
        "tuned": [level.tuned.error for level in levels],
        "held out": [level.held_out.error if level.held_out else None for level in levels],
        "noise": [level.noise for level in levels],
    }
    return [
        {"name": name, "error": error, "color": _COLOURS[name]} for name, error in series.items()
    ]


def _packed_complex(level: Level, name: str) -> str:
    """Channel after channel."""
    values: np.ndarray = getattr(level, name).T
    return packed_complex(values)
