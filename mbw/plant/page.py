"""Page plant.html: errors before and after, their spectra and shares, Bode plots, poles."""

from collections.abc import Sequence
from html import escape

import numpy as np

from identification.words import Real
from mbw.page.html import fill_template, pack_complex, pack_real, warning_boxes
from mbw.page.numbers import format_percent
from mbw.plant.margin_section import margin_data, margin_section
from mbw.plant.rows import thin_cumulative
from mbw.plant.schema import BudgetRow, ErrorRow
from mbw.plant.sentences import mode_name
from mbw.plant.struts import StrutsResult
from tuning.plant.error_budget.budget import ErrorBudget, trapezoid_weights
from tuning.plant.error_budget.plant_budget import PlantBudget
from tuning.plant.error_budget.plant_curves import PlantCurves

PLANT_PAGE = "plant.html"
_MAX_BARS = 8  # of each kind
_MAX_CURVE_LINES = 900  # of a curve on the page
_MAX_SHOWN_SAMPLES = 25  # machines of the posterior whose poles are drawn


def render_plant(
    plant: PlantBudget,
    row: BudgetRow,
    names: tuple[str, str],
    causes: Sequence[str],
    struts: StrutsResult | None = None,
    *,
    notes: Sequence[str] = (),
) -> str:
    """Return the HTML page of a budget.

    Args:
        row: its rows.
        names: of the machine, and of the counterpart.
        causes: sentences on what a diagnosis found.
        struts: damping and decoupling; None if not asked for.
        notes: remarks of the rows that only say which frequencies test and spectra cover.
    """
    after, before = names
    loops = f"with the loops {', '.join(row.loops)} closed" if row.loops else "without loops"
    has_other = plant.before is not None
    return fill_template(
        "plant/template.html",
        {**_data(plant, row, names), "struts": None if struts is None else struts.data()},
        title=escape(f"{after}: error budget"),
        subtitle=escape(f"{row.file}, {row.band[0]:g} to {row.band[1]:g} Hz, {loops}"),
        warnings=warning_boxes(row.remarks, notes),
        causes="".join(f'<p class="lead">{escape(text)}.</p>' for text in causes),
        errors=_error_table(plant, row),
        note=escape(_note(plant)),
        legend=escape(f"Dashed or crosses: {before}.") if has_other else "",
        bands=escape(_bands_note(plant)),
        modes=escape(_modes_note(plant)),
        margins=_margin_section(plant, row),
        loops=escape(loops),
        struts="" if struts is None else struts.section(),
        scripts=["page/bode.js", "plant/page.js", "plant/margins.js"],
    )


def _note(plant: PlantBudget) -> str:
    """Return what the intervals mean."""
    if plant.interval is None:
        return "No interval: the machine has no posterior.npz of a tuning or diagnosis beside it."
    largest = float(plant.interval.by_model_error.max(initial=0.0))
    return (
        "Intervals: covariance of the fit, to first order in the logarithm of the rms, with the "
        f"model error beside the noise (at most {format_percent(largest)} of an rms)."
    )


def _modes_note(plant: PlantBudget) -> str:
    """Return whose modes share an error, where they are not those of the closed loops."""
    if not plant.budget.states.period_s:
        return ""
    return " The modes are those of the machine itself, driven by disturbances and held controls."


def _bands_note(plant: PlantBudget) -> str:
    """Return what the bands mean."""
    bands = "The band is the 95 % interval by samples of the posterior and the model error. "
    return (
        bands if plant.interval is not None else ""
    ) + "Errors per source are with the loops closed; the plant of a loop is with all loops open."


def _margin_section(plant: PlantBudget, row: BudgetRow) -> str:
    """Return HTML of the section on stability margins; empty without loops."""
    if row.margins is None or plant.margins is None:
        return ""
    return margin_section(row.margins, has_weight=any(plant.margins.held_out))


def _error_table(plant: PlantBudget, row: BudgetRow) -> str:
    """Return HTML of the table of errors."""
    units = plant.budget.definition.units
    head = "<th class='name'>error</th><th class='name'>signal</th><th>rms</th><th>95 %</th>"
    if plant.before is not None:
        head += "<th>before</th><th>change</th>"
    body = "".join(f"<tr>{_error_cells(error, units[error.name][1])}</tr>" for error in row.errors)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _error_cells(error: ErrorRow, unit: float) -> str:
    """Return the cells of one error."""
    cells = [f"{error.rms / unit:.4g} {escape(error.unit)}"]
    is_known = error.low is not None and error.high is not None
    cells.append(
        f"{(error.low or 0) / unit:.4g} to {(error.high or 0) / unit:.4g}" if is_known else "-"
    )
    if error.before is not None:
        change = format_percent(error.rms / error.before - 1) if error.before else "-"
        cells += [f"{error.before / unit:.4g} {escape(error.unit)}", change]
    names = "".join(f"<td class='name'>{escape(text)}</td>" for text in (error.name, error.signal))
    return names + "".join(f"<td>{text}</td>" for text in cells)


