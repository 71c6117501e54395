"""Circle fit of one mode in the Nyquist plane (Kennelly and Pancu 1947; Ewins 2000, ch. 4.3).

With viscous damping the mobility of one mode, time convention exp(+i w t),

    Y(w) = i w A / (w_r^2 - w^2 + 2 i zeta w_r w) + B,

is an exact circle of diameter A / (2 zeta w_r) through B. B is the sum of all other modes, assumed
to be constant. The receptance with structural damping is an exact circle too; the receptance with
light viscous damping is nearly one. Seen from the centre the angle sweeps twice the phase of the
mode: with tan(phi) = (w^2 - w_r^2) / (2 zeta w_r w),

    theta(w) = theta_r - 2 phi,

so that natural frequency, damping and the angle at resonance follow from the sweep of all lines at
once. The modulus of A is the diameter times 2 zeta w_r; its phase is that of the diameter at
resonance.
"""

from dataclasses import dataclass

import numpy as np
import scipy.optimize

from identification.words import Complex, InputError, Real

# Lines on a circle: centre and radius are three numbers, the angle sweep has three more.
_MIN_CIRCLE_LINES = 5
# Sweep around the centre [rad] below which the values are as well a straight line as a circle.
_MIN_ARC_RAD = np.pi / 3


@dataclass(frozen=True)
class Circle:
    """A circle through the values around one resonance, and the mode that its angle sweep gives.

    Args:
        natural_hz: w_r / 2 pi [Hz].
        damping: zeta.
        modal_constant: A, complex; its phase is 0 or pi for a real mode [unit of the mobility times
            rad/s].
        centre: centre of the circle [unit of the mobility].
        radius: radius of the circle [unit of the mobility].
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
        """Phase of the modal constant, -pi .. pi [rad]."""
        return float(np.angle(self.modal_constant))


def circle_fit(freq_hz: Real, values: Complex, order: int) -> Circle:
    """Fit a circle to the frequency lines around one resonance.

    The algebraic circle of Kasa (1976), |z|^2 = 2 Re(conj(c) z) + const by linear least squares, is
    refined to the least sum of squared distances. Then the angle sweep gives frequency and damping.

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
    if len(freq) < _MIN_CIRCLE_LINES or freq[0] <= 0:
        raise InputError(
            f"{len(freq)} frequency lines from {freq[0] if len(freq) else 0:g} Hz are too few: a "
            f"circle fit needs at least {_MIN_CIRCLE_LINES} above 0 Hz; measure longer"
        )
    mobility = np.asarray(values) * (2j * np.pi * freq) ** (1 - order)
    centre, radius = _refine_circle(mobility, *_fit_kasa_circle(mobility))
    angle = np.unwrap(np.angle(mobility - centre))
    if angle[0] - angle[-1] < _MIN_ARC_RAD:
        raise InputError(
            f"the FRF does not go round a circle in {freq[0]:.4g}..{freq[-1]:.4g} Hz: no single "
            "mode dominates there; use the fitted poles"
        )
    natural, damping, resonance = _fit_angle_sweep(freq, angle)
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


def _fit_kasa_circle(values: Complex) -> tuple[complex, float]:
    """Return centre and radius of the algebraic circle (Kasa 1976), fitted to scaled values."""
    middle = values.mean()
    size = float(np.abs(values - middle).max()) or 1.0
    z = (values - middle) / size
    matrix = np.column_stack([2 * z.real, 2 * z.imag, np.ones(len(z))])
    x, y, rest = np.linalg.lstsq(matrix, np.abs(z) ** 2, rcond=None)[0]
    radius = np.sqrt(max(rest + x**2 + y**2, 0.0))
    return complex(middle + size * (x + 1j * y)), float(size * radius)


def _refine_circle(values: Complex, centre: complex, radius: float) -> tuple[complex, float]:
    """Minimise the sum of squared distances, starting from the algebraic circle.

    The algebraic circle of a short arc is biased towards a small radius.
    """
    size = radius or 1.0

    def distances(x: Real) -> Real:
        return np.abs((values - centre) / size - (x[0] + 1j * x[1])) - x[2]

    def jacobian(x: Real) -> Real:
        from_centre = (values - centre) / size - (x[0] + 1j * x[1])
        unit = from_centre / np.maximum(np.abs(from_centre), np.finfo(float).tiny)
        return -np.column_stack([unit.real, unit.imag, np.ones(len(unit))])

    start = [0.0, 0.0, radius / size]
    solution = scipy.optimize.least_squares(distances, start, jacobian, method="lm").x
    return complex(centre + size * (solution[0] + 1j * solution[1])), float(size * abs(solution[2]))


def _fit_angle_sweep(freq: Real, angle: Real) -> tuple[float, float, float]:
    """Fit natural frequency, damping ratio and the angle at resonance to theta(w).

    The fit starts where the angle sweeps fastest, and uses all lines (Levenberg-Marquardt).

    Args:
        freq: lines [Hz]; (n_freq,).
        angle: theta, unwrapped [rad]; (n_freq,).
    """
    rate = np.diff(angle) / np.diff(freq)
    fastest = int(np.argmin(rate))
    start = (freq[fastest] + freq[fastest + 1]) / 2
    width = max(-4.0 / (rate[fastest] * start), 1e-6)  # d theta / dw = -2 / (zeta w_r)
    zeta = width / 2

    def angle_residuals(x: Real) -> Real:
        natural, ratio = start * np.exp(x[0]), zeta * np.exp(x[1])
        phase = np.arctan((freq**2 - natural**2) / (2 * ratio * natural * freq))
        return angle - (x[2] - 2 * phase)

    def jacobian(x: Real) -> Real:
        natural, ratio = start * np.exp(x[0]), zeta * np.exp(x[1])
        tangent = (freq**2 - natural**2) / (2 * ratio * natural * freq)
        by_natural = -(freq**2 + natural**2) / (2 * ratio * natural * freq)
        rate = 2 / (1 + tangent**2)
        return np.column_stack([rate * by_natural, -rate * tangent, -np.ones(len(freq))])

    middle = (angle[fastest] + angle[fastest + 1]) / 2
    scale = [zeta, 0.3, 0.3]
    initial = [0.0, 0.0, middle]
    solution = scipy.optimize.least_squares(
        angle_residuals, initial, jacobian, x_scale=scale, method="lm"
    ).x
    natural, damping = start * np.exp(solution[0]), zeta * np.exp(solution[1])
    return float(natural), float(damping), float(solution[2])
