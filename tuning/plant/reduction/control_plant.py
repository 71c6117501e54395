"""The plant for a control engineer: a state space, reduced, with delays, continuous or discrete.

A reduced one has the smallest order whose error nobody can see. With bands, states below the
interval are worthless: the error of the reduction is at most a third of the half width of the 95 %
interval at every line of the band, which widens the interval by 5 % if both add in squares. Without
bands it is at most 1e-3 of the largest FRF of each pair by its bound, at every frequency.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from identification.words import Complex, Real, UsageError
from mbmodel import (
    ApproximatedLaw,
    FrfRequest,
    Model,
    SystemMatrices,
    discretise,
    export_state_space,
)
from tuning.plant.reduction.truncation import (
    ReducedSystem,
    Reduction,
    ReductionMethod,
    reduce_system,
)
from tuning.plant.uncertainty.frf_bands import FrfBands

if TYPE_CHECKING:
    import control
_MAX_INTERVAL_SHARE = 1 / 3  # of the half width
_MAX_PEAK_SHARE = 1e-3  # of the largest FRF, where no interval is known


@dataclass(frozen=True, eq=False)
class ControlPlant:
    """State space of the plant with its names.

    Args:
        request: outputs, inputs and quantity, and the lines of the band.
        whole: state space of the model in continuous time.
        system: A, B, C, D.
        states: names of the states.
        laws: laws of springs that it approximates.
        delays_s: of the inputs, which A, B, C, D do not hold [s]; (n_in,).
        period_s: sampling period, 0 in continuous time [s].
        reduced: reduction in continuous time; None for all states.
    """

    request: FrfRequest
    whole: SystemMatrices
    system: SystemMatrices
    states: tuple[str, ...]
    laws: tuple[ApproximatedLaw, ...]
    delays_s: Real
    period_s: float = 0.0
    reduced: ReducedSystem | None = None

    def __repr__(self) -> str:
        """Return order, time, ports, error of a reduction and delays in one line."""
        outputs, inputs = (
            ", ".join(map(str, ports)) for ports in (self.request.outputs, self.request.inputs)
        )
        time = f"sampled every {self.period_s:g} s" if self.period_s else "continuous"
        reduced = late = ""
        if self.reduced is not None:
            reduced = (
                f", reduced from {self.whole.order} with an error of {self.largest_error:.2g} of "
                "the largest FRF in the band"
            )
        if self.delays_s.any():
            late = f", delays {', '.join(f'{delay:g}' for delay in self.delays_s)} s"
        return (
            f"state space of {len(self.states)} states, {time}, {self.request.quantity}: "
            f"{outputs} / {inputs}{reduced}{late}"
        )

    def reduce(
        self,
        method: ReductionMethod = "balanced",
        order: int | None = None,
        bands: FrfBands | None = None,
    ) -> ControlPlant:
        """Return the reduced plant; see ``reduce_system``.

        Args:
            order: number of states; None for as many as the bands can tell, or by the bound.
            bands: of the FRFs; None without a fit.

        Raises:
            UsageError: an order below the number of states that must stay.
        """
        reduction = reduce_system(self.whole, self.request.freq_hz, method)
        if order is not None:
            reduced = reduction.at(reduction.terms_of(order))
        elif bands is not None:
            low, high = bands.magnitude_interval()
            half = (high - low) / 2
            reduced = reduce_within_interval(reduction, self.request.freq_hz, bands.values, half)
        else:
            reduced = reduce_by_bound(reduction)
        names = tuple(f"reduced_{k + 1}" for k in range(reduced.system.order))
        return replace(self, system=reduced.system, states=names, reduced=reduced)

    def sample(self, period_s: float) -> ControlPlant:
        """Return the plant in discrete time, whose states hold the delays; see ``discretise``.

        Args:
            period_s: sampling period [s].

        Raises:
            InputError: a delay of more than 10000 periods.
        """
        sampled = discretise(self.system, period_s, self.delays_s)
        inputs = [str(label) for label in self.request.inputs]
        late = [f"{inputs[number]}[k-{age}]" for number, age in sampled.delay_states]
        return replace(
            self,
            system=sampled.system,
            states=(*self.states, *late),
            delays_s=0 * self.delays_s,
            period_s=period_s,
        )

    @cached_property
    def _whole_frfs(self) -> Complex:
        """FRFs of the whole state space at the lines above 0 Hz; (n_line, n_out, n_in)."""
        return self.whole.at(self._laplace)

    @property
    def _laplace(self) -> Complex:
        """Lines above 0 Hz as s [rad/s]; (n_line,)."""
        freq = self.request.freq_hz
        return np.asarray(2j * np.pi * freq[freq > 0], complex)

    @property
    def relative_bound(self) -> float:
        """Bound of the reduction's error at every frequency, relative to each FRF's peak."""
        if self.reduced is None:
            return 0.0
        return float((self.reduced.bound / self._peaks).max())

    @property
    def largest_error(self) -> float:
        """Largest error of the reduction in the band, relative to each FRF's peak there."""
        if self.reduced is None:
            return 0.0
        error = np.abs(self.reduced.system.at(self._laplace) - self._whole_frfs)
        return float((error.max(axis=0, initial=0.0) / self._peaks).max())

    @property
    def _peaks(self) -> Real:
        """Largest magnitude of each FRF in the band, 1 where it is zero; (n_out, n_in)."""
        peaks = np.abs(self._whole_frfs).max(axis=0, initial=0.0)
        return np.where(peaks > 0, peaks, 1.0)

    def to_control(self) -> control.StateSpace:
        """Return the system of python-control.

        Raises:
            UsageError: it has delays in continuous time, which python-control does not know.
        """
        import control  # noqa: PLC0415  # with its matplotlib it would slow down every start

        if self.delays_s.any():
            raise UsageError(
                "python-control has no delays in continuous time: call sample(period_s) first, "
                "whose states hold them, or leave out delays_s and append Pade's fractions"
            )
        system = self.system
        labels = {
            "inputs": [str(label).replace(".", "_") for label in self.request.inputs],
            "outputs": [str(label).replace(".", "_") for label in self.request.outputs],
        }
        return control.ss(system.a, system.b, system.c, system.d, self.period_s, **labels)


