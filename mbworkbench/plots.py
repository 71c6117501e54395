"""Figures of results, by plotly."""

from collections.abc import Iterator
from itertools import islice

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from identification.hits.drive_point import drive_point_rows
from identification.words import Campaign, Complex, Dof, Frf, FrfEstimate, Real, Test
from mbworkbench.budgets import ErrorBudgetResult, MarginsResult, SimulatedBudget
from mbworkbench.campaign import IdentifiedModel, MeasuredCampaign
from mbworkbench.comparison import ComparisonResult
from mbworkbench.diagnosis import DiagnosisResult
from mbworkbench.excitation import ExcitationResult
from mbworkbench.model import ModelModes
from mbworkbench.plant import TunedPlant
from mbworkbench.tables import plot
from mbworkbench.tuning import TunedModel

__all__ = ["plot"]

MAX_CURVES = 12  # beyond this number of curves a legend is no longer read
UNITS = {"receptance": "m/N", "mobility": "m/(N s)", "accelerance": "m/(N s²)"}
COLOURS = {"measured": "#444444", "nominal": "#bbbbbb", "tuned": "#1f77b4"}
PALETTE = ("#1f77b4", "#d95f02", "#1b9e77", "#7570b3", "#e7298a", "#66a61e")
MAX_BAR_WIDTH = 0.5  # of the distance between two bars


@plot.register
def _(result: Frf) -> go.Figure:
    figure = _bode(_axis_title(result))
    curves = [
        (f"{output} / {source}", result.values[:, row, column])
        for row, output in enumerate(result.outputs)
        for column, source in enumerate(result.inputs)
    ]
    for number, (name, values) in enumerate(curves[:MAX_CURVES]):
        colour = PALETTE[number % len(PALETTE)]
        _add_curve(figure, result.freq_hz, values, name, colour=colour)
    if len(curves) > MAX_CURVES:
        figure.update_layout(title=f"the first {MAX_CURVES} of {len(curves)} FRFs; select others")
    return figure


@plot.register
def _(result: FrfEstimate) -> go.Figure:
    return plot(result.frf)


@plot.register
def _(result: MeasuredCampaign) -> go.Figure:
    content = result.content
    figure = _bode(_axis_title(content.tests[0].estimate.frf), "coherence")
    for number, (test, row) in enumerate(_drive_points(content)):
        colour = PALETTE[number % len(PALETTE)]
        estimate, name = test.estimate, f"{test.condition.reference} ({test.condition.test})"
        values = np.abs(estimate.frf.values[:, row, 0])
        _add_line(figure, content.freq_hz, values, name, 1, colour)
        if estimate.coherence is not None:
            _add_line(figure, content.freq_hz, estimate.coherence[:, row, 0], name, 2, colour)
    title = f"drive points of {result.name}"
    if not figure.data:
        title = f"{result.name} has no drive point: no channel measured where the hammer hit"
    figure.update_layout(title=title)
    return figure


@plot.register
def _(result: ModelModes) -> go.Figure:
    return _mode_map(result.freq_hz, result.damping, "modes of the model")


@plot.register
def _(result: ExcitationResult) -> go.Figure:
    figure = make_subplots(rows=2, cols=1)
    plan, power = result.excitation.plan, result.excitation.power
    time_s, periods = np.arange(plan.samples) / plan.rate_hz, result.excitation.periods[0]
    for number, name in enumerate(result.drives):
        colour = PALETTE[number % len(PALETTE)]
        _add_line(figure, plan.freq_hz, np.sqrt(2 * power[:, number]), name, 1, colour)
        _add_line(figure, time_s, periods[number], name, 2, colour)
    figure.update_xaxes(title_text="frequency [Hz]", row=1, col=1)
    figure.update_xaxes(title_text="time [s]", row=2, col=1)
    figure.update_yaxes(title_text="amplitude", type="log", row=1, col=1)
    figure.update_yaxes(title_text="signal", row=2, col=1)
    return figure


@plot.register
def _(result: IdentifiedModel) -> go.Figure:
    return _mode_map(
        result.freq_hz,
        result.damping,
        f"modes of {result.campaign}",
        error_x={"array": 2 * result.model.freq_sd[: result.count]},
        error_y={"array": 200 * result.model.damping_sd[: result.count]},
    )


@plot.register
def _(result: TunedModel) -> go.Figure:
    comparison = result.fits.sensors
    tests = comparison.campaign.tests
    figure = _bode(_axis_title(tests[0].estimate.frf))
    for number, (test, row) in enumerate(_drive_points(comparison.campaign)):
        index = next(k for k, candidate in enumerate(tests) if candidate is test)
        curves = {
            "measured": test.estimate.frf.values,
            "nominal": comparison.as_drawn[index],
            "tuned": comparison.tuned[index],
        }
        for name, values in curves.items():
            _add_curve(
                figure,
                comparison.campaign.freq_hz,
                values[:, row, 0],
                f"{test.condition.reference} {name}",
                colour=COLOURS[name],
                visible=True if number == 0 else "legendonly",
            )
    figure.update_layout(title=f"drive points of {comparison.campaign.name}")
    return figure


