"""Page of ``mbw diagnose``: verdict, gap, causes, locations, FRFs, channels, hypotheses."""

from html import escape

import numpy as np

from diagnosis.inference.evidence import ForceGain
from diagnosis.labels import name_direction
from diagnosis.verdict.sentences import place_name
from identification.words import Real, count_noun, split_label
from mbw.diagnose.effect_parameters import number
from mbw.diagnose.headline import badges, doubts, lead
from mbw.diagnose.link_axis import axis_words
from mbw.diagnose.result import STEPS, twin_locations
from mbw.diagnose.sentences import sensor_check_sentences
from mbw.diagnose.tables import causes_section, hypotheses_section
from mbw.page.html import (
    fill_template,
    input_files,
    pack_magnitudes,
    pack_polar,
    pack_real,
    read_fragment,
    warning_boxes,
)
from mbw.page.numbers import format_percent, frf_unit
from mbw.page.picture import picture_data
from mbw.remarks import gain_table
from mbw.results.diagnosed_files import StoredDiagnosis, restore_machine
from mbw.results.diagnosed_schema import PlaceRow

_MAX_PLACE_BARS = 12  # locations of the bar chart, unless the verdict names more
_STEP_COLOURS = dict(zip(STEPS, ("#98a2b3", "#d9822b", "#1f6fb8"), strict=True))


def render(result: StoredDiagnosis) -> str:
    """Return the HTML page of a diagnosis."""
    shown = result.shown
    places = _places(result)
    scripts = ["page/bode.js", "diagnose/page.js", "diagnose/frf.js", "diagnose/map.js"]
    scripts += ["page/picture.js", "diagnose/where.js"] if places else []
    return fill_template(
        "diagnose/template.html",
        _data(result, places),
        title=escape(f"{shown.model}: what the model lacks"),
        subtitle=escape(
            f"campaign {shown.campaign}, {count_noun(len(shown.tests), 'test')}, "
            f"{count_noun(len(shown.channels), 'channel')}, {shown.lines} frequency lines "
            f"{shown.band[0]:g}..{shown.band[1]:g} Hz"
        ),
        lead=escape(lead(result)),
        badges=badges(result),
        warnings=warning_boxes(doubts(result)),
        lines=_lines(result),
        centres=escape(_centres(result)),
        causes=causes_section(result),
        where=read_fragment("diagnose/where.html") if places else _NO_PLACES,
        gates="".join(f"<p>{escape(text)}</p>" for text in sensor_check_sentences(shown)),
        tried=hypotheses_section(result),
        gains=gain_table(result.verdict.channel_gains),
        provenance=input_files(result.shown.inputs),
        scripts=scripts,
        styles=["diagnose/style.css"],
    )


_NO_PLACES = "<p>No place stands out: the residual gap is too small to locate.</p>"


def _lines(result: StoredDiagnosis) -> str:
    """Return the frequency lines to which the figures refer."""
    shown = result.shown
    if shown.block is None:
        return "all on the fitted frequency lines"
    noise, ends = result.verdict.gap.noise, shown.steps.noise
    noise_text = ""
    if noise is not None and ends is not None:
        noise_text = (
            f"; the noise alone is an error of {format_percent(noise)}, 95 %: "
            f"{format_percent(ends[0])} to {format_percent(ends[1])}"
        )
    width = shown.block * (shown.band[1] - shown.band[0]) / max(shown.lines - 1, 1)
    return (
        "as drawn on all frequency lines, the others on held-out lines by five-fold "
        f"cross-validation over blocks of {width:.3g} Hz in the mean, from resonance to "
        f"resonance{noise_text}"
    )


def _centres(result: StoredDiagnosis) -> str:
    """Return a sentence on the gap at the centres of mass."""
    rows = [row for row in result.shown.centres if row.excess is not None and row.channels]
    if not rows:
        return ""
    steps = ", ".join(f"{row.name} {number(row.excess or 0.0)}" for row in rows)
    return (
        f"Reduced to the centres of mass ({rows[0].channels} FRFs, with the covariance of the "
        f"reduction), the excess is {steps}."
    )


def _data(result: StoredDiagnosis, places: list[dict[str, object]]) -> dict[str, object]:
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
        layout, geometry = restore_machine(shown.machine, result.arrays)
        no_shapes = np.zeros((0, 6 * len(layout.bodies)), complex)
        data["picture"] = picture_data(layout, geometry, no_shapes)
    return data


