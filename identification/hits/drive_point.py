r"""Check of drive points: whether force and motion agree in sign.

A force feeds no negative power into a passive structure at its own point. The real part of the
drive-point mobility Y is therefore at least 0 on every line (Ewins 2000, ch. 2). This holds at
s = i w + 1/tau too, for data with an exponential window, since a drive-point mobility is a positive
real function of ``s``. The power share over lines,

    sum c |c| / sum c^2,    c = Re Y / |Y|,

is then 1, or -1 if the sign of sensor or hammer is reversed. Only lines with an FRF five standard
deviations above its noise count, and for time records only those below 0.8 of half the sampling
rate. Away from resonances motion and force are almost in quadrature, and a small error changes the
sign of Re Y. Lines whose power is within three standard deviations of its noise, or no more than a
small phase error of a channel gives, therefore do not count; below or above all modes of a machine
there may be no others.
"""

from dataclasses import dataclass, replace

import numpy as np

from identification.hits.negative_power import (
    DrivePointMobility,
    explain_negative_power,
    power_share,
)
from identification.words import (
    DERIVATIVE_ORDER,
    Campaign,
    Dof,
    Layout,
    Signal,
    Test,
    node_number,
)

MIN_POWER_TO_VARIANCE = 25.0  # |H|^2 over its variance
_MIN_SIGN_SHARE = 0.5  # power share beyond which the sign is clear
_MIN_PASSIVE_SHARE = 0.8  # power share below which another reason is sought
_MIN_STAND_IN_SHARE = 0.95  # power share of another channel that may be the drive point
_MIN_AXIS_COSINE = 0.9  # of two axes that are meant to coincide
_MIN_SIGN_LINES = 8  # lines for a power share
_MIN_POWER_TO_DEVIATION = 3.0  # |Re Y| over its standard deviation, for a line with a sign
_MIN_POWER_FACTOR = 0.1  # |Re Y| / |Y| of such a line: channels agree in phase within 6 degrees


@dataclass(frozen=True)
class DrivePoint:
    """Drive point of a test and the sign of its power.

    Args:
        test: name of the file.
        output: channel of the sensor.
        reference: reference of the hammer, at the node and along the axis of the channel.
        share: power share from -1 to 1; it must be 1 for a passive structure.
        stand_in: channel at another node that behaves as a drive point, if this one does not.
        reason: what else than a reversed direction makes the power negative, with its remedy.
    """

    test: str
    output: Dof
    reference: Dof
    share: float
    stand_in: Dof | None = None
    reason: str | None = None

    @property
    def remark(self) -> str | None:
        """Sentence on what is wrong with the drive point, or None."""
        if self.reason is not None:
            return f"{self.test}: {self.reason}"
        if self.share > _MIN_SIGN_SHARE:
            return None
        if self.share < -_MIN_SIGN_SHARE:
            return (
                f"{self.test}: the drive point {self.output} reads with the opposite sign of the "
                f"hammer at {self.reference}: check both directions; no sign was changed"
                + self._stand_in_hint
            )
        return (
            f"{self.test}: at the drive point {self.output} the power of the hammer at "
            f"{self.reference} has no clear sign: check that both are at one point, "
            "and that directions of the hammer are not exchanged" + self._stand_in_hint
        )

    @property
    def _stand_in_hint(self) -> str:
        """Part of a sentence that names the stand-in, or nothing."""
        if self.stand_in is None:
            return ""
        return f"; {self.stand_in} behaves as a drive point does: were the two exchanged?"


def drive_point_signs(campaign: Campaign) -> tuple[DrivePoint, ...]:
    """Check every drive point of a campaign, from time records or from FRFs.

    A drive point is a channel at the node of the reference along the axis of the hammer, according
    to the layout. Drive points with too few lines above the noise are left out.
    """
    points = []
    for test in campaign.tests:
        reference = test.condition.reference
        if isinstance(reference, Signal):  # a control signal has neither place nor direction
            continue
        for row, output in enumerate(test.estimate.frf.outputs):
            cosine = _drive_point_cosine(campaign.layout, test, row)
            if cosine is None or isinstance(output, Signal):
                continue
            share = _power_share(test, row)
            if share is not None:
                share *= float(np.sign(cosine))
                is_wrong = share < _MIN_SIGN_SHARE
                is_doubtful = share < _MIN_PASSIVE_SHARE
                stand_in = _find_stand_in(campaign, test, output) if is_wrong else None
                reason = _explain(test, row, float(np.sign(cosine))) if is_doubtful else None
                points.append(
                    DrivePoint(test.condition.test, output, reference, share, stand_in, reason)
                )
    return tuple(points)