@plot.register
def _(result: TunedPlant) -> go.Figure:
    bands, request = result.bands(), result.request
    low, high = bands.magnitude_interval()
    figure = _bode(f"{request.quantity} [SI units]")
    pairs = np.ndindex(len(request.outputs), len(request.inputs))
    for number, (row, column) in enumerate(islice(pairs, MAX_CURVES)):
        name = f"{request.outputs[row]} / {request.inputs[column]}"
        colour = PALETTE[number % len(PALETTE)]
        _add_curve(figure, request.freq_hz, bands.values[:, row, column], name, colour=colour)
        _add_band(figure, request.freq_hz, low[:, row, column], high[:, row, column], name, colour)
    figure.update_layout(title=f"plant of {result.posterior.model.machine.name}, 95 % bands")
    return figure


@plot.register
def _(result: ErrorBudgetResult) -> go.Figure:
    figure = go.Figure()
    budget = result.plant.budget
    freq, values = budget.cumulative()
    for number, error in enumerate(budget.definition.errors):
        unit, size = budget.definition.units[error.name]
        figure.add_scatter(x=freq, y=values[:, number] / size, name=f"{error.name} [{unit}]")
    figure.update_xaxes(type="log", title_text="frequency [Hz]")
    figure.update_yaxes(title_text="rms above the frequency")
    figure.update_layout(title="cumulative amplitude spectra")
    return figure


@plot.register
def _(result: MarginsResult) -> go.Figure:
    titles = ("loop gain", "Nyquist", "sensitivity")
    figure = make_subplots(cols=3, subplot_titles=titles)
    for number, loop in enumerate(result.loops):
        colour = PALETTE[number % len(PALETTE)]
        curves = (loop.gains, loop.sensitivity)
        drawn = (loop.sample_gains, 1 / (1 + loop.sample_gains))
        for column, values, samples in zip((1, 3), curves, drawn, strict=True):
            line = {"x": loop.freq_hz, "name": loop.loop, "line_color": colour}
            figure.add_scatter(**line, y=np.abs(values), row=1, col=column)
            if len(samples):  # 95 % of the machines of the posterior at each line
                for end in np.quantile(np.abs(samples), (0.025, 0.975), axis=0):
                    figure.add_scatter(**line, y=end, line_dash="dot", row=1, col=column)
            figure.update_xaxes(type="log", title_text="frequency [Hz]", row=1, col=column)
            figure.update_yaxes(type="log", row=1, col=column)
        plane = {"x": loop.gains.real, "y": loop.gains.imag, "line_color": colour}
        figure.add_scatter(**plane, name=loop.loop, row=1, col=2)
    figure.add_scatter(x=[-1.0], y=[0.0], mode="markers", name="-1", row=1, col=2)
    figure.update_xaxes(range=[-3, 3], row=1, col=2)
    figure.update_yaxes(range=[-3, 3], row=1, col=2)
    return figure


@plot.register
def _(result: SimulatedBudget) -> go.Figure:
    response, definition = result.response, result.simulated.definition
    titles = [*(f"loop {record.loop.name}" for record in response.loops), "errors"]
    figure = make_subplots(rows=len(titles), shared_xaxes=True, subplot_titles=titles)
    for row, record in enumerate(response.loops, start=1):
        curves = {"reference": record.reference, "measured": record.measured}
        for name, values in {**curves, "error": record.error}.items():
            figure.add_scatter(x=response.time_s, y=values, name=name, row=row, col=1)
    for number, error in enumerate(definition.errors):
        unit, size = definition.units[error.name]
        watched = np.zeros(0) if response.watched is None else response.watched[:, number] / size
        name = f"{error.name} [{unit}]"
        figure.add_scatter(x=response.time_s, y=watched, name=name, row=len(titles), col=1)
    figure.update_xaxes(title_text="time [s]", row=len(titles), col=1)
    return figure


