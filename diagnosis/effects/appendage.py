"""A small mass on a spring: a cable carrier, a loose cover.

A mass m that moves along an axis on a spring of w0 and zeta adds to the body's dynamic stiffness

    m s^2 S / (s^2 + S),   S = 2 zeta w0 s + w0^2

along that axis: a mass below its frequency, next to nothing above. It may move along one axis or
along all, so that each world axis has a mass of its own. The frequency is scanned; from there it is
fitted, with the damping and the place: with R = s^2 S / (s^2 + S), dR/dS = s^4 / (s^2 + S)^2.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache, partial

import numpy as np

from diagnosis.effects.scales import ARM_UNIT_M, MASS_SHARE_UNIT
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Vague, Value
from identification.words import Complex, Mask, Real
from mbmodel import (
    AddedPart,
    Addition,
    Change,
    Machine,
    Parameter,
    suspended_mass_elements,
    transport,
)

_FREQUENCIES, _SCAN_DAMPING_RATIO = 80, 0.03  # in steps of 5 %, less than a resonance is wide
_LOWEST_SHARE, _HIGHEST_SHARE = (
    1 / 40,
    1.2,
)  # of the highest line: it holds on to nothing, it is a mass
_LOG_UNITS = 0.05, 0.5  # of the logarithms of frequency and damping per unit of theirs
_DAMPING_BOUNDS = 1e-3, 0.5  # beyond, nothing resonates: it is a mass, or nothing
_MIN_MOVING_SHARE = 0.02  # of the largest mass: what moves along no other axis to speak of
_MIN_WRITTEN_SHARE = 1e-5  # of the largest mass: no body of an MJCF
_MAX_MASS_SHARE = 1.0  # of the body's mass: beyond, it is no small mass
_MAX_GYRATION_RADII = 3.0  # of the body's radius of gyration: beyond, it hangs on another
Shape = Callable[[Complex], Complex]
Hung = Callable[[Real, float, float, Real], tuple[Addition, ...]]  # masses, omega, zeta, place


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each body and frequency."""
    machine = scene.model.machine
    bodies = machine.layout.bodies
    band = scene.session.campaign.freq_hz
    lowest = max(float(band[band > 0].min()), _LOWEST_SHARE * float(band[-1]))
    highest = _HIGHEST_SHARE * float(band[-1])
    for number, body in enumerate(bodies):
        inertia = machine.body_mass[6 * number : 6 * number + 6, 6 * number : 6 * number + 6]
        if not inertia[0, 0] > 0:
            continue  # the coordinate of a body's mode
        unit = MASS_SHARE_UNIT * float(inertia[0, 0])
        reach = _MAX_GYRATION_RADII * float(np.sqrt(np.trace(inertia[3:, 3:]) / inertia[0, 0]))
        frame = np.zeros((6 * len(bodies), 6))
        frame[6 * number : 6 * number + 6] = np.eye(6)
        for at, frequency in enumerate(np.geomspace(lowest, highest, _FREQUENCIES)):
            appendage = _Appendage(
                f"{body}.appendage{at}",
                frame,
                unit,
                float(frequency),
                partial(_write_masses, machine, number),
            )
            yield Hypothesis(
                "appendage",
                f"body:{body}",
                parts=(appendage.part(f"body:{body}"),),
                scored=appendage.masses,
                signed=True,
                bounds=appendage.bounds(lowest, highest, reach),
                state=appendage.state,
                along=appendage.along,
            )


