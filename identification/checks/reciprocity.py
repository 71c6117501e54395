r"""Reciprocity H_ij = H_ji before any model: ratios of gains, delays, exchanges and signs.

In a passive machine without a rotor the motion at reference i per force at reference j is that at j
per force at i (Ewins 2000, ch. 1). Channels with factors c_i and hits with factors q_j read
c_i q_j G_ij instead, so that

    H_ij / H_ji = k_i / k_j,   k_i = c_i / q_i = exp(g_i - i w d_i),

and only ratios of k show: a common gain or delay stays silent, and a gain of the channel at a
reference cannot be told from that of the hits there. Motion at a reference is that of the channel
along it, or is carried there from the channels of its body as of a rigid one.

ln k follows by least squares from ln(H_ij / H_ji) on all lines and pairs. A line weighs by the
noise of both FRFs and by what breaks reciprocity beside k, such as cross-talk and hits beside their
point, of size e |G_ii G_jj|^(1/2); e makes the mean square 1. These errors are alike on
neighbouring lines, so that deviations come from the jackknife over blocks of lines.

Hits in several directions at one point may be tilted against the axes of the sensor there. A force
along j then has parts along the others, H_ij + sum_k H_ik E_kj, which feigns gains; a machine of as
few modes as directions cannot even tell both apart. Of such tests only exchanges and signs count.

Of a machine that was tested before a change, too, both tests share what breaks reciprocity beside k
in dynamic stiffness, and a change of a passive machine is symmetric. With Z = H^-1 of both,

    H -> (Z - (Z_before - Z_before') / 2)^-1,

k is then that of the change alone. It counts if it leaves a smaller e.

Two exchanged channels make H reciprocal when they are put back. So do two exchanged hits: which of
the two happened, only a model or the labels can tell. The same holds for a sign. A passive machine
takes up power at every drive point, so that Re H_ii > 0 of mobilities; an exchange or signs that
leave drive points from which power comes, summed over all lines, are no repair.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from identification.checks.reciprocity_findings import BLOCKS, ChannelRatio, Reciprocity
from identification.hits.drive_point import MIN_POWER_TO_VARIANCE, axis_cosine
from identification.words import (
    DERIVATIVE_ORDER,
    Campaign,
    Complex,
    Dof,
    Integers,
    Layout,
    Real,
    Test,
    first_by_key,
)

_MIN_CHANNEL_COSINE = 0.99  # of a channel that stands for the motion along a reference
# Of rows in translations and rotations over the arm: below, channels do not determine a motion.
_MIN_CARRIED_VALUE = 1e-6
_MAX_UNREAD = 1e-6  # part of a reference's row that the channels of its body do not determine
_MAX_REFERENCES = 12
_MIN_RATIO_LINES = 10 * BLOCKS
_ITERATIONS, _MAX_CHANGE = 20, 0.01  # for the size of what breaks reciprocity
_NOISY_EXCESS = 1.5  # below, reciprocity holds to the noise, and nothing can be exchanged
_MAX_VALUES = 100_000  # ratios of a fit: of more, every so many-th line counts
# Factor by which an exchange must reduce what breaks reciprocity. With as many independent blocks
# as there are, the logarithm of the likelihood then rises by 12 ln 2 = 8.
_MIN_EXCHANGE_GAIN = 2.0
_MAX_UNRECIPROCAL = 0.3  # over the motion of the drive points: 1 is that of unrelated FRFs


@dataclass(frozen=True)
class _Reading:
    """Channel or channels that read the motion along a reference.

    Args:
        reference: its label.
        channel: label of the channel along it, or the sensors of its body.
        weights: of the channels, whose sum is the motion.
    """

    reference: str
    channel: str
    weights: dict[Dof, float]


@dataclass(frozen=True, eq=False)
class _Square:
    """FRFs between references: motion along each per force along each.

    Args:
        laplace: i w; (n_freq,).
        values: H; (n_freq, n, n).
        variance: of H; (n_freq, n, n).
        order: derivatives of the displacement that H reads.
    """

    laplace: Complex
    values: Complex
    variance: Real
    order: int

    def exchange(self, first: int, second: int) -> "_Square":
        """Return it with the channels of two references exchanged."""
        order = np.arange(self.values.shape[1])
        order[[first, second]] = second, first
        return replace(self, values=self.values[:, order], variance=self.variance[:, order])

    def takes_up_power(self, signs: Real) -> bool:
        """Return whether all drive points take up power, up to one sign common to all channels."""
        moving = self.laplace[self.laplace != 0]
        drive = np.einsum("fii->fi", self.values)[self.laplace != 0]
        power = (drive * moving[:, None] ** (1 - self.order)).real.sum(axis=0) * signs
        return bool((power > 0).all() or (power < 0).all())

    def compare(self, before: "_Square") -> "_Square | None":
        """Return it without what broke reciprocity before; None if a matrix is singular."""
        try:
            stiffness = np.linalg.inv(before.values)
            broken = (stiffness - stiffness.swapaxes(1, 2)) / 2
            values = np.asarray(np.linalg.inv(np.linalg.inv(self.values) - broken), np.complex128)
        except np.linalg.LinAlgError:
            return None
        row_power = np.abs(self.values @ stiffness) ** 2
        column_power = np.abs(stiffness @ self.values) ** 2
        variance = self.variance + row_power @ before.variance @ column_power
        return replace(self, values=values, variance=variance)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Fit of ln k.

    Args:
        signs: of k, relative to the first reference; (n,).
        logarithms: g and d [s], each less its median; (2, n).
        deviations: their standard deviations; (2, n).
        error: e.
        excess: residual over the noise.
    """

    signs: Real
    logarithms: Real
    deviations: Real
    error: float
    excess: float