def _gap(result: StoredDiagnosis) -> list[dict[str, object]]:
    """Return the bars of the gap, with intervals if frequency lines could be held out."""
    gap, ends = result.verdict.gap, result.shown.steps
    rows = (gap.as_drawn, ends.as_drawn), (gap.retuned, ends.retuned), (gap.after, ends.after)
    steps = zip(_STEP_COLOURS, rows, strict=True)
    return [
        {
            "name": name,
            "excess": at.excess,
            "error": at.error,
            "interval": interval,
            "colour": _STEP_COLOURS[name],
        }
        for name, (at, interval) in steps
        if at.excess is not None
    ]


def _channels(result: StoredDiagnosis) -> list[dict[str, object]]:
    arrays, removed = result.arrays, _removed_channels(result)
    numbers = {
        name: _numbers(arrays[name])
        for name in ("retuned_excess", "after_excess", "retuned_error", "after_error")
    }
    numbers["noise"] = _numbers(arrays["channel_noise"])
    channels: list[dict[str, object]] = []
    tests = result.shown.tests
    for k, row in enumerate(result.shown.channels):
        point, direction = split_label(row.output)
        channels.append(
            {
                **row.model_dump(),
                "unit": frf_unit(result.shown.quantity, row.output, tests[row.test].reference),
                "out": (point, direction) in removed or (point, None) in removed,
                **{name: values[k] for name, values in numbers.items()},
            }
        )
    return channels


def _removed_channels(result: StoredDiagnosis) -> set[tuple[str, str | None]]:
    """Return sensor and axis of each channel that a data check removed; None for all axes."""
    return {
        (site, axis)
        for fault in result.shown.taken_out
        for site in fault.location.partition(":")[2].split("+")
        for axis in (fault.dof.split("+") if fault.dof else [None])
    }


def _numbers(values: Real) -> list[float | None]:
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in values]


def _frf(result: StoredDiagnosis) -> dict[str, object]:
    """Return the FRFs channel after channel, and those of channels that the effect corrects."""
    arrays = result.arrays
    names = ["measured", "retuned", *(["after"] if result.has_after else [])]
    return {
        "quantity": result.shown.quantity,
        "freq": pack_real(arrays["freq_hz"]),
        **{name: pack_polar(arrays[name].T) for name in names},
        "noise": pack_magnitudes(arrays["noise"].T),
        "corrected": pack_polar(arrays["corrected"].T),
        "corrected_channels": result.shown.corrected,
    }


def _places(result: StoredDiagnosis) -> list[dict[str, object]]:
    """Return every location that the verdict names, then those with a free-force gain."""
    verdict = result.verdict
    shares = {row.location: row.share for row in verdict.where if verdict.verdict != "none"}
    forces = located_rest(result)
    gains = {force.location: max(force.gain, 0.0) for force in forces}
    towards = {force.location: name_direction(force.dof) for force in forces}
    places = result.shown.places
    named = [name for name in shares if shares[name]]
    named += [place for row in verdict.causes for place in (row.location, *row.places)]
    named += twin_locations(verdict)
    kept = list(dict.fromkeys(named))
    forced = [name for name in gains if gains[name] and name not in kept]
    kept += forced[: max(_MAX_PLACE_BARS - len(kept), 0)]
    return [
        {
            "name": place_name(name),
            "share": shares.get(name),
            "gain": gains.get(name),
            "towards": towards.get(name, ""),
            "note": _place_note(places.get(name)),
            **(places.get(name) or PlaceRow(bodies=[], points=[])).model_dump(),
        }
        for name in kept
    ]


def located_rest(result: StoredDiagnosis) -> tuple[ForceGain, ...]:
    """Return the free forces of what is to be located: the rest, or the gap of the null model.

    Empty where nothing is missing: what a free force then takes up is noise.
    """
    evidence = result.evidence
    if result.verdict.verdict == "none":
        return ()
    return evidence.rest_pushed if result.verdict.verdict == "partly" else evidence.pushed


def _place_note(row: PlaceRow | None) -> str:
    """Return the direction and the ends of a link in words; empty for another place."""
    if row is None or not row.line:
        return ""
    lower, upper = row.bodies
    axis = f"; it is stiffest {axis_words(row.axis)}, in world axes" if row.axis else ""
    return f"link between the centres of mass of {lower} and {upper}{axis}"
