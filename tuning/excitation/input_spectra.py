r"""D-optimal power of input signals over frequency lines, under limits on rms values.

The power v_i of each line and drive adds to the information of the coordinates x,

    M(v) = P + sum_i v_i X_i' (1 + v_i R_i)^-1 X_i,    C = M^-1,

with P the precision of the priors and R_i diagonal: the variance of an FRF is that of the noise,
which falls with the power, and a relative error, which does not. The criterion is the log
determinant of the covariance of the coordinates k of interest, with all others estimated too,

    F(v) = -ln det C_kk,    g_i = dF/dv_i = |(1 + v_i R_i)^-1 X_i C_.k L|^2,    L L' = C_kk^-1

(Bayesian D_s-optimality: Chaloner and Verdinelli 1995). F is concave. Each limit c bounds a sum of
powers, sum_i A_ci v_i <= 1. At the optimum g_i <= (A' m)_i with multipliers m >= 0, and equality
where v_i > 0 (general equivalence theorem: Kiefer and Wolfowitz 1960; Fedorov and Hackl 1997). The
multiplicative algorithm for D-optimal input spectra (Titterington 1976; Goodwin and Payne 1977,
ch. 6) multiplies powers by g_i / (A' m)_i, with the multipliers at which these powers use their
limits. Any multipliers that satisfy the inequality bound what is left to gain:

    F(optimum) - F(v) <= sum_c m_c - sum_i g_i v_i.

A share of the limits goes to all lines evenly. It shows causes that nobody foresees, and makes the
design depend less on modes that are not where the drawing has them.

Periodic signals of stated amplitudes: phases with a low peak, and orthogonal realisations.

*Phases*: those of Schroeder (1970) give line k the phase

    phi_k = -2 pi sum_{j <= k} (k - j) p_j,    p_j the share of the power at line j.

The signal is then a sweep that stays at each frequency in proportion to its power. Swapping between
time and frequency lowers the peak further (van der Ouderaa, Schoukens and Renneboog 1988): the
waveform is clipped, its phases are kept, and its amplitudes are set back.

*Realisations*: q drives that act at once need q different signals each, or no FRF can be told from
another. Realisation r of drive d is turned by exp(2 pi i r d / q). The signals of any two drives
are then orthogonal at each line over all realisations (Dobrowiecki, Schoukens and Guillaume 2006).
"""

from dataclasses import dataclass

import numpy as np
import scipy.fft

from identification.words import Complex, Integers, Mask, Real

EVEN_SHARE = 0.2  # of the limits: FRFs between optimal lines have 2.2 times the even noise
_MAX_DESIGN_STEPS = 400
_MAX_GAIN_LEFT_NATS = 0.02  # of F: intervals are then within 1 % of the shortest for one coordinate
_MIN_EIGENVALUE = 1e-10  # of correlations
_PRICE_STEPS = 30
_MIN_MULTIPLIER_SHARE = 1e-12  # of the largest: a limit that became idle can still be met again
_CHECK_INTERVAL = 20  # steps between two computations of the bound


@dataclass(frozen=True, eq=False)
class LineInformation:
    """What a unit of power at each line and drive tells of the coordinates.

    Args:
        factors: X_i; (n_freq, n_drive, n_row, n_x).
        saturation: R_i, relative error over noise per power; (n_freq, n_drive, n_row).
        precision: diagonal of P; (n_x,).
        of_interest: coordinates k; (n_x,).
    """

    factors: Real
    saturation: Real
    precision: Real
    of_interest: Mask

    def covariance(self, power: Real) -> Real:
        """Return C; (n_x, n_x).

        Args:
            power: v; (n_freq, n_drive).
        """
        each = power[:, :, None]
        weight = np.sqrt(each / (1 + each * self.saturation))[..., None]
        rows = (self.factors * weight).reshape(-1, len(self.precision))
        matrix = rows.T @ rows + np.diag(self.precision)
        scale = 1 / np.sqrt(np.diag(matrix))
        return np.linalg.inv(matrix * np.outer(scale, scale)) * np.outer(scale, scale)

    def criterion(self, power: Real) -> float:
        """Return F [nats]: half of it is the gain of ln of the intervals' joint volume."""
        values, _, scale = self._decompose(self.covariance(power))
        return -float(np.log(values).sum() + 2 * np.log(scale).sum())

    def gradient(self, power: Real) -> Real:
        """Return g; (n_freq, n_drive)."""
        covariance = self.covariance(power)
        values, vectors, scale = self._decompose(covariance)
        root = vectors / np.sqrt(values) / scale[:, None]
        moved = self.factors @ (covariance[:, self.of_interest] @ root)
        moved = moved / (1 + power[:, :, None] * self.saturation)[..., None]
        return (moved**2).sum(axis=(2, 3))

    def _decompose(self, covariance: Real) -> tuple[Real, Real, Real]:
        """Return eigenvalues and vectors of the correlations of interest, and the deviations.

        Coordinates that act nearly alike have correlations that rounding makes indefinite.
        """
        kept = covariance[np.ix_(self.of_interest, self.of_interest)]
        scale = np.sqrt(np.diag(kept))
        values, vectors = np.linalg.eigh(kept / np.outer(scale, scale))
        return np.maximum(values, _MIN_EIGENVALUE), vectors, scale


@dataclass(frozen=True, eq=False)
class SpectrumDesign:
    """Power over lines and drives.

    Args:
        power: v; (n_freq, n_drive).
        criterion: F at it [nats].
        flat: F at the flat spectrum that the same limits allow [nats].
        gap: upper bound of what is left to gain, the even share kept [nats].
    """

    power: Real
    criterion: float
    flat: float
    gap: float


