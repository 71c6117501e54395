"""Parts for the springs and dampers of joints and tendons."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from identification.words import Integers, Real
from mbmodel.linearisation.springs import DrawnLaw, Spring
from mbmodel.machine import Machine
from mbmodel.mjcf.edit import Edit, NotInMjcf
from mbmodel.parts.part import Change, Parameter, PartContext, Slot

_USUAL_DAMPING = 0.01  # of critical damping: that of bolted and guided metal, by order of magnitude


@dataclass(frozen=True, eq=False)
class SpringPart:
    """The springs and dampers of one joint or tendon: sum_i g_i (k_i + s c_i) g_i' + k_i G_i.

    A spring with laws f_j(s) of the nominal model has k_i (1 + sum_j r_ij f_j(s)) in place of k_i.

    A tendon between sites pulls at bodies: its g_i is a row of body motions, so that it follows
    when joints move. G_i is the geometric stiffness of a tendon under tension, per unit of its
    stiffness. Both belong to one equilibrium; a machine whose equilibrium follows its parameters
    gives the Part other springs there (``mbmodel.moving_equilibrium``).

    Stiffness that is zero on the drawing stays zero. A spring that is drawn without damping has
    some: the drawing leaves it out.

    Args:
        location: ``joint:<child body>`` or ``tendon:<name>``.
        springs: at least one.
        usual_damping: of each spring, 1 % of its critical damping [N s/m or N m s/rad].
    """

    location: str
    springs: tuple[Spring, ...]
    usual_damping: tuple[float, ...]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Stiffness and damping of each spring, where there are any.

        A coupling between joints may be negative; it is tuned by the logarithm of its ratio to the
        drawing.
        """
        return tuple(parameter for _, _, parameter in self._coefficients)

    @cached_property
    def _coefficients(self) -> tuple[tuple[int, int, Parameter], ...]:
        """Power of s, number of the spring and parameter of each coefficient."""
        coefficients = []
        for number, (spring, usual) in enumerate(
            zip(self.springs, self.usual_damping, strict=True)
        ):
            units = ("N m/rad", "N m s/rad") if spring.angular else ("N/m", "N s/m")
            if spring.stiffness != 0:
                name = f"{spring.name}.stiffness"
                stiffness = Parameter(name, spring.stiffness, units[0], known="stiffness")
                coefficients.append((0, number, stiffness))
            name, value = f"{spring.name}.damping", spring.damping
            if value != 0:
                coefficients.append((1, number, Parameter(name, value, units[1], known="damping")))
            elif usual > 0:
                damping = Parameter(name, 0.0, units[1], False, "undrawn_damping", usual)
                coefficients.append((1, number, damping))
        return tuple(coefficients)

    @cached_property
    def _slot(self) -> Slot:
        """Slot of the change: joints, or bodies for a tendon between sites."""
        return "joint" if self.springs[0].at_bodies is None else "body"

    @cached_property
    def _frame(self) -> Real:
        """Elongations g_i in columns; (n, n_spring)."""
        rows = [s.direction if s.at_bodies is None else s.at_bodies for s in self.springs]
        return np.array(rows).T

    @cached_property
    def _parameter_places(self) -> tuple[Integers, Integers]:
        """Power of s and number of the spring for each parameter."""
        places = [(power, number) for power, number, _ in self._coefficients]
        powers, springs = np.array(places, np.intp).reshape(-1, 2).T
        return powers, springs

    @cached_property
    def _slope(self) -> Change:
        """Derivatives of the diagonal core by each parameter."""
        powers, springs = self._parameter_places
        core = np.zeros((len(powers), 3, len(self.springs), len(self.springs)))
        core[np.arange(len(powers)), powers, springs, springs] = 1.0
        return Change(self._slot, self._frame, self._frame, core)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return a change of rank n_spring with a diagonal core, and the geometric stiffness."""
        del context
        size = len(self.springs)
        powers, springs = self._parameter_places
        core = np.zeros((3, size, size))
        core[powers, springs, springs] = theta
        changes: tuple[Change, ...] = (Change(self._slot, self._frame, self._frame, core),)
        if self._geometric is not None:
            tension = np.zeros((3, *self._geometric.shape[1:]))
            tension[0] = np.einsum("i,ijk", np.diag(core[0]), self._geometric)
            changes += (self._whole_change(tension),)
        return (*changes, *self._law_changes(core[0]))

    @cached_property
    def _laws(self) -> dict[DrawnLaw, Real]:
        """Sizes r of each law f(s), by spring; (n_spring,) each."""
        sizes: dict[DrawnLaw, Real] = {}
        for index, spring in enumerate(self.springs):
            for law in spring.laws:
                unit = replace(law, size=1.0)
                sizes.setdefault(unit, np.zeros(len(self.springs)))[index] += law.size
        return sizes

    def _law_changes(self, cores: Real) -> tuple[Change, ...]:
        """Return what laws add for diagonal cores of s^0.

        Args:
            cores: stiffness, or its slopes; (.., n_spring, n_spring).
        """
        changes = []
        for law, sizes in self._laws.items():
            has_law = np.flatnonzero(sizes)
            core = np.zeros((*cores.shape[:-2], 3, len(has_law), len(has_law)))
            core[..., 0, :, :] = (sizes * cores)[..., has_law[:, None], has_law]
            frame = self._frame[:, has_law]
            place = self.springs[has_law[0]].name if len(has_law) == 1 else self.location
            owner = f"{place}.{law.name}"
            changes.append(Change(self._slot, frame, frame, core, shape=law.shape, owner=owner))
        return tuple(changes)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the constant derivatives by each parameter."""
        del theta, context
        laws = self._law_changes(self._slope.core[:, 0])
        if self._geometric is None:
            return (self._slope, *laws)
        powers, springs = self._parameter_places
        core = np.zeros((len(powers), 3, *self._geometric.shape[1:]))
        core[powers == 0, 0] = self._geometric[springs[powers == 0]]
        return (self._slope, self._whole_change(core), *laws)

    @cached_property
    def _geometric(self) -> Real | None:
        """G_i of each spring, zero for those without tension; (n_spring, nv, nv)."""
        matrices = [spring.geometric for spring in self.springs if spring.geometric is not None]
        if not matrices:
            return None
        zero = np.zeros_like(matrices[0])
        return np.stack([zero if s.geometric is None else s.geometric for s in self.springs])

    @staticmethod
    def _whole_change(core: Real) -> Change:
        """Return a change of the whole matrix of the joints."""
        unit = np.eye(core.shape[-1])
        return Change("joint", unit, unit, core)

    def rows(self, theta: Real, jacobian: Real) -> list[tuple[Spring, Real, float, float]]:
        """Return each spring, its elongation per joint coordinate (nv,), its stiffness and damping.

        Args:
            theta: values of the parameters.
            jacobian: T; (6 n_body, nv).
        """
        core = np.zeros((2, len(self.springs)))
        powers, springs = self._parameter_places
        core[powers, springs] = theta
        frame = self._frame if self._slot == "joint" else jacobian.T @ self._frame
        return [
            (spring, frame[:, k], float(core[0, k]), float(core[1, k]))
            for k, spring in enumerate(self.springs)
        ]

    def write(self, theta: Real) -> tuple[Edit | NotInMjcf, ...]:
        """Return the coefficients of each joint or tendon; of a polynomial the linear term."""
        values: dict[str, dict[str, float]] = {}
        for parameter, value in zip(self.parameters, theta, strict=True):
            if value == parameter.drawn:
                continue
            element, attribute = parameter.name.rsplit(".", 1)
            values.setdefault(element, {})[attribute] = float(value)
        return tuple(Edit("spring", name, coefficients) for name, coefficients in values.items())

    def select_held(self, theta: Real) -> Real:
        """Return theta: an MJCF holds springs and dampers."""
        return theta


def spring_parts(machine: Machine) -> tuple[SpringPart, ...]:
    """Return one Part for each joint and tendon of the machine, in the machine's order."""
    flexibility = np.asarray(np.linalg.pinv(machine.mass, hermitian=True), float)
    groups = groupby(machine.springs, key=lambda spring: spring.location)
    parts = []
    for location, of_group in groups:
        springs = tuple(of_group)
        usual = tuple(_find_usual_damping(spring, flexibility) for spring in springs)
        parts.append(SpringPart(location, springs, usual))
    return tuple(parts)


def _find_usual_damping(spring: Spring, flexibility: Real) -> float:
    """Return 1 % of the critical damping 2 sqrt(k m), m = 1 / (g' M^-1 g) the mass that g moves.

    A spring that moves no mass, as a tendon between points of one body, has none.
    """
    mobility = float(spring.direction @ flexibility @ spring.direction)
    if mobility <= 0:
        return 0.0
    return _USUAL_DAMPING * 2 * float(np.sqrt(abs(spring.stiffness) / mobility))
