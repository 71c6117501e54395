r"""The dynamic error budget: rms errors, their spectra, and the shares of sources and parts.

With E the error per source (``loop_algebra``) and S the cross-spectral densities of the sources,
all one-sided, an error e has the density and the mean square

    S_e = E S E^H,   rms^2 = integral of S_e df + sum over sines of |E a|^2 / 2,

a the peaks of the sines. The cumulative amplitude spectrum is the root of the integral from f
upwards; its steps name the modes. Every share adds up: of sources (with the cross terms of
correlated ones), of modes, Re conj(E) E_r, and of joints, whose motions add up to the error.

Frequency lines for integrals over resonances, with their weights.

A resonance at f_n with damping ratio z has the half width z f_n. Lines at
``f_n (1 + z tan(u))``, evenly spaced in u, share its integral evenly, however sharp it is.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.words import Complex, InputError, Real
from mbmodel import Evaluator, FrfRequest, Linearised, Model
from tuning.plant.error_budget.closed_loop_states import (
    LoopAliases,
    loop_states,
    refuse_undamped,
    refuse_unstable,
)
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.joined_states import LoopStates
from tuning.plant.error_budget.loop_algebra import LoopResponse, PortMap, close_loops, map_ports


@dataclass(frozen=True, eq=False)
class ErrorBudget:
    """Errors of a machine under its disturbances, for each error of the definition.

    The frequency lines are those of the integral, then those of the sines.

    Args:
        definition: errors, sources, loops.
        linearised: FRFs of the machine, between the labels of ``ports``.
        ports: labels.
        states: state space with the loops.
        response: errors per source.
        weights: of each line and source, in its root: amplitude of the source at that line;
            (n_freq, n_source).
        random_lines: number of lines of the integral.
    """

    definition: BudgetDefinition
    linearised: Linearised
    ports: PortMap
    states: LoopStates
    response: LoopResponse
    weights: Real
    random_lines: int

    @cached_property
    def scaled(self) -> Complex:
        """E times the amplitude of each source at each line; (n_freq, n_error, n_source)."""
        return np.asarray(self.response.errors * self.weights[:, None, :])

    @cached_property
    def mean_squares(self) -> Real:
        """Contribution of each line to the mean square; (n_freq, n_error)."""
        scaled = self.scaled
        product: Real = ((scaled @ self.definition.coherence) * scaled.conj()).real.sum(axis=2)
        return np.maximum(product, 0.0)

    @cached_property
    def rms(self) -> Real:
        """Root mean square of each error in SI; (n_error,)."""
        return np.sqrt(self.mean_squares.sum(axis=0))

    @cached_property
    def freq_hz(self) -> Real:
        """Lines [Hz]; (n_freq,)."""
        return np.asarray(self.linearised.request.freq_hz)

    def density(self) -> tuple[Real, Real]:
        """Return lines [Hz] and one-sided density of each error without sines; (n, n_error)."""
        lines = self.freq_hz[: self.random_lines]
        weights = trapezoid_weights(lines)
        return lines, self.mean_squares[: self.random_lines] / weights[:, None]

    def cumulative(self) -> tuple[Real, Real]:
        """Return lines [Hz] and rms of each error from each line upwards; (n_freq, n_error)."""
        order = np.argsort(self.freq_hz, kind="stable")
        above = np.cumsum(self.mean_squares[order][::-1], axis=0)[::-1]
        return self.freq_hz[order], np.sqrt(above)

    @cached_property
    def source_shares(self) -> Real:
        """Share of each source in the mean square, without cross terms; (n_error, n_source)."""
        return self._share((np.abs(self.scaled) ** 2).sum(axis=0))

    def cross_shares(self) -> list[tuple[str, str, Real]]:
        """Return pairs of correlated sources with the share of their cross term; (n_error,)."""
        coherence, names = self.definition.coherence, [s.name for s in self.definition.sources]
        rows = []
        for i, j in zip(*np.nonzero(np.triu(coherence, 1)), strict=True):
            terms = 2 * (self.scaled[..., i] * coherence[i, j] * self.scaled[..., j].conj()).real
            rows.append((names[i], names[j], self._share(terms.sum(axis=0)[:, None])[:, 0]))
        return rows

    @cached_property
    def joint_shares(self) -> tuple[tuple[str, ...], Real]:
        """Share of the motion of each joint coordinate; the rest moves with the floor.

        The error is the sum of what each coordinate moves it by, so the shares may be negative and
        add up to one with that of the floor, the last.
        """
        lines, ports = self.linearised, self.ports
        weighted = self._weigh_by_errors()
        motion = np.einsum(
            "nif,fis,fs->fns", lines.motion, self.response.right, self.weights, optimize=True
        )
        powers = lines.request.output_powers
        if powers is None:
            readout = ports.errors @ lines.readout
            shares = np.einsum("zn,fns,fzs->zn", readout, motion, weighted, optimize=True).real
        else:  # outputs that read different derivatives of the motion
            readout = np.einsum("zo,of,on->fzn", ports.errors, powers, lines.readout)
            shares = np.einsum("fzn,fns,fzs->zn", readout, motion, weighted, optimize=True).real
        shares = self._share(shares)
        names = (*lines.model.machine.coordinates, "floor")
        return names, np.hstack([shares, 1.0 - shares.sum(axis=1, keepdims=True)])

    @cached_property
    def mode_shares(self) -> tuple[Complex, Real]:
        """Poles that oscillate or decay, and the share of each; (n_pole,), (n_error, n_pole + 1).

        A pair of conjugate poles is one, by that of positive frequency. The last share is that of
        no mode: of the floor's motion itself, and of laws that the state space approximates. The
        modes are those with the loops closed; with sampled loops those of the machine itself,
        which the disturbances and the held controls drive.
        """
        states, is_sampled = self.states, self.states.period_s > 0
        if is_sampled:
            definition = replace(self.definition, loops=())
            states = loop_states(
                self.linearised.model, self.linearised.theta, definition, self.ports
            )
        poles, readout, drive = states.modal_terms()
        s = 2j * np.pi * self.freq_hz
        inputs = len(self.ports.inputs)
        disturbances = self.ports.disturbances
        shares = np.zeros((len(self.rms), len(poles)))
        weighted = self._weigh_by_errors()
        direct = drive[:, :inputs]
        rate_gain = drive[:, inputs : 2 * inputs] @ disturbances
        position_gain = drive[:, 2 * inputs : 3 * inputs] @ disturbances
        gain = direct @ disturbances + (
            0.0 if is_sampled else drive[:, 3 * inputs :] @ self.ports.noise
        )
        for k, pole in enumerate(poles):
            term = rate_gain[k] / s[:, None] + position_gain[k] / s[:, None] ** 2
            term = term + (direct[k] @ self.response.right if is_sampled else gain[k])
            term = term * self.weights / (s - pole)[:, None]
            shares[:, k] = np.einsum("z,fs,fzs->z", readout[:, k], term, weighted).real
        kept = poles.imag >= 0
        partner = np.array([int(np.argmin(np.abs(poles - pole.conjugate()))) for pole in poles])
        shares = np.where(poles.imag > 0, shares + shares[:, partner], shares)[:, kept]
        shares = self._share(shares)
        return poles[kept], np.hstack([shares, 1.0 - shares.sum(axis=1, keepdims=True)])

    def _weigh_by_errors(self) -> Complex:
        """Return conj(E a) times the coherence; (n_freq, n_error, n_source)."""
        return np.asarray((self.scaled @ self.definition.coherence).conj())

    def _share(self, terms: Real) -> Real:
        """Return terms of the mean square as shares of it; zero of no error."""
        total = self.rms[:, None] ** 2
        return np.divide(terms, total, out=np.zeros_like(terms), where=total > 0)


def error_budget(model: Model, theta: Real, definition: BudgetDefinition) -> ErrorBudget:
    """Compute the error budget of a machine.

    Args:
        theta: parameters in SI; (n_parameter,).

    Raises:
        InputError: the machine, or the closed loop, is unstable, or has no damping.
    """
    ports = map_ports(definition)
    states = loop_states(model, theta, definition, ports)
    poles = states.poles()
    refuse_unstable(poles, definition.loops)
    freq, weights, count = budget_lines(definition, poles)
    budget = budget_on_lines(model, theta, definition, (freq, weights, count), states)
    refuse_undamped(poles, definition.loops, *budget.density())
    return budget


def budget_on_lines(
    model: Model,
    theta: Real,
    definition: BudgetDefinition,
    lines: tuple[Real, Real, int],
    states: LoopStates,
) -> ErrorBudget:
    """Compute the error budget on given lines; see ``budget_lines``."""
    freq, weights, count = lines
    ports = map_ports(definition)
    request = FrfRequest(freq, ports.outputs, ports.inputs, "receptance")
    linearised = Evaluator(model, request).at(theta)
    aliases = LoopAliases.of(model, theta, definition, ports).at(request.laplace)
    response = close_loops(definition, ports, linearised.values, request.laplace, aliases)
    budget = ErrorBudget(definition, linearised, ports, states, response, weights, count)
    if not np.isfinite(budget.rms).all():
        raise InputError(
            "the error has no finite rms value: a mode without damping resonates in the band; give "
            "its springs damping"
        )
    return budget


def budget_lines(definition: BudgetDefinition, poles: Complex) -> tuple[Real, Real, int]:
    """Return lines [Hz], amplitude of each source at each (n_freq, n_source), and their number.

    The amplitude is the root of density times weight of a line of the integral, and the rms of a
    sine at its own line. The number is that of the lines of the integral, which come first.

    Args:
        definition: sources and band.
        poles: of the machine with its loops [rad/s]; (n_pole,).
    """
    spectra = [source.spectrum for source in definition.sources if source.spectrum is not None]
    edges = np.unique(np.concatenate([np.zeros(0), *(each.freq_hz for each in spectra)]))
    lines = integration_lines(definition.band, poles, edges[edges > 0])
    steps = trapezoid_weights(lines)
    sines = [source.lines for source in definition.sources]
    freq = np.concatenate([lines, *(each.freq_hz for each in sines if each is not None)])
    weights = np.zeros((len(freq), len(definition.sources)))
    start = len(lines)
    for column, source in enumerate(definition.sources):
        if source.spectrum is not None:
            density = source.spectrum.at(lines, source.derivative)
            weights[: len(lines), column] = np.sqrt(density * steps)
        if source.lines is not None:
            count = len(source.lines.freq_hz)
            weights[start : start + count, column] = source.lines.amplitude / np.sqrt(2)
            start += count
    return freq, weights, len(lines)


_LINES_PER_DECADE = 200  # between resonances: a density bends little within 1 %
_LINES_PER_RESONANCE = 160  # an even share errs by a part of 1e-4
_WIDEST_ANGLE = 1.53  # of u: 24 half widths away, where the other lines take over
_MIN_RESOLVED_DAMPING = 1e-7  # of a resonance with lines of its own: those below have no finite rms


def integration_lines(band: tuple[float, float], poles: Complex, edges: Real) -> Real:
    """Return frequency lines that resolve resonances and the edges of spectra; (n_freq,).

    Args:
        band: lowest and highest frequency [Hz].
        poles: of the machine with its loops [rad/s]; (n_pole,).
        edges: lines of the spectra [Hz]; (n_edge,). A density may jump at each.
    """
    low, high = band
    count = int(np.ceil(_LINES_PER_DECADE * np.log10(high / low))) + 2
    angles = np.tan(np.linspace(-_WIDEST_ANGLE, _WIDEST_ANGLE, _LINES_PER_RESONANCE))
    oscillating = poles[poles.imag > 0]
    natural = np.abs(oscillating.imag) / (2 * np.pi)
    half_width = np.maximum(np.abs(oscillating.real) / (2 * np.pi), _MIN_RESOLVED_DAMPING * natural)
    near = (natural[:, None] + half_width[:, None] * angles).ravel()
    lines = np.concatenate(
        [np.geomspace(low, high, count), near, edges * (1 - 1e-9), edges, edges * (1 + 1e-9)]
    )
    return np.unique(np.append(lines[(lines > low) & (lines < high)], band))


def trapezoid_weights(freq_hz: Real) -> Real:
    """Return the weights of the trapezoidal rule [Hz]; (n_freq,)."""
    steps = np.diff(freq_hz)
    return (np.append(steps, 0.0) + np.append(0.0, steps)) / 2