def flat_spectrum(costs: Real) -> Real:
    """Return equal power at all lines, for each drive as much as the limits allow.

    Where drives share a limit, each takes an equal part of it.

    Args:
        costs: A; (n_limit, n_freq, n_drive).

    Returns:
        (n_freq, n_drive).
    """
    return _share_limits(costs, costs.sum(axis=1, keepdims=True))


def even_spectrum(costs: Real) -> Real:
    """Return the power at which each line takes an equal part of the limit that it meets first.

    Args:
        costs: A; (n_limit, n_freq, n_drive).

    Returns:
        (n_freq, n_drive).
    """
    return _share_limits(costs, costs * costs.shape[1])


def _share_limits(costs: Real, use: Real) -> Real:
    """Return the largest power per use, each drive with an equal part of limits that are shared."""
    sharing = np.maximum((costs.sum(axis=1) > 0).sum(axis=1), 1)[:, None, None]
    with np.errstate(divide="ignore"):
        allowed = np.where(use > 0, 1 / (sharing * use), np.inf).min(axis=0)
    return np.broadcast_to(allowed, costs.shape[1:]).copy()


def design_spectrum(
    information: LineInformation, costs: Real, even_share: float = EVEN_SHARE
) -> SpectrumDesign:
    """Return the power that maximises F under the limits, with an even share.

    Args:
        information: of lines and drives.
        costs: A; (n_limit, n_freq, n_drive), each drive in a limit.
        even_share: part of the limits that all lines take evenly.
    """
    even = even_spectrum(costs)
    floor = even_share * even
    costs_of_rest = costs / (1 - (costs * floor).sum(axis=(1, 2)))[:, None, None]
    added, multipliers = (1 - even_share) * even, np.ones(len(costs))
    best, gap = floor + added, np.inf
    for step in range(_MAX_DESIGN_STEPS):
        slopes = information.gradient(floor + added)
        gains = slopes * added
        multipliers = _price_limits(gains, costs_of_rest, multipliers)
        price = np.maximum(np.tensordot(multipliers, costs_of_rest, 1), np.finfo(float).tiny)
        if step % _CHECK_INTERVAL == 0:
            # Scaled to the least multipliers that fulfil the inequality, they bound the optimum.
            bound = float(multipliers.sum() * (slopes / price).max() - gains.sum())
            if bound < gap:
                best, gap = floor + added, bound
            if gap <= _MAX_GAIN_LEFT_NATS:
                break
        added = gains / price
        added = added / (costs_of_rest * added).sum(axis=(1, 2)).max()
    flat = information.criterion(flat_spectrum(costs))
    return SpectrumDesign(best, information.criterion(best), flat, gap)


def _price_limits(gains: Real, costs: Real, start: Real) -> Real:
    """Return the multipliers m that minimise sum_c m_c - sum_i b_i ln (A' m)_i; (n_limit,).

    Powers b_i / (A' m)_i then use each limit with a multiplier whole. The iteration is that of
    Richardson and Lucy, which lowers the sum at each step (Vardi, Shepp and Kaufman 1985).

    Args:
        gains: b; (n_freq, n_drive).
        start: m of the step before; (n_limit,).
    """
    rows, flat_gains = costs.reshape(len(costs), -1), gains.ravel()
    multipliers = np.maximum(start, _MIN_MULTIPLIER_SHARE * start.max())
    for _ in range(_PRICE_STEPS):
        price = np.maximum(multipliers @ rows, np.finfo(float).tiny)
        multipliers = multipliers * (rows @ (flat_gains / price))
    return np.asarray(multipliers)


_SWAPS = 200
_CLIPS = (0.75, 0.98)  # of the peak, from the first swap to the last


def schroeder_phases(power: Real) -> Real:
    """Return the phases of a sweep with this power at its lines [rad]; (n_line,)."""
    share = power / power.sum()
    return -2 * np.pi * np.cumsum(np.cumsum(share) - share)


def lower_peak(amplitudes: Complex, lines: Integers, samples: int, phases: Real) -> Real:
    """Return phases at which a waveform has a low peak [rad]; (n_line,).

    Args:
        amplitudes: of the waveform per exp(i phase) of the signal; (n_line,).
        lines: their numbers, 1 for one period in the record; (n_line,).
        samples: of the record.
        phases: of the signal at the start; (n_line,).
    """
    best, lowest = phases, np.inf
    for clip in np.linspace(*_CLIPS, _SWAPS):
        waveform = periodic_waveform(amplitudes * np.exp(1j * phases), lines, samples)
        peak = float(np.abs(waveform).max())
        if peak < lowest:
            best, lowest = phases, peak
        clipped = np.clip(waveform, -clip * peak, clip * peak)
        phases = np.angle(scipy.fft.rfft(clipped)[lines] / amplitudes)
    return best


def periodic_waveform(amplitudes: Complex, lines: Integers, samples: int) -> Real:
    """Return sum_k Re a_k exp(2 pi i k t) over one period; (..., n_sample).

    Args:
        amplitudes: a; (..., n_line).
        lines: k; (n_line,).
        samples: of the period.
    """
    spectrum = np.zeros((*amplitudes.shape[:-1], samples // 2 + 1), np.complex128)
    spectrum[..., lines] = amplitudes * (samples / 2)
    return scipy.fft.irfft(spectrum, samples, axis=-1)


def orthogonal_turns(drives: int) -> Complex:
    """Return the factor of each realisation and drive, a unitary matrix times sqrt q; (q, q)."""
    numbers = np.arange(drives)
    turns = np.exp(2j * np.pi * np.outer(numbers, numbers) / drives)
    return np.asarray(turns, np.complex128)