def check_reciprocity(
    campaign: Campaign, doubt: str = "", before: Campaign | None = None
) -> Reciprocity | None:
    """Compare H_ij with H_ji between all references whose motion is read.

    Args:
        campaign: tests of one machine; of several tests at a reference the first counts.
        doubt: why reciprocity need not hold, such as a loop that was closed.
        before: tests of the machine before a change; None to compare nothing.

    Returns:
        The ratios; None with fewer than two such references, with too few lines above the noise,
        or if reciprocity does not hold at all.
    """
    measured = _read_square(campaign)
    if measured is None:
        return None
    readings, square = measured
    exchanged: tuple[int, ...] = ()
    earlier = None if before is None else _find_comparable(campaign, readings, before)
    fit = _fit_best(square, earlier)
    if fit is None:
        return None
    is_suspect = len(readings) > 2 and fit.excess > _NOISY_EXCESS
    for pair in combinations(range(len(readings)), 2) if is_suspect else ():
        trial = square.exchange(*pair)
        repaired = _fit_best(trial, earlier)
        if repaired is None or not trial.takes_up_power(repaired.signs):
            continue
        if _MIN_EXCHANGE_GAIN * repaired.error < fit.error:
            fit, exchanged = repaired, pair
    if fit.error > _MAX_UNRECIPROCAL:
        return None
    gains = fit.signs * np.exp(fit.logarithms[0])
    numbers = gains, np.abs(gains) * fit.deviations[0], fit.logarithms[1], fit.deviations[1]
    rows = (
        ChannelRatio(reading.reference, reading.channel, *(float(value) for value in values))
        for reading, *values in zip(readings, *numbers, strict=True)
    )
    points = {Dof.parse(reading.reference).point for reading in readings}
    return Reciprocity(
        tuple(rows),
        fit.error,
        fit.excess,
        exchanged,
        doubt or _doubt(campaign),
        may_tilt=len(points) < len(readings),
    )


