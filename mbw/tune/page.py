"""The report of ``mbw tune`` as one self-contained HTML file."""

from html import escape

import numpy as np

from identification.words import Dof
from mbw.page.html import fill, packed, packed_complex, warnings
from mbw.page.numbers import UNITS, percent
from mbw.remarks import limits, not_held
from mbw.tune.convergence import badges, starts_section, unknown_section
from mbw.tune.mode_pairs import pairs_section
from mbw.tune.parameters import parameter_rows
from mbw.tune.pulls import pull_points, pulls_note, pulls_table
from tuning import Level, Result, TunedFile
from tuning.files.result import TUNED_JSON

_COLOURS = {"as drawn": "#d9822b", "tuned": "#1f6fb8", "held out": "#7fb2e0", "noise": "#98a2b3"}


def render(result: Result) -> str:
    """The HTML of a result."""
    summary = result.summary
    return fill(
        "tune/template.html",
        _data(result),
        title=escape(f"{summary.model}: model and hammer test"),
        subtitle=escape(
            f"campaign {summary.campaign}, {len(summary.tests)} tests, {summary.lines} lines "
            f"{summary.band[0]:g}..{summary.band[1]:g} Hz, "
            f"{_counted(summary)} tuned"
        ),
        lead=escape(_lead(summary)),
        badges=badges(summary),
        warnings=warnings(_warnings(summary)),
        parameters=parameter_rows(summary),
        pulls=_pulls_section(summary),
        unknown=unknown_section(summary),
        starts=starts_section(summary),
        modes_drawn=_modes_table(summary, "as_drawn"),
        modes_tuned=_modes_table(summary, "tuned"),
        pairs=pairs_section(summary),
        tests=_tests_table(summary),
        provenance=_provenance(summary),
        scripts=["page/bode.js", "tune/page.js", "tune/pulls.js"],
        styles=["tune/style.css"],
    )


def _lead(summary: TunedFile) -> str:
    gap = summary.gap.sensors
    if gap.as_drawn.error is None or gap.tuned.error is None:
        return "No channel is quiet enough to state an error."
    text = (
        f"As drawn, the model is off by {percent(gap.as_drawn.error)} of the measured FRFs; "
        f"tuned, by {percent(gap.tuned.error)}"
    )
    if gap.held_out is not None and gap.held_out.error is not None:
        text += f", and by {percent(gap.held_out.error)} on lines that the fit did not see"
        worst = max(summary.held_out_blocks, key=lambda block: block.share)
        if worst.share > 0.5:
            text += (
                f" ({100 * worst.share:.0f} % of the squared error lies in "
                f"{worst.low:g}..{worst.high:g} Hz)"
            )
    if gap.noise is None:
        return text + "."
    return text + f". The noise of the measurement is {percent(gap.noise)}."


def _warnings(summary: TunedFile) -> list[str]:
    found = ["There are no held-out lines: the tuning was interrupted."]
    return (found if summary.interrupted else []) + limits(summary)


def _counted(summary: TunedFile) -> str:
    tolerances = sum(row.prior is not None for row in summary.parameters)
    text = f"{len(summary.parameters) - tolerances} parameters"
    return f"{text} and {tolerances} tolerances" if tolerances else text


def _pulls_section(summary: TunedFile) -> str:
    """Chart and table of the tolerances; empty if none was tuned."""
    if all(row.pull is None for row in summary.parameters):
        return ""
    return (
        '<h2>Tolerances</h2><div class="pulls"><div id="pulls"></div>'
        f'<div>{pulls_table(summary)}</div></div><p class="soft">{escape(pulls_note(summary))}</p>'
    )


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
    text = f"{fit.outcome.capitalize()} after {fit.evaluations} evaluations"
    if fit.starts > 1:
        text += f"; {fit.agreeing_starts} of {fit.starts} starts within 2 % of the best cost"
    text += "."
    if blocks := summary.held_out_blocks:
        width = blocks[0].high - blocks[0].low
        text += f" Held-out blocks of {width:g} Hz in five folds."
    text = escape(f"{text} {not_held(summary.not_held_by_mjcf, TUNED_JSON)}".strip())
    if not summary.inputs:
        return text
    files = ", ".join(
        f'{escape(row.file)} <code title="SHA-256 {escape(row.sha256)}">{escape(row.sha256[:10])}'
        "</code>"
        for row in summary.inputs
    )
    return f"{text}<br>Read: {files}."


def _data(result: Result) -> dict[str, object]:
    level, summary = result.levels["bodies"], result.summary
    outputs = [Dof.parse(label) for label in level.outputs]
    places = [test.split(" in ", 1) for test in level.tests]
    unit, unit_rotation = UNITS[summary.quantity]
    return {
        "freq": packed(result.freq_hz),
        "measured": _packed_complex(level, "measured"),
        "drawn": _packed_complex(level, "as_drawn"),
        "tuned": _packed_complex(level, "tuned"),
        "noise": packed(level.noise.T),
        "deviation": None if level.deviation is None else packed(level.deviation.T),
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
        "pulls": pull_points(summary),
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
