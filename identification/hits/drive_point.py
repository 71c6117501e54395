r"""Whether force and motion of a drive point agree in sign.

The power that a force feeds into a passive structure at its own point is not negative: the real
part of the mobility there is at least 0, on every line (Ewins 2000, ch. 2). With an exponential
window in the data it is so at s = i w + 1/tau as well, since a drive-point mobility is a positive
real function of s. The share

    sum c |c| / sum c^2,    c = Re Y / |Y|

over lines is then 1, or -1 where sensor or hammer have their sign reversed. Lines beside the
resonances, where the motion is all but a quarter turn from the force and a small error turns the
sign, hardly count. Only lines count whose FRF is five standard deviations above its noise, of
time records only below 0.8 of half the rate.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import ORDER, Campaign, Dof, Layout, Real, Test, node_of

_ABOVE = 25.0  # |H|^2 over its variance
_CLEAR = 0.5  # share beyond which there is a sign
_POSITIVE = 0.95  # share of a channel that may be the drive point
_ALONG = 0.9  # cosine of two axes that are meant to be one
_LEAST = 8  # lines


@dataclass(frozen=True)
class DrivePoint:
    """The sign of a drive point.

    Args:
        test: the file.
        output: the sensor's channel.
        reference: the hammer's, at the same node along the same line.
        share: from -1 to 1, 1 where the power is positive on every line as it must be.
        stand_in: where that is wrong, a channel at another node that behaves as this one should.
    """

    test: str
    output: Dof
    reference: Dof
    share: float
    stand_in: Dof | None = None

    @property
    def remark(self) -> str | None:
        """What is wrong with it, or None."""
        if self.share > _CLEAR:
            return None
        if self.share < -_CLEAR:
            return (
                f"{self.test}: the drive point {self.output} reads with the opposite sign of the "
                f"hammer at {self.reference}: check both directions; nothing was turned"
                + self._exchanged
            )
        return (
            f"{self.test}: at the drive point {self.output} the power of the hammer at "
            f"{self.reference} has no sign: check that both are at one place" + self._exchanged
        )

    @property
    def _exchanged(self) -> str:
        if self.stand_in is None:
            return ""
        return f"; {self.stand_in} behaves as a drive point does: were the two exchanged?"


def drive_point_signs(campaign: Campaign) -> tuple[DrivePoint, ...]:
    """Check every drive point of a campaign, whether from time records or from FRFs.

    A drive point is a channel at the node of the reference whose axis is the hammer's, as the
    layout has both. One without lines above the noise is left out.
    """
    found = []
    for test in campaign.tests:
        for row, output in enumerate(test.estimate.frf.outputs):
            cosine = _cosine(campaign.layout, output, test.condition.reference)
            if cosine is None or abs(cosine) < _ALONG or not test.estimate.measured[row, 0]:
                continue
            share = _share(test, row)
            if share is not None:
                share *= float(np.sign(cosine))
                other = _stand_in(campaign, test, output) if share < _CLEAR else None
                found.append(
                    DrivePoint(test.condition.test, output, test.condition.reference, share, other)
                )
    return tuple(found)


def _stand_in(campaign: Campaign, test: Test, output: Dof) -> Dof | None:
    """Another channel of the same hammer point and line whose power is positive throughout."""
    found: dict[Dof, float] = {}
    for other in campaign.tests:
        if other.condition.reference != test.condition.reference:
            continue
        for row, dof in enumerate(other.estimate.frf.outputs):
            share = _share(other, row) if dof.point != output.point else None
            if share is not None and dof.direction[1:] == output.direction[1:]:
                found[dof] = share
    best = max(found, key=lambda dof: found[dof], default=None)
    return best if best is not None and found[best] > _POSITIVE else None


def _share(test: Test, row: int) -> float | None:
    """How positive the power of a channel along the hammer is, None without enough lines."""
    power = _power(test, row)
    if len(power) < _LEAST or not power.any():
        return None
    return float((power * np.abs(power)).sum() / (power**2).sum())


def _cosine(layout: Layout, output: Dof, reference: Dof) -> float | None:
    """Of the angle between channel and hammer, or None where they are not at one node."""
    if output.is_rotation != reference.is_rotation:
        return None
    if output.point != reference.point:
        node = node_of(output.point)
        if node is None or node != node_of(reference.point):
            return None
    if not {output.point, reference.point} <= set(layout.points):
        return None
    one, other = (
        dof.sign * layout.axes[layout.points.index(dof.point)][:, dof.axis % 3]
        for dof in (output, reference)
    )
    return float(one @ other)


def _power(test: Test, row: int) -> Real:
    """Re Y / |Y| on the lines above 0 Hz and above the noise; (n_line,)."""
    estimate = test.estimate
    freq = estimate.frf.freq_hz
    values, variance = estimate.frf.values[:, row, 0], estimate.variance[:, row, 0]
    good = (freq > 0) & (np.abs(values) ** 2 > _ABOVE * variance)
    if test.hits is not None:
        good &= freq < test.hits.highest_hz
    decay = 1.0 / estimate.window_tau if estimate.window_tau else 0.0
    laplace = decay + 2j * np.pi * freq[good]
    mobility = values[good] * laplace ** (1 - ORDER[estimate.frf.quantity])
    power: Real = mobility.real / np.abs(mobility)
    return power