def _read_square(campaign: Campaign) -> tuple[list[_Reading], _Square] | None:
    """Return what reads the motion along each reference, and the FRFs between references."""
    cells = first_by_key(
        ((output.positive, test.condition.reference.positive), (test, row))
        for test in campaign.tests
        if not test.condition.variant and isinstance(test.condition.reference, Dof)
        for row, output in enumerate(test.estimate.frf.outputs)
        if isinstance(output, Dof) and test.estimate.measured[row, 0]
    )
    references = list(dict.fromkeys(reference for _, reference in cells))
    channels = [
        channel
        for channel in dict.fromkeys(channel for channel, _ in cells)
        if all((channel, reference) in cells for reference in references)
    ]
    candidates = (_find_reading(campaign.layout, reference, channels) for reference in references)
    readings = sorted(filter(None, candidates), key=lambda reading: len(reading.weights))
    if len(readings) < 2:
        return None
    readings = readings[:_MAX_REFERENCES]
    weights = np.array([[each.weights.get(dof, 0.0) for dof in channels] for each in readings])
    forces = [Dof.parse(reading.reference) for reading in readings]
    chosen = [[cells[channel, force] for force in forces] for channel in channels]
    values = np.array([[_along_positive(*cell) for cell in line] for line in chosen])
    noise = np.array([[t.estimate.variance[:, row, 0] for t, row in line] for line in chosen])
    lines = slice(None, None, 1 + len(campaign.freq_hz) * len(forces) ** 2 // _MAX_VALUES)
    square = _Square(
        np.asarray(2j * np.pi * campaign.freq_hz[lines], np.complex128),
        np.einsum("io,ojf->fij", weights, values[:, :, lines]),
        np.einsum("io,ojf->fij", weights**2, noise[:, :, lines]),
        DERIVATIVE_ORDER[campaign.tests[0].estimate.frf.quantity],
    )
    return readings, square


def _find_comparable(
    campaign: Campaign, readings: list[_Reading], before: Campaign
) -> _Square | None:
    """Return the FRFs before a change; None if references, lines or quantity differ."""
    measured = _read_square(before)
    quantities = {test.estimate.frf.quantity for each in (campaign, before) for test in each.tests}
    is_alike = len(quantities) == 1 and np.array_equal(campaign.freq_hz, before.freq_hz)
    if measured is None or not is_alike or measured[0] != readings:
        return None
    return measured[1]


def _fit_best(square: _Square, before: _Square | None) -> _Fit | None:
    """Return the fit that leaves least, of the FRFs and of what changed; None without one."""
    compared = None if before is None else square.compare(before)
    fits = [_fit(each) for each in (square, compared) if each is not None]
    return min(filter(None, fits), key=lambda fit: fit.error, default=None)


def _along_positive(test: Test, row: int) -> Complex:
    """Return an FRF along the positive directions of channel and reference."""
    frf = test.estimate.frf
    return frf.outputs[row].sign * frf.inputs[0].sign * frf.values[:, row, 0]


def _find_reading(layout: Layout, reference: Dof, channels: list[Dof]) -> _Reading | None:
    """Return what reads the motion along a reference: a channel, or those of its body."""
    for channel in channels:
        cosine = axis_cosine(layout, channel, reference)
        if cosine is not None and abs(cosine) > _MIN_CHANNEL_COSINE:
            return _Reading(str(reference), str(channel), {channel: float(np.sign(cosine))})
    if reference.point not in layout.points:
        return None
    body = layout.body_name(reference.point)
    siblings = [dof for dof in channels if layout.owner_name(dof) == body]
    if not siblings:
        return None
    start = 6 * layout.bodies.index(body)
    rows = layout.rows([*siblings, reference])[:, start : start + 6]
    arm = float(np.sqrt((rows[:, 3:] ** 2).sum(axis=1).mean())) or 1.0
    rows = rows / np.array([1, 1, 1, arm, arm, arm])
    weights = rows[-1] @ np.linalg.pinv(rows[:-1], rcond=_MIN_CARRIED_VALUE)
    if np.linalg.norm(weights @ rows[:-1] - rows[-1]) > _MAX_UNREAD * np.linalg.norm(rows[-1]):
        return None
    name = f"the sensors of {body}"
    return _Reading(str(reference), name, dict(zip(siblings, weights.tolist(), strict=True)))


def _fit(square: _Square) -> _Fit | None:
    """Fit ln k; None with too few lines above the noise."""
    count = square.values.shape[1]
    rows, columns = np.triu_indices(count, 1)
    first, second = square.values[:, rows, columns], square.values[:, columns, rows]
    noise = [square.variance[:, rows, columns], square.variance[:, columns, rows]]
    good = np.abs(first) ** 2 > MIN_POWER_TO_VARIANCE * noise[0]
    good &= np.abs(second) ** 2 > MIN_POWER_TO_VARIANCE * noise[1]
    good &= (square.laplace.imag > 0)[:, None]
    if (good.sum(axis=0) < _MIN_RATIO_LINES).any():
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(good, first / second, 1.0)
        inverse = (
            np.where(good, np.abs(first) ** -2.0, 0.0),
            np.where(good, np.abs(second) ** -2.0, 0.0),
        )
    drive = np.abs(square.values[:, range(count), range(count)])
    noisy = (noise[0] * inverse[0] + noise[1] * inverse[1]) / 2  # variance of Re and Im of ln ratio
    broken = drive[:, rows] * drive[:, columns] * (inverse[0] + inverse[1]) / 2
    signs = _signs(ratio, rows, columns, count)
    logarithm = np.log(ratio * (signs[rows] * signs[columns]))
    incidence = np.zeros((len(rows), count))
    incidence[range(len(rows)), rows], incidence[range(len(rows)), columns] = 1.0, -1.0
    omega = square.laplace.imag[:, None]
    size = float(np.median(np.abs(logarithm[good]) ** 2 / broken[good]))
    for _ in range(_ITERATIONS):
        weight = np.where(good, 1 / np.where(good, noisy + size * broken, 1.0), 0.0)
        fitted = _solve(_blocks(weight, logarithm, omega, incidence), np.ones(BLOCKS))
        rest = logarithm - _model(fitted, omega, incidence)
        change = float((weight * np.abs(rest) ** 2).sum() / (2 * good.sum()))
        size *= change
        if abs(change - 1) < _MAX_CHANGE:
            break
    sums = _blocks(weight, logarithm, omega, incidence)
    without = np.array([_solve(sums, mask) for mask in 1.0 - np.eye(BLOCKS)])
    spread = ((without - without.mean(axis=0)) ** 2).sum(axis=0) * (BLOCKS - 1) / BLOCKS
    excess = np.sqrt((np.abs(rest[good]) ** 2 / noisy[good]).mean() / 2)
    return _Fit(signs, fitted, np.sqrt(spread), float(np.sqrt(size)), float(excess))


def _signs(ratio: Complex, rows: Integers, columns: Integers, count: int) -> Real:
    """Return the signs of k, of which most are positive; (n,)."""
    table = np.zeros((count, count))
    table[rows, columns] = table[columns, rows] = (ratio.real / np.abs(ratio)).mean(axis=0)
    signs = np.sign(np.linalg.eigh(table)[1][:, -1])
    signs[signs == 0] = 1.0
    return np.asarray(signs if signs.sum() >= 0 else -signs, float)


def _model(fitted: Real, omega: Real, incidence: Real) -> Complex:
    """Return ln(H_ij / H_ji) of the fit; (n_freq, n_pair)."""
    gains, delays = fitted @ incidence.T
    return gains - 1j * omega * delays


def _blocks(weight: Real, logarithm: Complex, omega: Real, incidence: Real) -> tuple[Real, Real]:
    """Return the normal equations of g and d over blocks of equally many ratios.

    Returns:
        Matrices (n_block, 2, n, n) and right-hand sides (n_block, 2, n).
    """
    total = np.cumsum((weight > 0).sum(axis=1))
    edges = np.searchsorted(total, total[-1] * np.arange(BLOCKS) / BLOCKS)
    weights = np.stack([weight, weight * omega**2], axis=1)
    weighted = np.stack([weight * logarithm.real, -weight * omega * logarithm.imag], axis=1)
    weights, weighted = (np.add.reduceat(each, edges, axis=0) for each in (weights, weighted))
    return np.einsum("bkp,pi,pj->bkij", weights, incidence, incidence), weighted @ incidence


def _solve(sums: tuple[Real, Real], kept: Real) -> Real:
    """Return g and d of some blocks, less their medians, or the first of two; (2, n)."""
    matrices, right = (np.tensordot(kept, each, axes=1) for each in sums)
    solved = np.array(
        [np.linalg.pinv(m, hermitian=True) @ r for m, r in zip(matrices, right, strict=True)]
    )
    usual = np.median(solved, axis=1) if solved.shape[1] > 2 else solved[:, 0]
    return solved - usual[:, None]


def _doubt(campaign: Campaign) -> str:
    """Return why reciprocity need not hold; empty if it does."""
    conditions = [test.condition for test in campaign.tests if not test.condition.variant]
    if any(condition.spindle_speed for condition in conditions):
        return "a spinning rotor breaks reciprocity"
    if len({condition.level_n for condition in conditions}) > 1:
        return "the tests have several levels"
    return ""
