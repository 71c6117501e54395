r"""An error budget in time: its sources as random signals, its loops closed, its errors recorded.

A source of density S is the sum of its lines with random amplitudes, whose expected squares are S
over the width of a line. Sources of the coherence C have L z as amplitudes, with L L^H = C and
independent z. Its sines have random phases. All begin in the run-in before time 0, smoothly: the
displacement of the floor is multiplied by a window w, so that its acceleration is w a + 2 w' v +
w'' x, and nothing drifts. From time 0 on the machine moves as it does all the time.

The mean square over a time T scatters about that of the budget with the variance of a Gaussian
signal, integral of S_e^2 df / T (Bendat and Piersol 2010, ch. 8).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import InputError, Loop, Quantity, Real, UsageError, sampling_period
from mbmodel import Machine, as_drawn
from mbmodel.ports.signal_rows import is_floor
from mbmodel.simulation.drives import Drive, LoopSignal, Reading
from mbmodel.simulation.response import TimeResponse, simulate
from tuning.control_loops.stability import growing_pole, instability_sentence
from tuning.plant.error_budget.budget import error_budget, trapezoid_weights
from tuning.plant.error_budget.closed_loop_states import loop_states
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.loop_algebra import map_ports

_SAMPLES_PER_PERIOD = 8.0  # of the highest frequency, so that a spline through them errs by 5e-4
_RUN_IN_TIME_CONSTANTS = 6.0  # of the slowest pole that decays
_MAX_RUN_IN = 1.0  # of the duration
_MIN_POLE_RAD_S = 1e-3  # slower ones are rigid-body motions, which nothing settles


@dataclass(frozen=True, eq=False)
class SimulatedErrors:
    """Response in time to the sources of a budget, from time 0 on.

    Args:
        definition: errors, sources and loops.
        response: of the machine; its ``watched`` signals are the errors.
        predicted: rms of each error by the budget; None where it has none, or beside further
            signals; (n_error,).
        scatter: standard deviation of the simulated rms over the predicted one; (n_error,).
        remarks: sentences on what stands between both.
    """

    definition: BudgetDefinition
    response: TimeResponse
    predicted: Real | None
    scatter: Real | None
    remarks: tuple[str, ...]

    @property
    def rms(self) -> Real:
        """Root mean square of each error over the time; (n_error,)."""
        errors = self.response.watched
        return np.zeros(0) if errors is None else np.sqrt((errors**2).mean(axis=0))


def sampled_rate(definition: BudgetDefinition, rate_hz: float) -> float:
    """Return the least rate from a given one on that holds all sources and divides the loops [Hz].

    Args:
        rate_hz: least rate [Hz].
    """
    rate = max(rate_hz, _SAMPLES_PER_PERIOD * _highest_frequency(definition))
    return whole_rate(definition.loops, rate)


def whole_rate(loops: Sequence[Loop], rate_hz: float) -> float:
    """Return the least rate from a given one on of which the sampling of loops is a part [Hz]."""
    period = sampling_period(loops)
    return float(np.ceil(rate_hz * period - 1e-9)) / period if period else rate_hz


def _highest_frequency(definition: BudgetDefinition) -> float:
    """Return the highest frequency of the sources [Hz]."""
    tops = [0.0]
    for source in definition.sources:
        if source.spectrum is not None:
            tops.append(min(source.spectrum.band[1], definition.band[1]))
        if source.lines is not None:
            tops.append(float(source.lines.freq_hz.max()))
    return max(tops)


def source_signals(
    machine: Machine, definition: BudgetDefinition, time_s: Real, run_in_s: float, seed: int
) -> dict[Drive, Real]:
    """Return the sources of a budget as random signals at the inputs of a machine.

    Args:
        machine: with the inputs.
        time_s: evenly spaced [s]; (n_time,).
        run_in_s: time over which they rise from nothing [s].
        seed: of the random numbers.

    Returns:
        Signal of each input, and noise of each loop; (n_time,) each.
    """
    random, count, step = np.random.default_rng(seed), len(time_s), time_s[1] - time_s[0]
    freq = np.fft.rfftfreq(count, step)
    low, high = definition.band
    inside = (freq >= low) & (freq <= high) & (freq > 0)
    values, vectors = np.linalg.eigh(definition.coherence)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    shape = len(freq), len(definition.sources)
    independent = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    amplitudes = independent @ factor.T
    windows = _window(time_s - time_s[0], run_in_s)
    signals: dict[Drive, Real] = {}
    for column, source in enumerate(definition.sources):
        lines = np.zeros(len(freq), complex)
        if source.spectrum is not None:
            density = source.spectrum.at(freq[inside], source.derivative)
            lines[inside] = np.sqrt(density * count / (4 * step)) * amplitudes[inside, column]
        sines = source.lines
        phases = random.uniform(0, 2 * np.pi, 0 if sines is None else len(sines.freq_hz))
        loop = LoopSignal(source.noise_of, "noise")
        for drive, gain in source.inputs or ((loop, 1.0),):
            moves = not isinstance(drive, LoopSignal) and is_floor(machine, drive)
            signal = np.zeros(count)
            # The window acts on the displacement of the floor, by the rule of Leibniz.
            for order, binomial in ((0, 1.0), (1, 2.0), (2, 1.0)) if moves else ((0, 1.0),):
                omega = 2j * np.pi * np.where(freq > 0, freq, 1.0)
                whole = np.fft.irfft(gain * lines / omega**order, count)
                if sines is not None:
                    turn = np.exp(1j * (2 * np.pi * np.outer(time_s, sines.freq_hz) + phases))
                    rates = (2j * np.pi * sines.freq_hz) ** order
                    whole += (turn @ (gain * sines.amplitude / rates)).real
                signal += binomial * windows[order] * whole
            signals[drive] = signals.get(drive, 0.0) + signal
    return signals


def _window(since_s: Real, rise_s: float) -> tuple[Real, Real, Real]:
    """Return a smooth rise from 0 to 1 and its first two derivatives; (n_time,) each."""
    rise = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
    place = np.clip(since_s / rise_s, 0.0, 1.0)
    return rise(place), rise.deriv()(place) / rise_s, rise.deriv(2)(place) / rise_s**2


def instability_remark(machine: Machine, definition: BudgetDefinition) -> str:
    """Return that the linear machine is unstable with its loops; empty if it is stable."""
    if not definition.loops:
        return ""
    model = as_drawn(machine)
    poles = loop_states(model, model.drawn, definition, map_ports(definition)).poles()
    pole, names = growing_pole(poles), ", ".join(loop.name for loop in definition.loops)
    return "" if pole is None else instability_sentence("the linear machine", names, "", pole)


def run_in_time(machine: Machine, definition: BudgetDefinition, duration_s: float) -> float:
    """Return the time in which a machine with its loops settles [s], at most the duration."""
    model = as_drawn(machine)
    poles = loop_states(model, model.drawn, definition, map_ports(definition)).poles()
    decaying = -poles.real[poles.real < -_MIN_POLE_RAD_S]
    slowest = _RUN_IN_TIME_CONSTANTS / decaying.min(initial=np.inf)
    return float(np.clip(slowest, 0.05 * duration_s, _MAX_RUN_IN * duration_s))


def simulate_budget(  # one for each thing that a simulation needs
    machine: Machine,
    definition: BudgetDefinition,
    time_s: Real,
    played: Mapping[Drive, Real],
    outputs: Sequence[Reading] = (),
    *,
    quantity: Quantity = "receptance",
    spin: Mapping[str, float] | None = None,
    seed: int = 0,
) -> SimulatedErrors:
    """Simulate a machine under the sources of a budget, with its loops closed.

    Args:
        machine: without loops of its own; its joints may be nonlinear.
        definition: errors, sources and loops.
        time_s: evenly spaced from 0 on [s]; (n_time,).
        played: further signals by their input, such as references of loops; (n_time,) each. One at
            the input of a loop is added to its control before the limit.
        outputs: further outputs.
        quantity, spin: as for ``mbmodel.simulate``.
        seed: of the random numbers.

    Raises:
        UsageError: samples that do not hold the spectra or do not divide the sampling period.
        ConvergenceError: the motion grows without bound.
    """
    step, duration = time_s[1] - time_s[0], time_s[-1] - time_s[0]
    top = _highest_frequency(definition)
    if definition.sources and top * step * _SAMPLES_PER_PERIOD > 1 + 1e-9:
        raise UsageError(
            f"the sources reach to {top:.4g} Hz, which samples at {1 / step:.4g} Hz do not hold: "
            f"give a rate of {_SAMPLES_PER_PERIOD * top:.4g} Hz at least, or lower the band"
        )
    settle = run_in_time(machine, definition, duration) if definition.sources else 0.0
    before = int(np.ceil(settle / step))
    axis = (np.arange(len(time_s) + before) - before) * step
    signals: dict[Drive, Real] = {}
    if definition.sources:
        signals = source_signals(machine, definition, axis, before * step, seed)
    loops = {str(loop.input): loop.name for loop in definition.loops}
    for port, values in played.items():
        drive = LoopSignal(loops[str(port)], "command") if str(port) in loops else port
        early = np.full(before, values[0])
        signals[drive] = signals.get(drive, 0.0) + np.concatenate([early, values])
    response = simulate(
        machine,
        tuple(signals),
        outputs,
        axis,
        np.stack([*signals.values()], axis=1),
        quantity=quantity,
        spin=spin,
        loops=definition.loops,
        watched=definition.errors,
    )
    kept = replace(
        response,
        time_s=time_s,
        outputs=response.outputs[before:],
        watched=None if response.watched is None else response.watched[before:],
        loops=tuple(loop.since(before, time_s) for loop in response.loops),
    )
    predicted = (None, None, ()) if played else _predict_rms(machine, definition, duration)
    return SimulatedErrors(definition, kept, *predicted)


def _predict_rms(
    machine: Machine, definition: BudgetDefinition, duration_s: float
) -> tuple[Real | None, Real | None, tuple[str, ...]]:
    """Return the rms of the budget, the relative scatter of a simulated one, and remarks."""
    if not (definition.errors and definition.sources):
        return None, None, ()
    model = as_drawn(machine)
    try:
        budget = error_budget(model, model.drawn, definition)
    except InputError as error:
        return None, None, (f"The budget of the linear machine: {error}.",)
    lines, density = budget.density()
    power = (trapezoid_weights(lines)[:, None] * density**2).sum(axis=0) / duration_s
    mean_square = np.where(budget.rms > 0, budget.rms, 1.0) ** 2
    return budget.rms, np.sqrt(power) / mean_square / 2, ()