def _data(plant: PlantBudget, row: BudgetRow, names: tuple[str, str]) -> dict[str, object]:
    """Return the data of the script."""
    definition = plant.budget.definition
    counterpart = plant.before
    return {
        "after": names[0],
        "before": names[1],
        "band": list(row.band),
        "sources": [source.name for source in definition.sources],
        "errors": [_error_data(plant, error, k) for k, error in enumerate(row.errors)],
        "curves": _curve_data(plant.curves()),
        "poles": [[pole.frequency, pole.damping] for pole in row.poles if pole.imaginary],
        "polesBefore": None
        if counterpart is None
        else _shown_poles(counterpart.states.poles(), row.band[1]),
        "samples": _sample_poles(plant, row.band[1]),
        "margins": None
        if plant.margins is None or row.margins is None
        else margin_data(plant.margins, row.margins, row.band, plant.margins_before),
    }


def _error_data(plant: PlantBudget, error: ErrorRow, number: int) -> dict[str, object]:
    """Return spectra and bars of one error."""
    budget, counterpart = plant.budget, plant.before
    unit = budget.definition.units[error.name][1]
    cumulative: dict[str, object] = {
        "freq": pack_real(np.array(error.freq_hz)),
        "values": pack_real(np.array(error.cumulative) / unit),
    }
    freq, total, parts = _densities(budget, number)
    density: dict[str, object] = {
        "freq": pack_real(freq),
        "total": pack_real(total / unit),
        "sources": [pack_real(part / unit) for part in parts],
    }
    if counterpart is not None:
        lines, values = thin_cumulative(counterpart, number)
        cumulative |= {"beforeFreq": pack_real(lines), "before": pack_real(values / unit)}
        lines, values, _ = _densities(counterpart, number)
        density |= {"beforeFreq": pack_real(lines), "before": pack_real(values / unit)}
    return {
        "name": error.name,
        "unit": error.unit,
        "cumulative": cumulative,
        "density": density,
        "sources": _bars(
            [(share.name, share.share) for share in [*error.sources, *error.cross_terms]]
        ),
        "modes": _bars([(mode_name(mode), mode.share) for mode in error.modes]),
        "joints": _bars([(share.name, share.share) for share in error.joints]),
        "touches": [[touch.parameter, touch.change / unit] for touch in error.touches[:_MAX_BARS]],
    }


def _densities(budget: ErrorBudget, number: int) -> tuple[Real, Real, list[Real]]:
    """Return lines, root of the density, and that of each source alone, thinned."""
    freq, density = budget.density()
    count, total = budget.random_lines, np.sqrt(density[:, number])
    parts = np.abs(budget.scaled[:count, number]) / np.sqrt(trapezoid_weights(freq))[:, None]
    chosen = np.unique(np.linspace(0, count - 1, _MAX_CURVE_LINES).round().astype(int))
    return freq[chosen], total[chosen], [parts[chosen, k] for k in range(parts.shape[1])]


def _bars(rows: Sequence[tuple[str, float]]) -> list[list[object]]:
    """Return the largest shares in per cent."""
    largest = sorted(rows, key=lambda row: -abs(row[1]))[:_MAX_BARS]
    return [[name, 100 * share] for name, share in largest]


def _curve_data(curves: PlantCurves) -> dict[str, object]:
    """Return the FRFs with their bands."""
    optional = {
        "before": None if curves.before is None else pack_complex(curves.before.T),
        "magnitude": None if curves.magnitude is None else pack_real(curves.magnitude.T),
        "phase": None if curves.phase is None else pack_real(curves.phase.T),
    }
    return {
        "freq": pack_real(curves.freq_hz),
        "ports": [[port.label, port.unit] for port in curves.ports],
        "values": pack_complex(curves.values.T),
        **optional,
    }


def _shown_poles(poles: np.ndarray, highest_hz: float) -> list[list[float]]:
    """Return frequency and damping ratio of oscillating poles up to twice the band."""
    size = np.abs(poles)
    chosen = (poles.imag > 0) & (size < 4 * np.pi * highest_hz)
    return [
        [float(abs(pole) / (2 * np.pi)), float(-pole.real / abs(pole))] for pole in poles[chosen]
    ]


def _sample_poles(plant: PlantBudget, highest_hz: float) -> list[list[float]]:
    """Return the poles of some machines of the posterior."""
    return [
        pole
        for poles in plant.sample_poles[:_MAX_SHOWN_SAMPLES]
        for pole in _shown_poles(poles, highest_hz)
    ]
