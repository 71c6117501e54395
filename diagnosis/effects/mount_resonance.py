r"""A sensor that resonates on its mounting: wax, a magnet, a long stud.

The sensor is too light to be felt by the machine. Its readings are the motion times the
transmissibility of its mounting, with the natural frequency f0, the damping ratio z and s = i w:

    h(s) = (1 + b s) / (1 + b s + u s^2 / w_k^2),   b = 2 z / w0,   w0 = w_k / sqrt(u).

The frequency f_k of the scan is that of u = 1; at u = 0 the mounting is rigid. u and ln z are
fitted. The scan has steps of the width of a resonance, 2 z, up to a little above the highest line.
Farther above h = 1 + (f / f0)^2 throughout the band, so that a few frequencies are enough.

The slope at u = 0 has no resonance. The score test therefore uses the whole change from u = 0 to
u = 1, as that of a late spring does.

A mounting is known by its resonance: a fit that ends at z = sqrt(1/2), beyond which there is no
peak, describes a gain or a delay, and does not count.

On a body with redundant channels the data checks prove such a mounting without a model.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from diagnosis.effects.scales import LOG_FREQUENCY_UNIT, LOG_UNIT, MAX_LOG_STEPS
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.scene_points import list_sensors
from diagnosis.settings import DiagnosisSettings
from diagnosis.stated_values import Value
from identification import FAULT_PHRASES, MOUNT_ENDS
from identification.words import Complex, Dof, Real
from mbmodel import AddedPart, Change, Parameter

_DAMPING = LOG_FREQUENCY_UNIT  # ratio z of the scan: of wax and magnets 0.01 to 0.1

Shape = Callable[[Complex], Complex]


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each sensor and frequency of the scan."""
    frequencies = _scan(float(scene.session.campaign.freq_hz[-1]), scene.settings)
    measured = {dof.point for dof in scene.session.campaign.outputs if isinstance(dof, Dof)}
    for site in list_sensors(scene):
        if site in measured:
            for number, frequency in enumerate(frequencies):
                yield _Mounting(f"{site}.mounting{number}", site, frequency).propose()


def _scan(highest: float, settings: DiagnosisSettings) -> list[float]:
    """Return the frequencies of the scan [Hz].

    Args:
        highest: highest line [Hz].
        settings: end of the band of steps of 2 z, over the highest line.
    """
    low, high = (ratio * highest for ratio in MOUNT_ENDS)
    above = settings.appendage_ends[1] * highest
    steps = int(np.ceil(np.log(above / low) / (2 * _DAMPING)))
    return [
        *np.geomspace(low, above, steps + 1).tolist(),
        *np.geomspace(above, high, 4)[1:].tolist(),
    ]


