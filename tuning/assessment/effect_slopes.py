r"""Parameters of added effects, as first-order changes of the machine that an MJCF describes.

An effect has its parameters, such as the point and the axes of a link, and its MJCF has others: a
tendon with its sites. What a parameter p changes of the equation of motion is the same in both. So
the MJCF is written at p and at p + h, both are read back, and with the joint coordinates and the
centres of mass of the first

    dMb = (X' Mb(p + h) X - Mb(p)) / h,       dZ = (Z(p + h) - Z(p)) / h - what dMb adds to Z.

X moves a body's inertia to the first centre of mass. dMb follows the body, with its weight and with
the motion of the floor; dZ, of K, C and M, acts between joint coordinates.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identification.words import InputError, Real, shorten_names
from mbmodel import (
    AddedPart,
    Change,
    Machine,
    Model,
    Parameter,
    as_drawn,
    read_as_written,
    transport,
)

# Step of a parameter, of its deviation: laws are straight over it, and the equilibrium of a hung
# machine, which is found to 1e-8 rad, hides no change.
STEP_SHARE = 0.01
_MIN_SLOPE_SHARE = 1e-9  # of the largest entry of a matrix: a smaller change is rounding


@dataclass(frozen=True, eq=False)
class EffectSlopes:
    """Changes of a machine per unit of each parameter of its added effects.

    Args:
        names: names of the parameters; n.
        coordinates: names of the joint coordinates; nv.
        bodies: names of the bodies; n_body.
        inertia: dMb of each body about its centre of mass, in world axes; (n, n_body, 6, 6).
        joint: dK, dC and dM between joint coordinates; (n, 3, nv, nv).
    """

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    bodies: tuple[str, ...]
    inertia: Real
    joint: Real

    def part(self, machine: Machine) -> AddedPart:
        """Return a Part of a machine, zero and linear in the parameters.

        Args:
            machine: the machine of the MJCF, alone or with a stage on it.

        Raises:
            InputError: the machine lacks a joint coordinate or a body of the effects.
        """
        machine_names = (*machine.coordinates, *machine.layout.bodies)
        if missing := [
            name for name in (*self.coordinates, *self.bodies) if name not in machine_names
        ]:
            raise InputError(
                f"{machine.source} lacks {shorten_names(missing)}, which its posterior varies: "
                "name the MJCF that was written beside it"
            )
        places = [machine.coordinates.index(name) for name in self.coordinates]
        frame = np.eye(len(machine.coordinates))[:, places]
        numbers = [machine.layout.bodies.index(name) for name in self.bodies]
        rows = np.ravel([range(6 * k, 6 * k + 6) for k in numbers]).astype(int)
        bodies = np.eye(6 * len(machine.layout.bodies))[:, rows]
        core = np.zeros((len(self.names), 3, len(rows), len(rows)))
        for k in range(len(numbers)):
            span = slice(6 * k, 6 * k + 6)
            core[:, 2, span, span] = self.inertia[:, k]
        parameters = tuple(Parameter(name, 0.0, "1", positive=False) for name in self.names)
        slopes = Change("body", bodies, bodies, core), Change("joint", frame, frame, self.joint)
        return AddedPart.linear("effects", parameters, slopes)

    def select(self, kept: list[int]) -> "EffectSlopes":
        """Return the slopes of some parameters."""
        names = tuple(self.names[k] for k in kept)
        return EffectSlopes(
            names, self.coordinates, self.bodies, self.inertia[kept], self.joint[kept]
        )


def find_effect_slopes(
    model: Model, theta: Real, steps: Mapping[str, float], written: Machine
) -> EffectSlopes:
    """Return what the parameters of added Parts change of the machine that an MJCF describes.

    Args:
        model: machine with its Parts.
        theta: parameters in SI; (n_parameter,).
        steps: h of each parameter, by name.
        written: machine of the MJCF at theta.

    Returns:
        Parameters that change nothing that an MJCF holds have no row.

    Raises:
        InputError: the MJCF of the machine cannot be read any more.
    """
    nominal = as_drawn(written)
    names = [parameter.name for parameter in model.parameters]
    size, count = len(written.coordinates), len(written.layout.bodies)
    inertia, joint = np.zeros((len(steps), count, 6, 6)), np.zeros((len(steps), 3, size, size))
    nominal_inertia, before = _inertia_about(written, written), _coefficients(nominal)
    for row, (name, step) in enumerate(steps.items()):
        moved = theta.copy()
        moved[names.index(name)] += step
        machine = read_as_written(model, moved)
        if machine.coordinates == written.coordinates:  # else the effect itself comes or goes
            inertia[row] = (_inertia_about(machine, written) - nominal_inertia) / step
            joint[row] = (_coefficients(as_drawn(machine)) - before) / step
    whole = EffectSlopes(tuple(steps), written.coordinates, written.layout.bodies, inertia, joint)
    whole.joint[:] -= _list_body_terms(nominal, whole)
    return whole.select(_find_visible(whole, np.abs(list(steps.values())), before, nominal_inertia))


def _find_visible(
    slopes: EffectSlopes, steps: Real, before: Real, nominal_inertia: Real
) -> list[int]:
    """Return the numbers of the parameters whose steps change the machine beyond rounding.

    Args:
        slopes: slopes of all parameters.
        steps: sizes of their steps; (n,).
        before: K, C and M of the machine; (3, nv, nv).
        nominal_inertia: inertia of its bodies; (n_body, 6, 6).
    """
    tiny = np.finfo(float).tiny
    of_joints = np.abs(slopes.joint).max(axis=(2, 3), initial=0.0)
    shares = of_joints / np.maximum(np.abs(before).max(axis=(1, 2), initial=0.0), tiny)
    of_bodies = np.abs(slopes.inertia).max(axis=(1, 2, 3), initial=0.0)
    of_bodies /= max(float(np.abs(nominal_inertia).max(initial=0.0)), tiny)
    largest = np.maximum(shares.max(axis=1, initial=0.0), of_bodies)
    return np.flatnonzero(steps * largest > _MIN_SLOPE_SHARE).tolist()


def _inertia_about(machine: Machine, reference: Machine) -> Real:
    """Return the spatial inertia of each body about its centre in another machine; (n, 6, 6)."""
    arms = machine.layout.centres - reference.layout.centres
    blocks = []
    for k, arm in enumerate(arms):
        span = slice(6 * k, 6 * k + 6)
        moved = transport(arm)
        blocks.append(moved.T @ machine.body_mass[span, span] @ moved)
    return np.array(blocks).reshape(len(arms), 6, 6)


def _coefficients(model: Model) -> Real:
    """Return K, C and M of a nominal model; (3, nv, nv)."""
    matrices = model.assemble(model.drawn).matrices
    return np.array([matrices.stiffness, matrices.damping, matrices.mass])


def _list_body_terms(nominal: Model, slopes: EffectSlopes) -> Real:
    """Return what the changes of inertia add to K, C and M; (n, 3, nv, nv)."""
    part, before = slopes.part(nominal.machine), _coefficients(nominal)
    alone = AddedPart.linear("effects", part.parameters, part.derivatives(np.zeros(0))[:1])
    model = Model(nominal.machine, (*nominal.parts, alone))
    count = len(slopes.names)
    terms = []
    for k in range(count):
        unit = np.append(nominal.drawn, np.eye(count)[k])
        matrices = model.assemble(unit).matrices
        terms.append(np.array([matrices.stiffness, matrices.damping, matrices.mass]) - before)
    return np.array(terms).reshape(count, *before.shape)