def drive_point_rows(layout: Layout, test: Test) -> list[int]:
    """Return the rows of a test that were measured where the hammer hit, along its axis."""
    rows = range(len(test.estimate.frf.outputs))
    return [row for row in rows if _drive_point_cosine(layout, test, row) is not None]


def _drive_point_cosine(layout: Layout, test: Test, row: int) -> float | None:
    """Return the cosine of a channel's axis and the hammer's at one node; None elsewhere."""
    output, reference = test.estimate.frf.outputs[row], test.condition.reference
    if isinstance(output, Signal) or isinstance(reference, Signal):
        return None
    cosine = axis_cosine(layout, output, reference)
    is_driven = cosine is not None and abs(cosine) >= _MIN_AXIS_COSINE
    return cosine if is_driven and test.estimate.measured[row, 0] else None


def _find_stand_in(campaign: Campaign, test: Test, output: Dof) -> Dof | None:
    """Find a channel at another point, for this reference, whose power is positive throughout."""
    shares: dict[Dof, float] = {}
    for candidate in campaign.tests:
        if candidate.condition.reference != test.condition.reference:
            continue
        for row, dof in enumerate(candidate.estimate.frf.outputs):
            if isinstance(dof, Signal):
                continue
            share = _power_share(candidate, row) if dof.point != output.point else None
            if share is not None and dof.direction[1:] == output.direction[1:]:
                shares[dof] = share
    best = max(shares, key=lambda dof: shares[dof], default=None)
    return best if best is not None and shares[best] > _MIN_STAND_IN_SHARE else None


def _power_share(test: Test, row: int) -> float | None:
    """Return the power share of a channel, or None if too few lines have a clear power."""
    point = _mobility(test, row)
    clear = np.maximum(
        _MIN_POWER_TO_DEVIATION * point.deviation, _MIN_POWER_FACTOR * np.abs(point.values)
    )
    mobility = point.values[np.abs(point.values.real) > clear]
    return power_share(mobility) if len(mobility) >= _MIN_SIGN_LINES else None


def _explain(test: Test, row: int, sign: float) -> str | None:
    """Return another reason for negative power than a reversed direction, or None."""
    point = _mobility(test, row)
    output, reference = test.estimate.frf.outputs[row], test.condition.reference
    place = f"the drive point {output} with the hammer at {reference}"
    return explain_negative_power(replace(point, values=sign * point.values), place)


def axis_cosine(layout: Layout, output: Dof, reference: Dof) -> float | None:
    """Return the cosine between the axes of channel and hammer, or None at different nodes."""
    if output.is_rotation != reference.is_rotation:
        return None
    if output.point != reference.point:
        node = node_number(output.point)
        if node is None or node != node_number(reference.point):
            return None
    if not {output.point, reference.point} <= set(layout.points):
        return None
    channel_axis, hammer_axis = (
        dof.sign * layout.axes[layout.points.index(dof.point)][:, dof.axis % 3]
        for dof in (output, reference)
    )
    return float(channel_axis @ hammer_axis)


def _mobility(test: Test, row: int) -> DrivePointMobility:
    """Return the mobility of a channel on the lines above 0 Hz and above the noise."""
    estimate = test.estimate
    freq, quantity = estimate.frf.freq_hz, estimate.frf.quantity
    values, variance = estimate.frf.values[:, row, 0], estimate.variance[:, row, 0]
    good = (freq > 0) & (np.abs(values) ** 2 > MIN_POWER_TO_VARIANCE * variance)
    if test.hits is not None:
        good &= freq < test.hits.usable_limit_hz
    decay = 1.0 / estimate.window_tau if estimate.window_tau else 0.0
    laplace = np.asarray(decay + 2j * np.pi * freq[good], np.complex128)
    factor = laplace ** (1 - DERIVATIVE_ORDER[quantity])
    mobility = np.asarray(values[good] * factor, np.complex128)
    deviation = np.sqrt(variance[good] / 2) * np.abs(factor)  # variance: real plus imaginary part
    channels = np.asarray(estimate.frf.values[good][:, :, 0] * factor[:, None], np.complex128)
    return DrivePointMobility(freq[good], laplace, mobility, quantity, deviation, channels)