@plot.register
def _(result: DiagnosisResult) -> go.Figure:
    verdict = result.verdict
    figure = make_subplots(
        cols=3, subplot_titles=("excess: gap / noise", "where [%]", "which cause [%]")
    )
    gap = verdict.gap
    steps = {"nominal": gap.as_drawn, "re-tuned": gap.retuned, "with the cause": gap.after}
    shown = {name: step.excess for name, step in steps.items() if step.excess is not None}
    figure.add_bar(x=list(shown), y=list(shown.values()), row=1, col=1)
    figure.add_hline(y=1.0, line_dash="dot", row=1, col=1)  # a perfect model
    figure.update_yaxes(type="log", row=1, col=1)
    where = [place for place in verdict.where if place.share is not None]
    figure.add_bar(
        x=[place.location for place in where],
        y=[100 * (place.share or 0.0) for place in where],
        row=1,
        col=2,
    )
    figure.add_bar(
        x=[f"{cause.effect}@{cause.location}" for cause in verdict.causes],
        y=[100 * cause.probability for cause in verdict.causes],
        row=1,
        col=3,
    )
    figure.update_traces(marker_color=PALETTE[0], width=MAX_BAR_WIDTH, selector={"type": "bar"})
    figure.update_layout(title=f"{result.campaign}: {result.sentence}", showlegend=False)
    return figure


@plot.register
def _(result: ComparisonResult) -> go.Figure:
    figure = go.Figure()
    modes = result.tests.modes
    numbers = list(range(1, len(modes) + 1))
    for place, name in enumerate(result.names):
        means = np.array([np.nanmean(mode.freq_hz) for mode in modes])
        freq_hz = np.array([mode.freq_hz[place] for mode in modes])
        deviation = np.array([mode.freq_sd[place] for mode in modes])
        figure.add_scatter(
            x=numbers,
            y=100 * (freq_hz / means - 1),
            error_y={"array": 200 * deviation / means},
            name=name,
            mode="markers",
        )
    figure.update_xaxes(title_text="mode", dtick=1)
    figure.update_yaxes(title_text="frequency from its mean [%]")
    figure.update_layout(title=result.sentence)
    return figure


def _axis_title(frf: Frf) -> str:
    """Return the quantity with its unit; rotations, moments and motors have units of their own."""
    labels = (*frf.outputs, *frf.inputs)
    is_plain = all(isinstance(label, Dof) and not label.is_rotation for label in labels)
    return f"{frf.quantity} [{UNITS[frf.quantity] if is_plain else 'SI units'}]"


def _bode(upper: str, lower: str = "phase [degrees]") -> go.Figure:
    figure = make_subplots(rows=2, shared_xaxes=True, row_heights=[0.65, 0.35])
    figure.update_yaxes(title_text=upper, type="log", exponentformat="power", row=1, col=1)
    figure.update_yaxes(title_text=lower, row=2, col=1)
    figure.update_xaxes(title_text="frequency [Hz]", row=2, col=1)
    return figure


def _add_curve(
    figure: go.Figure,
    freq_hz: Real,
    values: Complex,
    name: str,
    *,
    colour: str | None = None,
    visible: bool | str = True,
) -> None:
    style = {"color": colour} if colour else {}
    common = {"x": freq_hz, "name": name, "line": style, "visible": visible, "legendgroup": name}
    figure.add_scatter(y=np.abs(values), row=1, col=1, **common)
    figure.add_scatter(y=np.angle(values, deg=True), row=2, col=1, showlegend=False, **common)


def _add_line(  # one argument for each property of a line
    figure: go.Figure, freq_hz: Real, values: Real, name: str, row: int, colour: str
) -> None:
    figure.add_scatter(
        x=freq_hz,
        y=values,
        name=name,
        line={"color": colour},
        legendgroup=name,
        showlegend=row == 1,
        row=row,
        col=1,
    )


def _add_band(  # one argument for each property of a band
    figure: go.Figure, freq_hz: Real, low: Real, high: Real, name: str, colour: str
) -> None:
    common = {"line": {"width": 0}, "legendgroup": name, "showlegend": False, "hoverinfo": "skip"}
    figure.add_scatter(x=freq_hz, y=low, row=1, col=1, **common)
    shade = f"rgba({', '.join(str(int(colour[k : k + 2], 16)) for k in (1, 3, 5))}, 0.2)"
    figure.add_scatter(x=freq_hz, y=high, row=1, col=1, fill="tonexty", fillcolor=shade, **common)


def _mode_map(freq_hz: Real, damping: Real, title: str, **errors: dict[str, Real]) -> go.Figure:
    numbers = [str(number) for number in range(1, len(freq_hz) + 1)]
    figure = go.Figure()
    figure.add_scatter(x=freq_hz, y=100 * damping, text=numbers, mode="markers+text", **errors)
    figure.update_traces(textposition="top center")
    figure.update_layout(title=title, xaxis_title="frequency [Hz]", yaxis_title="damping ratio [%]")
    return figure


def _drive_points(campaign: Campaign) -> Iterator[tuple[Test, int]]:
    """Yield each test that measured where it was hit, with the rows of these channels."""
    for test in campaign.tests:
        for row in drive_point_rows(campaign.layout, test):
            yield test, row