def make_control_plant(
    model: Model, theta: Real, request: FrfRequest, delays_s: Real | None = None
) -> ControlPlant:
    """Return the plant of a model with all its states in continuous time.

    Args:
        theta: parameters in SI; (n_parameter,).
        request: outputs, inputs and quantity; its lines are the band of reduction and laws.
        delays_s: of the inputs [s], 0 if None; (n_in,).

    Raises:
        UsageError: delays that are negative or no numbers, or not one of each input.
    """
    late = np.zeros(len(request.inputs)) if delays_s is None else np.asarray(delays_s, float)
    if late.shape != (len(request.inputs),) or not (np.isfinite(late) & (late >= 0)).all():
        raise UsageError(
            f"delays_s = {late.tolist()} are no delays of {len(request.inputs)} inputs: give each "
            "input one number of seconds, 0 or above"
        )
    export = export_state_space(model, theta, request)
    whole = SystemMatrices(
        *(np.asarray(getattr(export.system, name), float) for name in ("A", "B", "C", "D"))
    )
    return ControlPlant(request, whole, whole, tuple(export.system.state_labels), export.laws, late)


def reduce_within_interval(
    reduction: Reduction, freq_hz: Real, values: Complex, half_width: Real
) -> ReducedSystem:
    """Return the system of fewest states whose error is a third of the interval's half width.

    Args:
        reduction: truncation at any order.
        freq_hz: lines [Hz]; (n_freq,).
        values: FRFs of the whole system; (n_freq, n_out, n_in).
        half_width: of the 95 % interval of the magnitudes; (n_freq, n_out, n_in).
    """
    moving = freq_hz > 0
    laplace = np.asarray(2j * np.pi * freq_hz[moving], complex)
    allowed = _MAX_INTERVAL_SHARE * half_width[moving]

    def is_hidden(candidate: ReducedSystem) -> bool:
        return bool((np.abs(candidate.system.at(laplace) - values[moving]) <= allowed).all())

    return reduction.smallest(is_hidden)


def reduce_by_bound(reduction: Reduction) -> ReducedSystem:
    """Return the system of fewest states whose bound is 1e-3 of the largest FRFs."""
    return reduction.smallest(lambda candidate: candidate.scaled_bound <= _MAX_PEAK_SHARE)
