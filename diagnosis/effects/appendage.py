"""A small mass on a spring: a cable carrier, a loose cover.

A mass m on a spring of natural frequency w0 and damping ratio zeta moves along one axis of a body.
It adds to the body's dynamic stiffness along that axis

    m R(s),   R = s^2 S / (s^2 + S),   S = 2 zeta w0 s + w0^2.

Far below w0 this is the inertia of a mass, far above w0 it vanishes. The three world axes have a
mass each, so that the appendage may move along one axis or along all. Score tests scan w0. Refits
start at the best w0 and fit frequency, damping, masses and place (``resonator.py`` has R).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from diagnosis.effects.points import name_vector
from diagnosis.effects.resonator import build_resonator, build_resonator_slope
from diagnosis.effects.scales import (
    ARM_UNIT_M,
    LOG_FREQUENCY_UNIT,
    LOG_UNIT,
    MASS_SHARE_UNIT,
)
from diagnosis.effects.spring_laws import Shape
from diagnosis.hypothesis import Effect, Hypothesis, Scene, Vague, Value
from diagnosis.rounding import NEGLIGIBLE_SHARE
from identification.words import Mask, Real
from mbmodel import (
    AddedPart,
    Addition,
    Change,
    Machine,
    Parameter,
    suspended_mass_elements,
    transport,
)

_SCAN_DAMPING_RATIO = 0.03  # of scanned appendages, and where their damping starts


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each body and frequency of the scan."""
    machine = scene.model.machine
    band = scene.session.campaign.freq_hz
    lowest, highest = (share * float(band[-1]) for share in scene.settings.appendage_ends)
    lowest = max(float(band[band > 0].min()), lowest)
    steps = max(0, round(float(np.log(highest / lowest)) / LOG_FREQUENCY_UNIT))
    frequencies = np.geomspace(lowest, highest, steps + 1).tolist()
    for number, body in enumerate(machine.layout.bodies):
        if not machine.body_mass[6 * number, 6 * number] > 0:
            continue  # the coordinate of a body's mode
        frame = np.eye(len(machine.body_mass))[:, 6 * number : 6 * number + 6]
        for at, frequency in enumerate(frequencies):
            appendage = _Appendage(machine, number, f"{body}.appendage{at}", frequency, frame)
            yield Hypothesis(
                "appendage",
                f"body:{body}",
                parts=(appendage.part,),
                scored=appendage.mass_names,
                signed=True,
                bounds=appendage.find_bounds(lowest, highest, scene.settings.max_added_mass_share),
                state=appendage.state,
                along=appendage.find_axis,
            )


