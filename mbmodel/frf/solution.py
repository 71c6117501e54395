"""Solution of the equation of motion at one theta for one request."""

from dataclasses import dataclass
from functools import cached_property

from identification.words import Complex, Condition, Real
from mbmodel.frf.modal_form import real_times
from mbmodel.frf.ports import Ports
from mbmodel.frf.request import FrfRequest
from mbmodel.frf.solver import Solver
from mbmodel.frf.woodbury import WoodburySolver
from mbmodel.model import Assembly, Model


@dataclass(frozen=True, eq=False)
class FrfSolution:
    """The equation of motion solved at theta for one request.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        request: lines, outputs, inputs, quantity.
        condition: of the test, or None.
        assembly: the equation at theta.
        ports: L, P, U at theta.
        solver: of Z x = f.
        motion: x = s^q Z^-1 F, of the joint coordinates; (nv, n_in, n_freq).
    """

    model: Model
    theta: Real
    request: FrfRequest
    condition: Condition | None
    assembly: Assembly
    ports: Ports
    solver: Solver | WoodburySolver
    motion: Complex

    @cached_property
    def readout(self) -> Real:
        """G = L T; (n_out, nv)."""
        readout: Real = self.ports.readout @ self.assembly.jacobian
        return readout

    @cached_property
    def values(self) -> Complex:
        """FRFs H, a view on memory that runs along frequency; (n_freq, n_out, n_in)."""
        values = real_times(self.readout, self.motion)
        if self.ports.has_floor:
            floor_motion = self.ports.readout @ self.ports.floor
            values += floor_motion[:, :, None] * self.floor_factor
        return values.transpose(2, 0, 1)

    @cached_property
    def floor_factor(self) -> Complex:
        """Factor s^(q - 2): motion of the floor per acceleration of it; (n_freq,)."""
        return self.request.laplace ** (self.request.order - 2)