class _Appendage:
    """Masses along three axes at one point, on springs of one frequency and damping.

    With G = [1, -[p]x] the motion of the point p, it adds G' diag(m) G R(s).
    """

    def __init__(self, name: str, frame: Real, unit: float, frequency: float, hung: Hung) -> None:
        self.name, self.frame, self.unit, self.frequency = name, frame, unit, frequency
        self.hung = hung
        self.masses = tuple(f"{name}.mass_{axis}" for axis in "xyz")
        self.place = tuple(f"{name}.position_{axis}" for axis in "xyz")
        self.tuned = (f"{name}.frequency", f"{name}.damping")

    def part(self, location: str) -> AddedPart:
        """As a Part."""
        units = [f"{self.unit:g} kg"] * 3 + ["5 %", "50 %"] + [f"{ARM_UNIT_M:g} m"] * 3
        names = (*self.masses, *self.tuned, *self.place)
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(names, units, strict=True)
        )
        return AddedPart(location, parameters, self.finite, self.derivatives, written=self.write)

    def _at(self, theta: Real) -> tuple[float, float]:
        omega = 2 * np.pi * self.frequency * float(np.exp(_LOG_UNITS[0] * theta[3]))
        return omega, _SCAN_DAMPING_RATIO * float(np.exp(_LOG_UNITS[1] * theta[4]))

    def bounds(self, lowest: float, highest: float, reach: float) -> dict[str, tuple[float, float]]:
        """Where its parameters end, for a range of frequencies [Hz] and a reach [m]."""
        ends = np.array([[lowest, highest], _DAMPING_BOUNDS])
        begun = np.array([[self.frequency], [_SCAN_DAMPING_RATIO]])
        steps = np.log(ends / begun) / np.array(_LOG_UNITS)[:, None]
        tuned = {name: (low, high) for name, (low, high) in zip(self.tuned, steps, strict=True)}
        masses = dict.fromkeys(self.masses, (0.0, _MAX_MASS_SHARE / MASS_SHARE_UNIT))
        return tuned | masses | dict.fromkeys(self.place, (-reach / ARM_UNIT_M, reach / ARM_UNIT_M))

    def _change(self, core: Real, shape: Shape) -> Change:
        whole = np.zeros((*core.shape[:-2], 3, 6, 6))
        whole[..., 0, :, :] = core
        return Change("body", self.frame, self.frame, whole, shape=shape)

    def finite(self, theta: Real) -> tuple[Change, ...]:
        """All three masses on their spring."""
        moved = transport(ARM_UNIT_M * theta[5:])[:3]
        core = self.unit * moved.T @ (theta[:3, None] * moved)
        return (self._change(core, _resonator(*self._at(theta))),)

    def derivatives(self, theta: Real) -> tuple[Change, ...]:
        """By the masses and the place, then by frequency and damping."""
        omega, zeta = self._at(theta)
        moved = transport(ARM_UNIT_M * theta[5:])[:3]
        pushed = self.unit * theta[:3, None] * moved
        core = np.zeros((8, 6, 6))
        for k, row in enumerate(moved):
            core[k] = self.unit * np.outer(row, row)
        for k, unit in enumerate(np.eye(3)):
            turned = transport(ARM_UNIT_M * unit)[:3] - np.eye(3, 6)
            core[5 + k] = turned.T @ pushed + pushed.T @ turned
        changes = [self._change(core, _resonator(omega, zeta))]
        if theta[:3].any():
            for place, shape in ((3, _by_frequency(omega, zeta)), (4, _by_damping(omega, zeta))):
                sensitivity = np.zeros((8, 6, 6))
                sensitivity[place] = moved.T @ pushed
                changes.append(self._change(sensitivity, shape))
        return tuple(changes)

    def write(self, theta: Real) -> tuple[Addition, ...]:
        """A body on a slide for each axis."""
        omega, zeta = self._at(theta)
        return self.hung(self.unit * theta[:3], omega, zeta, ARM_UNIT_M * theta[5:])

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the parameters as the verdict names them."""
        omega, zeta = self._at(np.array([0.0] * 3 + [fitted[name] for name in self.tuned]))
        masses = np.array([fitted[name] for name in self.masses])
        place = np.array([ARM_UNIT_M * fitted[name] for name in self.place])
        alone = _alone(masses)
        near = np.where(alone, 0.0, place).tolist()
        return {
            "mass": self.unit * float(masses.max()),
            "frequency": omega / (2 * np.pi),
            "damping": zeta,
            "position": Vague(near) if alone.any() else tuple(near),
        }

    def along(self, fitted: Mapping[str, float]) -> str | None:
        """The axis, if it moves along one alone."""
        alone = _alone(np.array([fitted[name] for name in self.masses]))
        return f"t{'xyz'[int(np.argmax(alone))]}" if alone.any() else None


def _alone(masses: Real) -> Mask:
    """The axis, if what hangs there moves along one alone; (3,).

    It may sit anywhere on it, and all its FRFs are the same: of those places the nearest counts.
    """
    large: Mask = masses > _MIN_MOVING_SHARE * masses.max()
    return large if large.sum() == 1 else np.zeros(3, bool)


def _write_masses(
    machine: Machine, number: int, masses: Real, omega: float, zeta: float, place: Real
) -> tuple[Addition, ...]:
    body, centre = machine.layout.bodies[number], machine.layout.centres[number]
    additions: list[Addition] = []
    alone = _alone(masses)
    for axis in np.flatnonzero(masses > _MIN_WRITTEN_SHARE * masses.max()):
        sizes = masses[axis] * np.array([1.0, omega**2, 2 * zeta * omega])
        near = np.where(alone, 0.0, place) if alone[axis] else place
        along = centre + near, np.eye(3)[axis]
        additions += suspended_mass_elements(
            f"{body}.appendage_{'xyz'[axis]}", machine, body, along, sizes
        )
    return tuple(additions)


@lru_cache(1024)  # those of all bodies are one: their columns are formed together
def _resonator(omega: float, zeta: float) -> Shape:
    """R(s): dynamic stiffness of a unit mass on its spring."""

    def shape(laplace: Complex) -> Complex:
        spring = 2 * zeta * omega * laplace + omega**2
        return np.asarray(laplace**2 * spring / (laplace**2 + spring), complex)

    return shape


def _by_frequency(omega: float, zeta: float) -> Shape:
    """The slope ``dR`` per unit of the frequency's parameter."""

    def shape(laplace: Complex) -> Complex:
        spring = 2 * zeta * omega * laplace + omega**2
        rate = _LOG_UNITS[0] * (2 * zeta * omega * laplace + 2 * omega**2)
        return np.asarray(laplace**4 / (laplace**2 + spring) ** 2 * rate, complex)

    return shape


def _by_damping(omega: float, zeta: float) -> Shape:
    """The slope ``dR`` per unit of the damping's parameter."""

    def shape(laplace: Complex) -> Complex:
        spring = 2 * zeta * omega * laplace + omega**2
        rate = _LOG_UNITS[1] * 2 * zeta * omega * laplace
        return np.asarray(laplace**4 / (laplace**2 + spring) ** 2 * rate, complex)

    return shape


EFFECT = Effect(
    propose,
    noun="a small mass on a spring",
    means="a small mass on a spring hangs on {place}: a cable carrier, a loose cover",
    confirm="hold or take off what hangs on {place} and repeat: the resonance goes with it",
    undoes=True,
)
