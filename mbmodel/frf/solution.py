"""The equation of motion, solved at one theta for one question."""

from dataclasses import dataclass
from functools import cached_property

from identification.words import Complex, Condition, Real
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.ports import Places
from mbmodel.frf.request import Question
from mbmodel.frf.solver import Solver
from mbmodel.frf.woodbury import ShapedSolver
from mbmodel.model import Assembly, Model


@dataclass(frozen=True, eq=False)
class Solved:
    """The equation of motion solved at theta for one question.

    Args:
        model: what was linearised.
        theta: where; (n_parameter,).
        question: lines, outputs, inputs.
        condition: of the test meant, or None.
        assembly: the equation at theta.
        places: L, P, U at theta.
        solver: of Z x = f.
        motion: x = s^q Z^-1 F; (nv, n_in, n_freq).
    """

    model: Model
    theta: Real
    question: Question
    condition: Condition | None
    assembly: Assembly
    places: Places
    solver: Solver | ShapedSolver
    motion: Complex

    @cached_property
    def readout(self) -> Real:
        """G = L T; (n_out, nv)."""
        readout: Real = self.places.readout @ self.assembly.jacobian
        return readout

    @cached_property
    def values(self) -> Complex:
        """H; (n_freq, n_out, n_in), a view on memory that runs along frequency."""
        values = real_times(self.readout, self.motion)
        if self.places.has_floor:
            carried = self.places.readout @ self.places.floor
            values += carried[:, :, None] * self.carrying
        return values.transpose(2, 0, 1)

    @cached_property
    def carrying(self) -> Complex:
        """s^(q - 2), motion of the floor per acceleration of it; (n_freq,)."""
        return self.question.laplace ** (self.question.order - 2)
