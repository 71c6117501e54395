r"""Standard deviations of predicted FRFs.

With the covariance C of the coordinates and the slopes J of an FRF, its error along a direction u
of the complex plane, |u| = 1, has the variance

    var Re(conj(u) H) = a' C a,   a = Re(conj(u) J):

u = 1 and u = i give those of the real and imaginary part, u = H / |H| that of the magnitude.
"""

from collections.abc import Sequence

import numpy as np

from identification.words import Campaign, Complex, Real
from mbmodel import Linearised, Model
from tuning.assessment.parameter_confidence import Confidence
from tuning.misfit.batch import answers, predict
from tuning.misfit.partition import shares

_RUN = 16  # lines at once
_LINES = 300


def deviations(lines: Linearised, sure: Confidence, ways: Sequence[Complex]) -> list[Real]:
    """Standard deviations of everything that a linearised model answers, along some directions.

    Args:
        lines: the model at the parameters that ``sure`` is about.
        sure: their covariance.
        ways: u, one array for each direction; (n_freq, n_out, n_in).

    Returns:
        One array for each direction; (n_freq, n_out, n_in).
    """
    freedom, covariance = sure.freedom, sure.covariance
    plan = shares(lines.model, freedom)
    rates = freedom.rates(sure.x)
    forward = lines.forward(plan.shared, rates)
    own = list(plan.own_columns(lines.forward(plan.of_sensors), rates))
    whole = covariance[np.ix_(plan.shared_at, plan.shared_at)]
    found = [np.zeros(lines.values.shape) for _ in ways]
    for start in range(0, len(lines.values), _RUN):
        span = slice(start, start + _RUN)
        columns = plan.gather(forward, span)
        for total, way in zip(found, ways, strict=True):
            a = _along(way[span], columns)
            variance = np.einsum("foms,foms->fom", a @ whole, a)
            for rows, values, at in own:
                b = _along(way[span][:, rows], values[span])
                between = covariance[np.ix_(plan.shared_at, at)]
                inside = covariance[np.ix_(at, at)]
                more = 2 * (a[:, rows] @ between) + b @ inside
                variance[:, rows] += np.einsum("fomk,fomk->fom", more, b)
            total[span] = np.sqrt(np.maximum(variance, 0.0))
    return found


def _along(way: Complex, columns: Complex) -> Real:
    """Re(conj(u) J)."""
    part: Real = way.real[..., None] * columns.real + way.imag[..., None] * columns.imag
    return part


def magnitude_deviations(model: Model, sure: Confidence, campaign: Campaign) -> tuple[Real, ...]:
    """Deviation of the magnitude of each test's FRFs, in its labels; (n_freq, n_out, 1) each.

    At some 300 lines; between them the relative deviation is interpolated.
    """
    freq, theta = campaign.freq_hz, sure.freedom.theta(sure.x)
    every = -(-len(freq) // _LINES)
    places = np.unique(np.append(np.arange(0, len(freq), every), len(freq) - 1))

    def ask(lines: Linearised) -> Complex:
        size = np.maximum(np.abs(lines.values), np.finfo(float).tiny)
        return np.asarray(deviations(lines, sure, [lines.values / size])[0] / size, complex)

    found = answers(model, campaign.lines(places), ask, theta)
    between = np.interp(freq, freq[places], np.arange(len(places)))
    low = np.floor(between).astype(int)
    high, share = np.minimum(low + 1, len(places) - 1), (between - low)[:, None, None]
    return tuple(
        np.abs(values) * ((1 - share) * relative.real[low] + share * relative.real[high])
        for values, relative in zip(predict(model, theta, campaign), found, strict=True)
    )