@dataclass(frozen=True, eq=False)
class _Mounting:
    """Mounting of one sensor; its parameters are u and the logarithm of z, in units.

    Args:
        name: prefix of the parameters.
        site: the sensor.
        frequency: natural frequency of the scan f_k [Hz].
    """

    name: str
    site: str
    frequency: float

    @property
    def size_name(self) -> str:
        """Name of u."""
        return f"{self.name}.size"

    @property
    def damping_name(self) -> str:
        """Name of the logarithm of z over that of the scan, in units of ``LOG_UNIT``."""
        return f"{self.name}.damping"

    def propose(self) -> Hypothesis:
        """Return the hypothesis of this sensor and frequency."""
        location = f"sensor:{self.site}"
        most_damped = float(np.log(np.sqrt(0.5) / _DAMPING)) / LOG_UNIT  # no peak beyond
        parameters = (
            Parameter(self.size_name, 0.0, f"({self.frequency:g} Hz)^-2", positive=False),
            Parameter(self.damping_name, 0.0, "1", positive=False),
        )
        return Hypothesis(
            "mount_resonance",
            location,
            parts=(AddedPart(location, parameters, self.compute_change, self.compute_slopes),),
            begin={self.size_name: 1.0},
            scored=(self.size_name,),
            signed=True,
            bounds={
                self.size_name: (0.0, np.inf),
                self.damping_name: (-MAX_LOG_STEPS, most_damped),
            },
            valid_below_bound=(self.damping_name,),
            state=self.state,
        )

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return ln h; none of a rigid mounting."""
        u, damping = theta.tolist()
        return (self._build_change(1.0, _log_response(self.frequency, u, damping)),) if u else ()

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by u and ln z; at u = 0, the change up to u = 1 in place of those."""
        u, damping = theta.tolist()
        by_u, by_damping = np.array([1.0, 0.0]), np.array([0.0, 1.0])
        if not u:
            return (self._build_change(by_u, _whole_change(self.frequency, damping)),)
        return (
            self._build_change(by_u, _slope_by_size(self.frequency, u, damping)),
            self._build_change(by_damping, _slope_by_damping(self.frequency, u, damping)),
        )

    def _build_change(self, core: Real | float, shape: Shape) -> Change:
        """Return a factor of all readings of the sensor; see ``mbmodel.parts.part``."""
        whole = np.zeros((*np.shape(core), 3, 6, 1))
        whole[..., 0, :, 0] = np.asarray(core)[..., None]
        return Change("output", np.eye(6), np.ones((1, 1)), whole, self.site, shape)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return natural frequency [Hz] and damping ratio; none of a rigid mounting."""
        u = fitted[self.size_name]
        if u <= 0:
            return {}
        damping = _DAMPING * np.exp(LOG_UNIT * fitted[self.damping_name])
        return {"frequency": float(self.frequency / np.sqrt(u)), "damping": float(damping)}


def _compute_terms(
    laplace: Complex, frequency: float, u: float, damping: float
) -> tuple[Complex, Complex]:
    """Return b s and s^2 / w_k^2."""
    ratio = laplace / (2 * np.pi * frequency)
    return 2 * _DAMPING * np.exp(LOG_UNIT * damping) * np.sqrt(u) * ratio, ratio**2


@lru_cache(1024)
def _log_response(frequency: float, u: float, damping: float) -> Shape:
    """Return ln h: the phase of h stays within half a turn."""

    def shape(laplace: Complex) -> Complex:
        damped, square = _compute_terms(laplace, frequency, u, damping)
        return np.asarray(np.log((1 + damped) / (1 + damped + u * square)), complex)

    return shape


@lru_cache(1024)
def _whole_change(frequency: float, damping: float) -> Shape:
    """Return h - 1 of u = 1."""

    def shape(laplace: Complex) -> Complex:
        damped, square = _compute_terms(laplace, frequency, 1.0, damping)
        return np.asarray(-square / (1 + damped + square), complex)

    return shape


@lru_cache(1024)
def _slope_by_size(frequency: float, u: float, damping: float) -> Shape:
    """Return d ln h / d u, where b grows with sqrt(u)."""

    def shape(laplace: Complex) -> Complex:
        damped, square = _compute_terms(laplace, frequency, u, damping)
        by_damper = damped / 2 * square / (1 + damped)
        return np.asarray((by_damper - square) / (1 + damped + u * square), complex)

    return shape


@lru_cache(1024)
def _slope_by_damping(frequency: float, u: float, damping: float) -> Shape:
    """Return d ln h by ln z, in units."""

    def shape(laplace: Complex) -> Complex:
        damped, square = _compute_terms(laplace, frequency, u, damping)
        relative = damped / (1 + damped) - damped / (1 + damped + u * square)
        return np.asarray(LOG_UNIT * relative, complex)

    return shape


EFFECT = Effect(
    propose,
    noun=FAULT_PHRASES["mount_resonance"],
    means="{place} resonates on its mounting",
    confirm="glue or screw {place} on anew and repeat one hit: the resonance moves up",
)
