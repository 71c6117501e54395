"""Page of ``mbw compare``: modes, FRFs overlaid with their noise, and the change of the machine."""

from html import escape

import numpy as np

from identification.comparison import TestComparison
from identification.modal import MeasuredFrfs
from identification.words import (
    DERIVATIVE_ORDER,
    MAX_SHOWN_VALUES,
    Input,
    Output,
    Real,
    thinning_step,
)
from mbw.compare.schema import ComparedFile
from mbw.page.html import fill_template, pack_magnitudes, pack_polar, pack_real, warning_boxes
from mbw.page.numbers import frf_unit

_SUBTITLES = {
    "visits": "before and after",
    "machines": "two machines of one drawing",
    "fleet": "a fleet",
}


def render(result: ComparedFile, comparison: TestComparison, report: str | None) -> str:
    """Return the HTML page of a comparison.

    Args:
        result: rows of the comparison.
        comparison: tests with their FRFs.
        report: address of the page of the diagnosis; None without one.
    """
    names = [row.name for row in result.campaigns]
    cells = _list_cells(result, comparison)
    quantity = next(
        name for name, order in DERIVATIVE_ORDER.items() if order == comparison.frfs[0].order
    )
    data = {
        "kind": result.kind,
        "names": names,
        "modes": [row.model_dump() for row in result.modes],
        "cells": [[str(output), str(source)] for output, source in cells],
        "units": [frf_unit(quantity, str(output), str(source)) for output, source in cells],
        "differences": [[row.over_noise, row.relative] for row in result.frfs],
        "quantity": quantity,
        **_pack_frfs(comparison, cells),
    }
    lead = " ".join(filter(None, (result.change, result.sentence)))
    link = f' <a href="{escape(report)}">The page of the diagnosis</a>.' if report else ""
    notes = [text for text in (*result.remarks, result.without_diagnosis) if text]
    return fill_template(
        "compare/template.html",
        data,
        title=escape(f"{' and '.join(names[:2])}{' ...' if len(names) > 2 else ''}: what differs"),
        subtitle=escape(
            f"{_SUBTITLES[result.kind]}: {len(names)} tests, {len(result.channels)} shared "
            f"channels, {result.band[0]:.4g}..{result.band[1]:.4g} Hz"
        ),
        lead=escape(lead) + link,
        warnings=warning_boxes(notes, notes),
        scripts=["page/bode.js", "page/modes.js", "compare/page.js"],
        styles=["compare/style.css"],
    )


def _list_cells(result: ComparedFile, comparison: TestComparison) -> list[tuple[Output, Input]]:
    """Return outputs and inputs of the FRFs that all tests have, those that differ most first."""
    if not len(comparison.common_hz):
        return []
    first, *further = comparison.frfs
    cells = [
        (output, source)
        for i, output in enumerate(first.outputs)
        for j, source in enumerate(first.inputs)
        if first.measured[i, j] and all(_has_cell(frfs, output, source) for frfs in further)
    ]
    order = {(row.output, row.input): k for k, row in enumerate(result.frfs)}
    return sorted(cells, key=lambda cell: order.get((str(cell[0]), str(cell[1])), len(order)))


def _has_cell(frfs: MeasuredFrfs, output: Output, source: Input) -> bool:
    if output not in frfs.outputs or source not in frfs.inputs:
        return False
    return bool(frfs.measured[frfs.outputs.index(output), frfs.inputs.index(source)])


def _pack_frfs(comparison: TestComparison, cells: list[tuple[Output, Input]]) -> dict[str, object]:
    """Return lines, FRFs and noise in the first test's quantity; (n_cell, n_test, n_freq)."""
    tests = comparison.frfs
    lines = comparison.common_hz
    size = len(lines) * max(len(cells), 1) * len(tests)
    lines = lines[:: thinning_step(size, MAX_SHOWN_VALUES)]
    values = np.zeros((len(cells), len(tests), len(lines)), complex)
    noise = np.zeros(values.shape)
    for place, frfs in enumerate(tests):
        chosen = np.searchsorted(frfs.freq_hz, lines)
        factor = np.asarray((2j * np.pi * lines) ** (tests[0].order - frfs.order))
        for number, (output, source) in enumerate(cells):
            cell = (frfs.outputs.index(output), frfs.inputs.index(source))
            values[number, place] = frfs.values[(chosen, *cell)] * factor
            deviation: Real = np.sqrt(frfs.variance[(chosen, *cell)])
            noise[number, place] = deviation * np.abs(factor)
    return {
        "freq": pack_real(lines),
        "frf": pack_polar(values),
        "noise": pack_magnitudes(noise),
    }
