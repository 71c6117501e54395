"""Section of plant.html on control loops: table of margins, data of Bode, Nyquist and |S|."""

from html import escape

import numpy as np

from identification.words import Complex, Real
from mbw.page.html import pack_complex, pack_real
from mbw.plant.margin_schema import LoopMarginsRow, MarginsRow, StepRow
from mbw.plant.margin_sentences import interval_note, margin_table, step_sentence, variant_text
from tuning.plant.control_loops.loop_gain_lines import single_loop_gains
from tuning.plant.control_loops.stability_margins import AllMargins
from tuning.plant.error_budget.loop_margins import PlantMargins
from tuning.plant.error_budget.reference_step import ReferenceStep

_ROOM = 3.0  # factor of frequency beyond crossovers and band
_MAX_DRAWN_SAMPLES = 20  # machines of the posterior
_MAX_DRAWN_LINES = 1200  # of a loop gain

_TEXT = (
    "<h2>Stability margins</h2>{table}"
    '<p class="soft">Each margin is that of one loop with all others closed{over}. '
    "Gain, phase and delay: what may change before the loop is unstable. "
    "Modulus: the smallest distance of the loop gain from -1, "
    "the inverse of the sensitivity peak. |W T| below 1: stable for every plant "
    "within the weight W, in the band where W is known. "
    "All loops at once: the units of the signals are scaled out, and the "
    "interval holds the parameters only. Worst: of the machines alone.</p>{variants}"
    '<nav id="loop-choice"></nav><div id="loop-gain"></div>'
    '<div class="pair"><div><h3>Nyquist plot of the loop gain</h3><div id="nyquist"></div></div>'
    '<div><h3>Sensitivity</h3><div id="sensitivity"></div></div></div>'
    '<h3>Step of the reference</h3><div id="reference-step"></div>'
    '<p class="soft">Dots mark the margins. The dotted circle around -1 has the modulus margin as '
    "its radius.{samples}{weight}</p>"
)


def margin_section(row: MarginsRow, *, has_weight: bool) -> str:
    """Return HTML of the section.

    Args:
        row: margins.
        has_weight: whether the held-out error is drawn.
    """
    over = f", with its 95 % interval{interval_note(row)}"
    variants = "".join(f"<li>{escape(variant_text(each))}</li>" for each in row.variants)
    return _TEXT.format(
        table=margin_table(row),
        variants=f'<h3>Models and poses of the tests</h3><ul class="plain">{variants}</ul>'
        if variants
        else "",
        over=over if row.machines else "",
        samples=" Thin curves are machines of the posterior, the red one the worst of them."
        if row.machines
        else "",
        weight=" |T| below the inverse of the held-out error W is robust, in its band."
        if has_weight
        else "",
    )


def margin_data(
    margins: PlantMargins,
    row: MarginsRow,
    band: tuple[float, float],
    before: AllMargins | None = None,
) -> dict[str, object]:
    """Return the data of the script.

    Args:
        margins: with the curves of the loop gains.
        row: their rows.
        band: of the budget [Hz].
        before: margins of the other machine; None without one.
    """
    loops = [
        _loop_data(margins, number, each, band, before) for number, each in enumerate(row.loops)
    ]
    return {"loops": loops}


def _loop_data(
    margins: PlantMargins,
    number: int,
    row: LoopMarginsRow,
    band: tuple[float, float],
    before: AllMargins | None,
) -> dict[str, object]:
    """Return the curves of one loop and its marks."""
    marked = [
        each.frequency
        for each in (row.crossover, row.gain, row.gain_reduction, row.phase, row.modulus)
        if each.frequency
    ]
    span = (min([band[0], *marked]) / _ROOM, max([band[1], *marked]) * _ROOM)
    error = margins.held_out[number]
    weight = None
    if error is not None:
        weight = {"freq": pack_real(error.freq_hz), "inverse": pack_real(1 / error.quantile)}
    drawn = list(range(min(len(margins.samples), _MAX_DRAWN_SAMPLES)))
    worst = row.worst_machine
    return {
        "name": row.loop,
        **_curve(margins.nominal, number, span),
        "samples": [_curve(margins.samples[k], number, span) for k in drawn if k != worst],
        "worst": None if worst is None else _curve(margins.samples[worst], number, span),
        "weight": weight,
        "step": _step_data(margins.steps[number], row.step),
        "before": None if before is None else _curve(before, number, span),
        "gain": [row.gain.frequency, row.gain.value],
        "reduction": [row.gain_reduction.frequency, row.gain_reduction.value],
        "phase": [row.phase.frequency, row.phase.value],
        "modulus": [row.modulus.frequency, row.modulus.value],
    }


def _step_data(step: ReferenceStep | None, row: StepRow | None) -> dict[str, object] | None:
    """Return the response to a step of the reference, and its sentence."""
    if step is None or row is None:
        return None
    return {
        "time": pack_real(step.time_s),
        "response": pack_real(step.response),
        "final": step.final,
        "sentence": step_sentence(row),
    }


def _curve(margins: AllMargins, number: int, span: tuple[float, float]) -> dict[str, object]:
    """Return lines and loop gain of one loop within a span of frequencies."""
    freq: Real = margins.freq_hz
    inside = np.flatnonzero((freq >= span[0]) & (freq <= span[1]))
    steps = np.linspace(0, len(inside) - 1, min(len(inside), _MAX_DRAWN_LINES))
    chosen = inside[steps.round().astype(int)]
    gains: Complex = single_loop_gains(margins.gains[chosen])[:, number]
    return {"freq": pack_real(freq[chosen]), "values": pack_complex(gains)}