@dataclass(frozen=True, eq=False)
class _Appendage:
    """Masses along three axes at one point, on springs of one frequency and damping.

    With G = [1, -[p]x] the motion of the point p per motion of the body, it adds G' diag(m) G R(s).

    Args:
        machine: machine that carries it.
        number: number of the body.
        name: prefix of its parameters.
        frequency: natural frequency of the scan [Hz].
        frame: coordinates of the body among those of all bodies; (6 n_body, 6).
    """

    machine: Machine
    number: int
    name: str
    frequency: float
    frame: Real

    @property
    def mass_names(self) -> tuple[str, ...]:
        """Names of the masses along the world axes."""
        return name_vector(f"{self.name}.mass_")

    @property
    def place_names(self) -> tuple[str, ...]:
        """Names of the components of the place, from the centre of mass."""
        return name_vector(f"{self.name}.position_")

    @property
    def resonance_names(self) -> tuple[str, str]:
        """Names of frequency and damping."""
        return f"{self.name}.frequency", f"{self.name}.damping"

    @property
    def _inertia(self) -> Real:
        """Spatial inertia of the body; (6, 6)."""
        span = slice(6 * self.number, 6 * self.number + 6)
        inertia: Real = self.machine.body_mass[span, span]
        return inertia

    @property
    def _mass_unit(self) -> float:
        return MASS_SHARE_UNIT * float(self._inertia[0, 0])

    @property
    def part(self) -> AddedPart:
        """Part with the appendage."""
        units = [f"{self._mass_unit:g} kg"] * 3
        units += [f"{LOG_FREQUENCY_UNIT:.0%}", f"{LOG_UNIT:.0%}"] + [f"{ARM_UNIT_M:g} m"] * 3
        names = (*self.mass_names, *self.resonance_names, *self.place_names)
        parameters = tuple(
            Parameter(name, 0.0, unit, positive=False)
            for name, unit in zip(names, units, strict=True)
        )
        location = f"body:{self.machine.layout.bodies[self.number]}"
        return AddedPart(
            location, parameters, self.compute_change, self.compute_slopes, written=self.write
        )

    def _resonance(self, theta: Real) -> tuple[float, float]:
        """Return the natural frequency [rad/s] and the damping ratio."""
        omega = 2 * np.pi * self.frequency * float(np.exp(LOG_FREQUENCY_UNIT * theta[3]))
        return omega, _SCAN_DAMPING_RATIO * float(np.exp(LOG_UNIT * theta[4]))

    def find_bounds(
        self, lowest: float, highest: float, radii: float
    ) -> dict[str, tuple[float, float]]:
        """Return the bounds of the parameters.

        The appendage weighs at most as much as the body. Its damping ratio is at most sqrt(1/2),
        beyond which a resonator has no peak, and as many times less than in the scan.

        Args:
            lowest: lowest frequency [Hz].
            highest: highest frequency [Hz].
            radii: largest distance from the centre of mass [radii of gyration].
        """
        frequency, damping = self.resonance_names
        ends = np.log(np.array([lowest, highest]) / self.frequency) / LOG_FREQUENCY_UNIT
        widest = float(np.log(np.sqrt(0.5) / _SCAN_DAMPING_RATIO)) / LOG_UNIT
        inertia = self._inertia
        gyration = float(np.sqrt(np.trace(inertia[3:, 3:]) / inertia[0, 0]))
        reach = radii * gyration / ARM_UNIT_M
        bounds = {frequency: (float(ends[0]), float(ends[1])), damping: (-widest, widest)}
        bounds |= dict.fromkeys(self.mass_names, (0.0, 1 / MASS_SHARE_UNIT))
        return bounds | dict.fromkeys(self.place_names, (-reach, reach))

    def _build_change(self, core: Real, shape: Shape) -> Change:
        whole = np.zeros((*core.shape[:-2], 3, 6, 6))
        whole[..., 0, :, :] = core
        return Change("body", self.frame, self.frame, whole, shape=shape)

    def compute_change(self, theta: Real) -> tuple[Change, ...]:
        """Return the change by all three masses on their springs."""
        moved = transport(ARM_UNIT_M * theta[5:])[:3]
        core = self._mass_unit * moved.T @ (theta[:3, None] * moved)
        return (self._build_change(core, build_resonator(*self._resonance(theta))),)

    def compute_slopes(self, theta: Real) -> tuple[Change, ...]:
        """Return the slopes by masses and place, then by frequency and damping."""
        omega, zeta = self._resonance(theta)
        unit = self._mass_unit
        moved = transport(ARM_UNIT_M * theta[5:])[:3]
        momentum = unit * theta[:3, None] * moved
        core = np.zeros((8, 6, 6))
        for k, row in enumerate(moved):
            core[k] = unit * np.outer(row, row)
        for k, direction in enumerate(np.eye(3)):
            turned = transport(ARM_UNIT_M * direction)[:3] - np.eye(3, 6)
            core[5 + k] = turned.T @ momentum + momentum.T @ turned
        changes = [self._build_change(core, build_resonator(omega, zeta))]
        if theta[:3].any():
            rates = np.array([[2 * zeta * omega, 2 * omega**2], [2 * zeta * omega, 0.0]])
            rates *= [[LOG_FREQUENCY_UNIT], [LOG_UNIT]]
            for place, (linear, constant) in enumerate(rates.tolist(), start=3):
                sensitivity = np.zeros((8, 6, 6))
                sensitivity[place] = moved.T @ momentum
                shape = build_resonator_slope(omega, zeta, (linear, constant))
                changes.append(self._build_change(sensitivity, shape))
        return tuple(changes)

    def write(self, theta: Real) -> tuple[Addition, ...]:
        """Return a body on a slide for each axis along which a mass moves."""
        omega, zeta = self._resonance(theta)
        masses, place = self._mass_unit * theta[:3], ARM_UNIT_M * theta[5:]
        layout = self.machine.layout
        body, centre = layout.bodies[self.number], layout.centres[self.number]
        single = _find_single_axis(masses)
        additions: list[Addition] = []
        for axis in np.flatnonzero(masses > NEGLIGIBLE_SHARE * masses.max()):
            sizes = masses[axis] * np.array([1.0, omega**2, 2 * zeta * omega])
            nearest = np.where(single, 0.0, place) if single[axis] else place
            name = f"{body}.appendage_{'xyz'[axis]}"
            line = centre + nearest, np.eye(3)[axis]
            additions += suspended_mass_elements(name, self.machine, body, line, sizes)
        return tuple(additions)

    def state(self, fitted: Mapping[str, float]) -> dict[str, Value]:
        """Return the parameters of the verdict."""
        omega, zeta = self._resonance(
            np.array([0.0] * 3 + [fitted[name] for name in self.resonance_names])
        )
        masses = np.array([fitted[name] for name in self.mass_names])
        place = np.array([ARM_UNIT_M * fitted[name] for name in self.place_names])
        single = _find_single_axis(masses)
        nearest = np.where(single, 0.0, place).tolist()
        return {
            "mass": self._mass_unit * float(masses.max()),
            "frequency": omega / (2 * np.pi),
            "damping": zeta,
            "position": Vague(nearest) if single.any() else tuple(nearest),
        }

    def find_axis(self, fitted: Mapping[str, float]) -> str | None:
        """Return the axis, such as ``tx``, of an appendage that moves along one axis alone."""
        single = _find_single_axis(np.array([fitted[name] for name in self.mass_names]))
        return f"t{'xyz'[int(np.argmax(single))]}" if single.any() else None


def _find_single_axis(masses: Real) -> Mask:
    """Return which axis is the only one along which the appendage moves, if there is one; (3,).

    FRFs are equal wherever the appendage lies along that axis: the nearest place is stated. Masses
    within one unit of zero do not count.
    """
    is_large: Mask = masses > MASS_SHARE_UNIT * masses.max()
    return is_large if is_large.sum() == 1 else np.zeros(3, bool)


EFFECT = Effect(
    propose,
    noun="a small mass on a spring",
    means="a small mass on a spring hangs on {place}: a cable carrier, a loose cover",
    confirm="hold or take off what hangs on {place} and repeat: the resonance goes with it",
    undoes=True,
)
