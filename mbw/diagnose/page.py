"""The page of ``mbw diagnose``: verdict, gap, causes, place, FRFs, channels, what was tried."""

from html import escape

import numpy as np

from diagnosis.labels import direction
from identification.words import Dof, Real
from mbw.diagnose.effect_parameters import number
from mbw.diagnose.headline import badges, doubts, lead
from mbw.diagnose.machine_rows import machine_of
from mbw.diagnose.result import STEPS, Result
from mbw.diagnose.sentences import gate_sentences, place
from mbw.diagnose.tables import causes_section, tried_section
from mbw.page.html import fill, packed, packed_polar, packed_sizes, piece, warnings
from mbw.page.numbers import UNITS, percent
from mbw.page.picture import picture

_PLACES = 12  # that have bars
_COLOURS = dict(zip(STEPS, ("#98a2b3", "#d9822b", "#1f6fb8"), strict=True))


def render(result: Result) -> str:
    """The HTML of a diagnosis."""
    shown = result.shown
    places = _places(result)
    scripts = ["page/bode.js", "diagnose/page.js", "diagnose/frf.js", "diagnose/map.js"]
    scripts += ["page/picture.js", "diagnose/where.js"] if places else []
    return fill(
        "diagnose/template.html",
        _data(result, places),
        title=escape(f"{shown.model}: what the model lacks"),
        subtitle=escape(
            f"campaign {shown.campaign}, {_count(len(shown.tests), 'test')}, "
            f"{_count(len(shown.channels), 'channel')}, {shown.lines} lines "
            f"{shown.band[0]:g}..{shown.band[1]:g} Hz"
        ),
        lead=escape(lead(result)),
        badges=badges(result),
        warnings=warnings(doubts(result)),
        lines=_lines(result),
        centres=escape(_centres(result)),
        causes=causes_section(result),
        where=piece("diagnose/where.html") if places else _NOWHERE,
        gates="".join(f"<p>{escape(text)}</p>" for text in gate_sentences(shown)),
        tried=tried_section(result),
        provenance=_provenance(result),
        scripts=scripts,
        styles=["diagnose/style.css"],
    )


_NOWHERE = "<p>No place stands out: too little is left to tell.</p>"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _lines(result: Result) -> str:
    """On which lines the figures hold."""
    shown = result.shown
    if shown.block is None:
        return "all on the lines that were fitted"
    noise, ends = result.verdict.gap.noise, shown.steps.noise
    alone = ""
    if noise is not None and ends is not None:
        alone = (
            f"; the noise alone is an error of {percent(noise)}, 95 %: {percent(ends[0])} to "
            f"{percent(ends[1])}"
        )
    width = shown.block * (shown.band[1] - shown.band[0]) / max(shown.lines - 1, 1)
    return (
        f"as drawn on all lines, the others held out: blocks of {width:.3g} Hz in five folds, each "
        f"predicted by a fit that did not see it{alone}"
    )


def _centres(result: Result) -> str:
    """The gap at the centres of mass, in a sentence."""
    known = [row for row in result.shown.centres if row.excess is not None and row.channels]
    if not known:
        return ""
    steps = ", ".join(f"{row.name} {number(row.excess or 0.0)}" for row in known)
    return (
        f"Reduced to the centres of mass ({known[0].channels} FRFs, the noise with the "
        f"covariance of the reduction), the excess is {steps}."
    )


def _data(result: Result, places: list[dict[str, object]]) -> dict[str, object]:
    shown = result.shown
    data: dict[str, object] = {
        "gap": _gap(result),
        "tests": [test.label for test in shown.tests],
        "channels": _channels(result),
        "frf": _frf(result),
        "has_after": result.has_after,
        "places": places,
    }
    if places:
        layout, looks = machine_of(shown.machine, result.arrays)
        data["picture"] = picture(layout, looks, np.zeros((0, 6 * len(layout.bodies)), complex))
    return data


def _gap(result: Result) -> list[dict[str, object]]:
    """The bars, with intervals where lines could be held out."""
    gap, ends = result.verdict.gap, result.shown.steps
    rows = (gap.as_drawn, ends.as_drawn), (gap.retuned, ends.retuned), (gap.after, ends.after)
    steps = zip(_COLOURS, rows, strict=True)
    return [
        {
            "name": name,
            "excess": at.excess,
            "error": at.error,
            "interval": interval,
            "colour": _COLOURS[name],
        }
        for name, (at, interval) in steps
        if at.excess is not None
    ]


def _channels(result: Result) -> list[dict[str, object]]:
    arrays, taken = result.arrays, _taken_out(result)
    numbers = {
        name: _numbers(arrays[name])
        for name in ("retuned_excess", "after_excess", "retuned_error", "after_error")
    }
    numbers["noise"] = _numbers(arrays["channel_noise"])
    rotations = UNITS[result.shown.quantity]
    found = []
    for k, row in enumerate(result.shown.channels):
        dof = Dof.parse(row.output)
        found.append(
            {
                **row.model_dump(),
                "unit": rotations[dof.is_rotation],
                "out": (dof.point, dof.direction[1:]) in taken or (dof.point, None) in taken,
                **{name: values[k] for name, values in numbers.items()},
            }
        )
    return found


def _taken_out(result: Result) -> set[tuple[str, str | None]]:
    """Sensor and axis of each channel that a gate took out; None for all axes."""
    return {
        (site, axis)
        for one in result.shown.taken_out
        for site in one.location.partition(":")[2].split("+")
        for axis in (one.dof.split("+") if one.dof else [None])
    }


def _numbers(values: Real) -> list[float | None]:
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in values]


def _frf(result: Result) -> dict[str, object]:
    """Channel after channel; ``corrected`` says of which channels there is another measurement."""
    arrays = result.arrays
    names = ["measured", "retuned", *(["after"] if result.has_after else [])]
    return {
        "quantity": result.shown.quantity,
        "freq": packed(arrays["freq_hz"]),
        **{name: packed_polar(arrays[name].T) for name in names},
        "noise": packed_sizes(arrays["noise"].T),
        "corrected": packed_polar(arrays["corrected"].T),
        "corrected_channels": result.shown.corrected,
    }


def _places(result: Result) -> list[dict[str, object]]:
    """Places with a share of the gap or a free force that explains something, most first."""
    verdict = result.verdict
    shares = {one.location: one.share for one in verdict.where if verdict.verdict != "none"}
    gains = {one.location: max(one.gain, 0.0) for one in result.evidence.pushed}
    towards = {one.location: direction(one.dof) for one in result.evidence.pushed}
    kept = [name for name in shares if shares[name]]
    kept += [name for name in gains if gains[name] and name not in kept]
    return [
        {
            "name": place(name),
            "share": shares.get(name),
            "gain": gains.get(name),
            "towards": towards.get(name, ""),
            **(result.shown.places[name].model_dump() if name in result.shown.places else _NONE),
        }
        for name in kept[:_PLACES]
    ]


_NONE: dict[str, list[str]] = {"bodies": [], "points": []}


def _provenance(result: Result) -> str:
    """Files that were read."""
    files = ", ".join(
        f'{escape(row.file)} <code title="SHA-256 {escape(row.sha256)}">{escape(row.sha256[:10])}'
        "</code>"
        for row in result.shown.inputs
    )
    return f"Read: {files}." if files else ""
