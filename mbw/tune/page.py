"""Page of ``mbw tune`` as one self-contained HTML file."""

from html import escape

import numpy as np

from identification.words import Dof, percent_text
from mbw.page.html import fill_template, pack_complex, pack_real, read_fragment, warning_boxes
from mbw.page.numbers import format_percent, frf_unit
from mbw.remarks import describe_gap, gain_table, list_limits, list_notes
from mbw.tune.convergence import badges, identifiability_section, provenance, starts_section
from mbw.tune.mode_pairs import pairs_section
from mbw.tune.parameters import interval_note, parameters_table
from mbw.tune.pulls import pull_points, pulls_note, pulls_table
from tuning import LevelFrfs, TunedFile, TuningResult

PAGE = "report.html"
_SERIES_COLOURS = {
    "as drawn": "#d9822b",
    "tuned": "#1f6fb8",
    "held out": "#7fb2e0",
    "noise": "#98a2b3",
}


def render(result: TuningResult) -> str:
    """Return the HTML page of a tuning."""
    summary = result.summary
    return fill_template(
        "tune/template.html",
        _data(result),
        title=escape(f"{summary.model}: model and hammer test"),
        subtitle=escape(
            f"campaign {summary.campaign}, {len(summary.tests)} tests, {summary.lines} frequency "
            f"lines {summary.band[0]:g}..{summary.band[1]:g} Hz, "
            f"{_parameter_counts(summary)} tuned"
        ),
        lead=escape(_lead(summary)),
        badges=badges(summary),
        warnings=warning_boxes(_warnings(summary), list_notes(summary)),
        charts=read_fragment("tune/frfs.html"),
        parameters=parameters_table(summary),
        intervals=escape(interval_note(summary)),
        pulls=_pulls_section(summary),
        unknown=identifiability_section(summary),
        starts=starts_section(summary),
        modes=_modes_section(summary),
        tests=f"<h2>Tests</h2>{_tests_table(summary)}{gain_table(summary.channel_gains)}",
        provenance=provenance(summary, _held_out_sentence(summary), summary.not_held_error),
        scripts=["page/bode.js", "tune/page.js", "tune/pulls.js"],
        styles=["tune/style.css"],
    )


def _lead(summary: TunedFile) -> str:
    gap = summary.gap.sensors
    if gap.as_drawn.error is None or gap.tuned.error is None:
        return (
            f"Nominal model: {describe_gap(gap.as_drawn.error, gap.as_drawn.excess)}. "
            f"Tuned model: {describe_gap(gap.tuned.error, gap.tuned.excess)}."
        )
    text = (
        "As drawn, the nominal model is off by "
        f"{format_percent(gap.as_drawn.error)} of the measured FRFs; "
        f"tuned, by {format_percent(gap.tuned.error)}"
    )
    if gap.held_out is not None and gap.held_out.error is not None:
        text += f", and by {format_percent(gap.held_out.error)} on held-out frequency lines"
        worst = max(summary.held_out_blocks, key=lambda block: block.share)
        if worst.share > 0.5:
            text += (
                f" ({100 * worst.share:.0f} % of the squared error lies in "
                f"{worst.low:g}..{worst.high:g} Hz)"
            )
    if gap.noise is None:
        return text + "."
    text += f". The noise of the measurement is {format_percent(gap.noise)}"
    if summary.model_error is None:
        return text + "."
    return text + (
        f"; beside it, the residuals show a model error of {percent_text(summary.model_error)} of "
        "each sensor's motion on an ordinary line."
    )


def _warnings(summary: TunedFile) -> list[str]:
    interrupted = ["There are no held-out frequency lines: the tuning was interrupted."]
    return (interrupted if summary.interrupted else []) + list_limits(summary)


def _parameter_counts(summary: TunedFile) -> str:
    tolerances = sum(row.prior is not None for row in summary.parameters)
    text = f"{len(summary.parameters) - tolerances} parameters"
    return f"{text} and {tolerances} tolerances" if tolerances else text


def _pulls_section(summary: TunedFile) -> str:
    """Return chart and table of the tolerances; empty if none was tuned."""
    if all(row.pull is None for row in summary.parameters):
        return ""
    return (
        '<h2>Tolerances</h2><div class="pulls"><div id="pulls"></div>'
        f'<div>{pulls_table(summary)}</div></div><p class="soft">{escape(pulls_note(summary))}</p>'
    )


def _modes_section(summary: TunedFile) -> str:
    drawn, tuned = (_modes_table(summary, key) for key in ("as_drawn", "tuned"))
    return (
        '<h2>Modes of the model in the band</h2><div class="pair">'
        f"<div><b>as drawn</b>{drawn}</div><div><b>tuned</b>{tuned}</div></div>"
        f"{pairs_section(summary)}"
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
        f"<td>{'' if test.level is None else f'{test.level:g} {escape(test.drive_unit)}'}</td>"
        f"<td>{'' if test.averages is None else test.averages}</td><td>{test.channels}</td>"
        f'<td class="name">{escape(test.variance_from)}</td></tr>'
        for test in summary.tests
    )
    return (
        '<table><thead><tr><th class="name">file</th><th class="name">hammer</th><th>level</th>'
        '<th>averages</th><th>channels</th><th class="name">noise from</th></tr></thead>'
        f"<tbody>{rows}</tbody></table>"
    )


def _held_out_sentence(summary: TunedFile) -> str:
    blocks = len(summary.held_out_blocks)
    if not blocks:
        return ""
    return (
        f"Held-out errors: five-fold cross-validation over {blocks} blocks from "
        "resonance to resonance."
    )


def _data(result: TuningResult) -> dict[str, object]:
    level, summary = result.levels["bodies"], result.summary
    outputs = [Dof.parse(label) for label in level.outputs]
    places = [test.split(" in ", 1) for test in level.tests]
    return {
        "freq": pack_real(result.freq_hz),
        "measured": _pack_channels(level, "measured"),
        "drawn": _pack_channels(level, "as_drawn"),
        "tuned": _pack_channels(level, "tuned"),
        "noise": pack_real(level.noise.T),
        "deviation": None if level.deviation is None else pack_real(level.deviation.T),
        "channels": [
            {
                "body": dof.point,
                "direction": dof.direction[1:],
                "reference": place[0],
                "file": place[1],
                "unit": frf_unit(summary.quantity, str(dof), place[0]),
            }
            for dof, place in zip(outputs, places, strict=True)
        ],
        "bodies": list(dict.fromkeys(dof.point for dof in outputs)),
        "files": list(dict.fromkeys(place[1] for place in places)),
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
        {"name": name, "error": error, "color": _SERIES_COLOURS[name]}
        for name, error in series.items()
    ]


def _pack_channels(level: LevelFrfs, name: str) -> str:
    """Return FRFs packed channel after channel."""
    values: np.ndarray = getattr(level, name).T
    return pack_complex(values)
