"""Sentences on sources that move no error, and on errors that drift without limit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from identification.words import Real
from tuning.plant.error_budget.budget import ErrorBudget, budget_on_lines
from tuning.plant.error_budget.definition import Source


@dataclass(frozen=True)
class RemarkLimits:
    """Limits.

    Args:
        rounding: of an error beside the sum of the sizes of its terms.
        share: of the mean square below which a source moves no error.
        drift: size of a pole over the band's lower end, below which it counts as one at 0 Hz.
        below: lines over the band's lower end where the slope of the response is taken.
        step: ratio of two lines where the slope of the density is taken.
        slope: power of frequency of the error's density below which its integral has no limit: -1,
            with a margin for the slope's error.
    """

    rounding: float = 1e-12
    share: float = 1e-16
    drift: float = 1e-3
    below: tuple[float, float] = (0.01, 0.1)
    step: float = 1.01
    slope: float = -0.9


REMARK_LIMITS = RemarkLimits()


def budget_sentences(budget: ErrorBudget) -> list[str]:
    """Return sentences on sources that move no error, and on poles at 0 Hz that sources drive."""
    return [*_idle_sources(budget), *_drifts(budget)]


def _idle_sources(budget: ErrorBudget) -> Iterator[str]:
    """Yield a sentence on each source that moves no error."""
    response, settings = budget.response, REMARK_LIMITS
    terms = np.abs(budget.ports.errors) @ np.abs(budget.linearised.values) @ np.abs(response.right)
    is_idle = (np.abs(response.errors) <= settings.rounding * terms).all(axis=(0, 1))
    is_idle |= (budget.source_shares < settings.share).all(axis=0)
    for number in np.flatnonzero(is_idle):
        name = budget.definition.sources[number].name
        if budget.weights[:, number].any():
            yield (
                f"{name} moves no error of this budget: check its point and direction, or remove "
                "it."
            )
        else:
            yield f"{name} is zero in the whole band: check its density and frequencies."


def _drifts(budget: ErrorBudget) -> Iterator[str]:
    r"""Yield a sentence on each error that poles at 0 Hz let grow without limit.

    With |E| ~ f^p and a density S ~ f^q below the band, the integral of |E|^2 S from 0 Hz has no
    limit where 2 p + q <= -1.
    """
    definition, low, settings = budget.definition, budget.definition.band[0], REMARK_LIMITS
    if not (np.abs(budget.states.poles()) < settings.drift * 2 * np.pi * low).any():
        return
    lines = low * np.array(settings.below)
    weights = np.ones((len(lines), len(definition.sources)))
    model, theta = budget.linearised.model, budget.linearised.theta
    below = budget_on_lines(model, theta, definition, (lines, weights, 2), budget.states)
    sizes = np.abs(below.response.errors)
    subject = "the closed loop" if definition.loops else "the machine"
    for row, error in enumerate(definition.errors):
        drivers = [
            source.name
            for column, source in enumerate(definition.sources)
            if _is_endless(source, lines, sizes[:, row, column], low)
        ]
        if drivers:
            yield (
                f"{error.name} depends on the lower end of the band, {low:.4g} Hz: "
                f"{', '.join(drivers)} drives a pole of {subject} at 0 Hz, so that the rms from "
                "0 Hz upwards has no limit."
            )


def _is_endless(source: Source, lines: Real, sizes: Real, low: float) -> bool:
    """Return whether the mean square of a source has no limit towards 0 Hz.

    Args:
        source: random or sines alone.
        lines: two below the band [Hz].
        sizes: of the response there.
        low: lower end of the band [Hz].
    """
    if source.spectrum is None or not (sizes > 0).all():
        return False
    first = max(low, source.spectrum.band[0]) * REMARK_LIMITS.step
    pair = np.array([first, first * REMARK_LIMITS.step])
    density = source.spectrum.at(pair, source.derivative)
    if not (density > 0).all():
        return False
    power = np.diff(np.log(sizes))[0] / np.diff(np.log(lines))[0]
    of_density = np.diff(np.log(density))[0] / np.diff(np.log(pair))[0]
    return bool(2 * power + of_density <= REMARK_LIMITS.slope)
