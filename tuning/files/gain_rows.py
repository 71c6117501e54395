"""Rows of results on gains that a campaign called unknown."""

from collections.abc import Sequence

from identification.words import NominalGain, Real
from tuning.files.schema import ChannelGainRow
from tuning.parametrisation.parametrisation import Parametrisation


def channel_gain_rows(
    nominal: Sequence[NominalGain],
    parametrisation: Parametrisation,
    theta: Real,
    interval: tuple[Real, Real] | None,
) -> list[ChannelGainRow]:
    """Return one row for each gain: its nominal value times the fitted factor.

    Args:
        nominal: gains by which the FRFs were divided.
        parametrisation: parametrisation of the fit.
        theta: fitted parameters [SI]; (n_parameter,).
        interval: both ends of their 95 % intervals; None if unknown.
    """
    index = {parameter.name: k for k, parameter in enumerate(parametrisation.parameters)}
    rows = []
    for gain in nominal:
        k, late = index[gain.parameter], index.get(gain.delay_parameter)
        ends = None
        if interval is not None and parametrisation.free[k]:
            low, high = sorted(gain.value * float(end[k]) for end in interval)
            ends = low, high
        rows.append(
            ChannelGainRow(
                location=gain.location,
                dof=gain.direction,
                gain=gain.value * float(theta[k]),
                interval=ends,
                is_product=gain.is_product,
                delay=None if late is None else gain.delay_s + float(theta[late]),
            )
        )
    return rows
