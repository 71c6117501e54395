"""The plant of control loops: FRFs and poles between their ports, and their margins."""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, Loop, Real, sampling_period
from mbmodel import Evaluator, FrfRequest, Linearised, Model
from tuning.plant.control_loops.loop_gain_lines import LoopGainOf, first_lines
from tuning.plant.control_loops.stability_margins import AllMargins, stability_margins
from tuning.plant.error_budget.closed_loop_states import LoopAliases, loop_states
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_algebra import PortMap, loop_gains, map_ports

_RANGE = 10.0  # of lines below the slowest and above the fastest pole, and of the band


def loops_alone(loops: tuple[Loop, ...], band: tuple[float, float]) -> BudgetDefinition:
    """Return a definition of loops without errors and sources.

    Args:
        loops: that are closed.
        band: of interest [Hz].
    """
    return BudgetDefinition((), (), loops, np.zeros((0, 0), complex), band)


@dataclass(frozen=True, eq=False)
class LoopPlant:
    """FRFs between the ports of the loops of a machine.

    Args:
        model: machine and Parts, without the loops.
        definition: loops alone.
        ports: their labels.
    """

    model: Model
    definition: BudgetDefinition
    ports: PortMap

    @classmethod
    def of(cls, model: Model, definition: BudgetDefinition) -> "LoopPlant":
        """Return the plant of a budget's loops around a machine."""
        loops = replace(definition, errors=(), sources=())
        return cls(model, loops, map_ports(loops))

    def poles(self, theta: Real, *, is_closed: bool) -> Complex:
        """Return the poles with all loops closed or open [rad/s]; (n_pole,)."""
        definition = self.definition if is_closed else replace(self.definition, loops=())
        return loop_states(self.model, theta, definition, self.ports).poles()

    def margins(self, theta: Real, open_poles: Complex, closed_poles: Complex) -> AllMargins:
        """Return the margins at some parameters, where the loops are stable.

        Args:
            theta: (n_theta,).
            open_poles: with all loops open, of a machine near this one [rad/s]; (n_pole,).
            closed_poles: with all loops closed [rad/s]; (n_pole,).
        """
        lines = self.lines_near(open_poles, closed_poles)
        is_sampled = sampling_period(self.definition.loops) > 0
        return stability_margins(self.gain_at(theta), lines, is_sampled=is_sampled)

    def lines_near(self, open_poles: Complex, closed_poles: Complex) -> Real:
        """Return lines with which the search for margins begins [Hz]; (n_freq,).

        Args:
            open_poles, closed_poles: with all loops open and closed [rad/s]; (n_pole,).
        """
        controllers = [loop.controller.poles for loop in self.definition.loops]
        poles = np.concatenate([open_poles, *controllers, closed_poles])
        return _lines(self.definition.band, poles, sampling_period(self.definition.loops))

    def lines(self, theta: Real, freq_hz: Real) -> Linearised:
        """Return the FRFs at some parameters and lines."""
        request = FrfRequest(freq_hz, self.ports.outputs, self.ports.inputs, "receptance")
        return Evaluator(self.model, request).at(theta)

    def gain_at(self, theta: Real) -> LoopGainOf:
        """Return the loop gains GK at some parameters as a function of frequency."""
        definition, ports = self.definition, self.ports
        aliases = LoopAliases.of(self.model, theta, definition, ports)

        def gain_of(freq_hz: Real) -> Complex:
            lines = self.lines(theta, freq_hz)
            laplace = lines.request.laplace
            return loop_gains(definition, ports, lines.values, laplace, aliases.at(laplace))

        return gain_of


def _lines(band: tuple[float, float], poles: Complex, period_s: float) -> Real:
    """Return lines to begin with, from far below to far above all poles and the band [Hz].

    Those of sampled loops end at half of the sampling rate.
    """
    sizes = np.abs(poles) / (2 * np.pi)
    sizes = sizes[sizes > 0]
    low = min(band[0], float(sizes.min(initial=band[0]))) / _RANGE
    if period_s:
        highest = 0.5 / period_s
        return first_lines(min(low, highest / _RANGE), highest, poles)
    return first_lines(low, max(band[1], float(sizes.max(initial=0.0))) * _RANGE, poles)
