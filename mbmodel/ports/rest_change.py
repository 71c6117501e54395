"""The measured rest of a machine as a change of its equation of motion (``measured_rest``)."""

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from identification.words import Real
from mbmodel.machine import Machine
from mbmodel.measured_rest import MeasuredRest
from mbmodel.mjcf.edit import MjcfLack, NotInMjcf
from mbmodel.parts import Change, Parameter, PartContext
from mbmodel.ports.ports import find_ports

REST = "rest of the state before"  # owner of the change, for statements
REST_FACTOR = "rest.stiffness_factor"  # name of the parameter f


def rest_changes(machine: Machine) -> tuple[Change, ...]:
    """Return F E L at the bodies; none for a machine without a measured rest.

    Args:
        machine: bodies that it has beyond those of the rest stand at the end of its rows.
    """
    if machine.rest is None:
        return ()
    force, readout, core = _find_sides(machine, machine.rest)
    return (Change("body", force, readout, core, shape=machine.rest.at, owner=REST),)


@dataclass(frozen=True, eq=False)
class RestPart:
    """The rest's share in a common factor f on all stiffness: (f - 1) F D L."""

    @property
    def location(self) -> str:
        """Place of the rest: everywhere."""
        return REST

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The factor f, which follows that of all springs."""
        return (Parameter(REST_FACTOR, 1.0, "1", known="exactly"),)

    def changes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return (f - 1) F D L; nothing at f = 1, or without a rest."""
        rest, factor = context.machine.rest, float(theta[0])
        if rest is None or factor == 1.0:
            return ()
        force, readout, core = _find_sides(context.machine, rest)
        core = (factor - 1.0) * core
        return (Change("body", force, readout, core, shape=rest.drift_at, owner=REST),)

    def slopes(self, theta: Real, context: PartContext) -> tuple[Change, ...]:
        """Return the slopes by f, one of rank one for each entry of D."""
        del theta
        rest = context.machine.rest
        if rest is None:
            return ()
        force, readout, _ = _find_sides(context.machine, rest)
        core = np.zeros((1, 3, 1, 1))
        core[0, 0] = 1.0
        return tuple(
            Change(
                "body",
                force[:, row, None],
                readout[:, column, None],
                core,
                shape=partial(rest.drift_entry_at, row, column),
            )
            for row in range(force.shape[1])
            for column in range(readout.shape[1])
        )

    def write(self, theta: Real) -> tuple[NotInMjcf, ...]:
        """Return nothing: the rest as a whole is what an MJCF cannot hold."""
        del theta
        return ()

    def select_held(self, theta: Real) -> Real:
        """Return the nominal factor."""
        return np.ones_like(theta)


def rest_lack(machine: Machine) -> tuple[NotInMjcf, ...]:
    """Return that an MJCF cannot hold the rest of a machine, if it has one."""
    return () if machine.rest is None else (NotInMjcf(REST, MjcfLack.FREQUENCY),)


@lru_cache(maxsize=8)  # the geometry of a machine is that of many assemblies
def _find_sides(machine: Machine, rest: MeasuredRest) -> tuple[Real, Real, Real]:
    """Return F, L' and a core of ones; (6 n_body, n), (6 n_body, n) and (3, n, n)."""
    ports = find_ports(machine, rest.outputs, rest.inputs)
    force, readout = ports.force.copy(), ports.readout.copy()
    force[: len(rest.force_shift)] += rest.force_shift
    readout[:, : rest.readout_shift.shape[1]] += rest.readout_shift
    core = np.zeros((3, len(rest.inputs), len(rest.outputs)))
    core[0] = 1.0
    return force, readout.T, core
