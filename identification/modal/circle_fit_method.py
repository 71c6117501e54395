r"""Circle fit of one mode in the Nyquist plane (Kennelly and Pancu 1947; Ewins 2000, ch. 4.3).

With viscous damping the mobility of one mode, time convention exp(+i w t),

    Y(w) = i w A / (w_r^2 - w^2 + 2 i zeta w_r w) + B,

is an exact circle of diameter A / (2 zeta w_r) through B, the sum of all other modes, taken to be
constant. The receptance of structural damping is one too; that of light viscous damping nearly.
Seen from the centre the angle sweeps twice the mode's phase: with tan(phi) = (w^2 - w_r^2) /
(2 zeta w_r w),

    theta(w) = theta_r - 2 phi,

so that natural frequency, damping and the angle at resonance follow from the sweep of all lines at
once; A is the diameter times 2 zeta w_r, its phase that of the diameter at resonance.
"""

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from identification.words import Complex, InputError, Real

_LEAST = 5  # lines on a circle: three numbers make one, three more the sweep
_ARC = np.pi / 3  # least sweep around the centre that tells a circle from a line


@dataclass(frozen=True)
class Circle:
    """A circle through one mode, and what its sweep says.

    Args:
        natural_hz: w_r / 2 pi [Hz].
        damping: zeta.
        modal_constant: A, complex; its phase is 0 or pi where the mode is real
            [unit of the mobility times rad/s].
        centre: of the circle [unit of the mobility].
        radius: likewise.
        scatter: rms distance of the values from the circle, relative to the radius.
    """

    natural_hz: float
    damping: float
    modal_constant: complex
    centre: complex
    radius: float
    scatter: float

    @property
    def phase(self) -> float:
        """Of the modal constant, -pi .. pi [rad]."""
        return float(np.angle(self.modal_constant))


def circle_fit(freq_hz: Real, values: Complex, order: int) -> Circle:
    """Fit a circle to the lines around one resonance.

    The circle is Kasa's, |z|^2 = 2 Re(conj(c) z) + const by linear least squares, refined to the
    least sum of squared distances; then the sweep of the angle gives frequency and damping.

    Args:
        freq_hz: lines around the peak, rising, above 0 Hz [Hz]; (n_freq,).
        values: FRF; (n_freq,).
        order: q: 0, 1, 2 for receptance, mobility, accelerance; fitted as a mobility.

    Returns:
        The circle.

    Raises:
        InputError: too few lines, or values that do not go round a circle.
    """
    freq = np.asarray(freq_hz, float)
    if len(freq) < _LEAST or freq[0] <= 0:
        raise InputError(
            f"{len(freq)} lines from {freq[0] if len(freq) else 0:g} Hz: a circle needs at least "
            f"{_LEAST} above 0 Hz; measure longer"
        )
    mobility = np.asarray(values) * (2j * np.pi * freq) ** (1 - order)
    centre, radius = _refined(mobility, *_kasa(mobility))
    angle = np.unwrap(np.angle(mobility - centre))
    if angle[0] - angle[-1] < _ARC:
        raise InputError(
            f"the FRF does not go round a circle in {freq[0]:.4g}..{freq[-1]:.4g} Hz: no mode is "
            "alone there, take the fitted poles"
        )
    natural, damping, resonance = _sweep(freq, angle)
    diameter = 2 * radius * np.exp(1j * resonance)
    distance = np.abs(mobility - centre) - radius
    return Circle(
        natural_hz=natural,
        damping=damping,
        modal_constant=complex(diameter * 4 * np.pi * damping * natural),
        centre=centre,
        radius=radius,
        scatter=float(np.sqrt(np.mean(distance**2)) / radius),
    )


def _kasa(values: Complex) -> tuple[complex, float]:
    """Centre and radius of the algebraic circle (Kasa 1976), of values scaled to their mean."""
    middle = values.mean()
    size = float(np.abs(values - middle).max()) or 1.0
    z = (values - middle) / size
    matrix = np.column_stack([2 * z.real, 2 * z.imag, np.ones(len(z))])
    x, y, rest = np.linalg.lstsq(matrix, np.abs(z) ** 2, rcond=None)[0]
    radius = np.sqrt(max(rest + x**2 + y**2, 0.0))
    return complex(middle + size * (x + 1j * y)), float(size * radius)


def _refined(values: Complex, centre: complex, radius: float) -> tuple[complex, float]:
    """The least sum of squared distances, from the algebraic circle, whose arcs come out small."""
    size = radius or 1.0

    def distances(x: Real) -> Real:
        found: Real = np.abs((values - centre) / size - (x[0] + 1j * x[1])) - x[2]
        return found

    def slopes(x: Real) -> Real:
        from_centre = (values - centre) / size - (x[0] + 1j * x[1])
        unit = from_centre / np.maximum(np.abs(from_centre), np.finfo(float).tiny)
        return -np.column_stack([unit.real, unit.imag, np.ones(len(unit))])

    start = [0.0, 0.0, radius / size]
    found = scipy.optimize.least_squares(distances, start, slopes, method="lm").x
    return complex(centre + size * (found[0] + 1j * found[1])), float(size * abs(found[2]))


def _sweep(freq: Real, angle: Real) -> tuple[float, float, float]:
    """Natural frequency, damping ratio and the angle at resonance from theta(w).

    The fastest sweep is where the resonance is; the three numbers are refined on all lines.
    """
    rate = np.diff(angle) / np.diff(freq)
    fastest = int(np.argmin(rate))
    start = (freq[fastest] + freq[fastest + 1]) / 2
    width = max(-4.0 / (rate[fastest] * start), 1e-6)  # d theta / dw = -2 / (zeta w_r)
    zeta = width / 2

    def off(x: Real) -> Real:
        natural, losses = start * np.exp(x[0]), zeta * np.exp(x[1])
        phase = np.arctan((freq**2 - natural**2) / (2 * losses * natural * freq))
        found: Real = angle - (x[2] - 2 * phase)
        return found

    def slopes(x: Real) -> Real:
        natural, losses = start * np.exp(x[0]), zeta * np.exp(x[1])
        tangent = (freq**2 - natural**2) / (2 * losses * natural * freq)
        by_natural = -(freq**2 + natural**2) / (2 * losses * natural * freq)
        rate = 2 / (1 + tangent**2)
        return np.column_stack([rate * by_natural, -rate * tangent, -np.ones(len(freq))])

    middle = (angle[fastest] + angle[fastest + 1]) / 2
    scale = [zeta, 0.3, 0.3]
    begin = [0.0, 0.0, middle]
    found = scipy.optimize.least_squares(off, begin, slopes, x_scale=scale, method="lm").x
    return float(start * np.exp(found[0])), float(zeta * np.exp(found[1])), float(found[2])
