r"""Excitation of a machine by its drives, designed for what is to be found.

Power is allotted over lines and drives so that the intervals of all stiffnesses have the smallest
joint volume (``input_spectra``), by the derivatives of the FRFs at the nominal model. Dampings are
estimated too; other tolerances are left out of the design, but not out of the intervals. A signal
of the power v [unit^2] at a line lasts T in all periods that count; noise of the one-sided density
S of an output then gives its FRF by one drive the variance

    E|error|^2 = S / (T v).

A relative error of the force, which every fit counts, is added to it.
Limits bound peaks, and the design bounds rms values: each limit is divided by the crest factor that
the signals of the step before have. In the end all signals are scaled to the limit that is met.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.continuous import leakage_noise_factor
from identification.words import (
    Campaign,
    Complex,
    Condition,
    Frf,
    FrfEstimate,
    Mask,
    Real,
    Test,
    Tolerance,
    UnknownGains,
)
from mbmodel import Evaluator, FrfRequest, Machine, Model, Part, input_unit, model_modes
from tuning.assessment.parameter_confidence import posterior_precision
from tuning.excitation.input_spectra import (
    LineInformation,
    SpectrumDesign,
    design_spectrum,
    lower_peak,
    orthogonal_turns,
    periodic_waveform,
    schroeder_phases,
)
from tuning.excitation.limits import LimitedSignal, drive_command, limited_signals
from tuning.excitation.record_plan import RecordPlan, plan_record
from tuning.excitation.request import ExcitationRequest
from tuning.misfit.weights import FORCE_ERROR_FLOOR, point_power_of
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.parametrisation.user_specification import (
    UserSpecification,
    fitting_specification,
    parametrise,
)
from tuning.toleranced_model import build_toleranced_model
from tuning.unknown_gains import with_unit_gains

_START_CREST = 1.8  # of a multisine after swapping, and of a sweep
_DESIGNS = 3  # of the power, each with the crest factors of the one before
_MIN_LINE_SHARE = 4e-6  # of the strongest line's power: readers leave out lines below 1e-6
_MAX_FACTOR_ENTRIES = 3e7  # of X_i, 240 MB: lines are thinned beyond it
SPRING_KINDS = ("stiffness", "damping", "undrawn_damping")


@dataclass(frozen=True, eq=False)
class Excitation:
    """Signals of drives, and the model at which they were designed.

    Args:
        request: what was asked.
        plan: periods and lines.
        model: machine with all that can vary as Parts.
        parametrisation: coordinates of its parameters.
        theta: parameters at which it was designed [SI]; (n_parameter,).
        design: power of lines and drives, before the last scaling.
        amplitudes: of each line, with its phase, exp(+i w t); (n_realisation, n_drive, n_freq).
        limited: signals that limits bound.
        campaign: tests that the nominal machine would give, with their variance.
        of_interest: names of the coordinates for whose intervals it was designed.
        specification: of the user, for the parameters that the test has.
    """

    request: ExcitationRequest
    plan: RecordPlan
    model: Model
    parametrisation: Parametrisation
    theta: Real
    design: SpectrumDesign
    amplitudes: Complex
    limited: tuple[LimitedSignal, ...]
    campaign: Campaign
    of_interest: tuple[str, ...]
    specification: UserSpecification

    @property
    def power(self) -> Real:
        """Power of each line and drive [unit^2]; (n_freq, n_drive)."""
        return np.asarray(np.abs(self.amplitudes[0].T) ** 2 / 2)

    @property
    def periods(self) -> Real:
        """One period of each realisation and drive; (n_realisation, n_drive, n_sample)."""
        return periodic_waveform(self.amplitudes, self.plan.lines, self.plan.samples)

    def waveforms(self, response: Complex) -> Real:
        """Return a period of what the drives move together; (n_realisation, n_sample).

        Args:
            response: per unit of each drive; (n_freq, n_drive).
        """
        moved = np.einsum("rdf,fd->rf", self.amplitudes, response)
        return periodic_waveform(moved, self.plan.lines, self.plan.samples)

    def peaks(self) -> list[float]:
        """Return the largest value of each limited signal [unit]."""
        return [float(np.abs(self.waveforms(each.response)).max()) for each in self.limited]

    def repeat(self, periods: Real) -> Real:
        """Return the whole record of periods of signals; (n_signal, n_time).

        Args:
            periods: (n_realisation, n_signal, n_sample).
        """
        return np.asarray(np.concatenate(list(np.tile(periods, self.plan.periods)), axis=1))


def design_excitation(
    machine: Machine,
    request: ExcitationRequest,
    tolerance: Tolerance | None = None,
    specification: UserSpecification | None = None,
    *,
    parts: Sequence[Part] = (),
    of_interest: Sequence[str] = (),
    unknown_gains: UnknownGains | None = None,
) -> Excitation:
    """Design the signals of drives for the shortest intervals of all stiffnesses.

    Args:
        machine: with its loops closed as in the test.
        request: drives with their limits, outputs with their noise, band and time.
        tolerance: of the drawings; the default if None.
        specification: of the user, for the parameters.
        parts: causes that the machine may have beside all that tolerances allow, and instruments
            that hang on it.
        of_interest: names of their coordinates, for which the signals are designed; all stiffnesses
            if empty.
        unknown_gains: sensors and drives of unknown gain; None for none.

    Raises:
        UsageError: a label, a limit, band, rate or time that cannot be used.
    """
    tolerance = tolerance or Tolerance()
    probe = predict_tests(machine, request, np.array([1.0]), None, tolerance)
    probe = with_unit_gains(replace(probe, unknown_gains=unknown_gains or UnknownGains()))
    model = build_toleranced_model(machine, probe)
    model = Model(machine, (*model.parts, *parts))
    names = [parameter.name for parameter in model.parameters]
    specification = fitting_specification(specification or UserSpecification(), names)
    parametrisation = parametrise(model, tolerance, specification)
    theta = parametrisation.start
    modes = model_modes(model, theta)
    plan = plan_record(modes, request.band, request.seconds, request.rate_hz, len(request.limits))
    limited = limited_signals(model, theta, plan.freq_hz, request.limits)
    chosen, interest = _choose_coordinates(parametrisation, of_interest)
    empty = np.zeros((len(request.drives), len(request.drives), len(plan.lines)), np.complex128)
    designed_for = tuple(np.array(parametrisation.names)[chosen][interest].tolist())
    excitation = Excitation(
        request,
        plan,
        model,
        parametrisation,
        theta,
        SpectrumDesign(np.zeros((0, 0)), 0.0, 0.0, 0.0),
        empty,
        tuple(limited),
        probe,
        designed_for,
        specification,
    )
    excitation = _design_signals(excitation, chosen, interest)
    predicted = predict_tests(machine, request, plan.freq_hz, excitation, tolerance)
    return replace(excitation, campaign=replace(probe, tests=predicted.tests))


def _choose_coordinates(varies: Parametrisation, of_interest: Sequence[str]) -> tuple[Mask, Mask]:
    """Return coordinates of the design; (n_x,), and those of interest among them; (n_chosen,)."""
    kinds = dict.fromkeys(varies.names, "")
    kinds |= {parameter.name: parameter.known for parameter in varies.parameters}
    prior_kinds = np.array([kinds[name] for name in varies.names])
    named = np.isin(np.array(varies.names), list(of_interest))
    chosen = np.isin(prior_kinds, SPRING_KINDS) | named
    wanted = named if named.any() else prior_kinds == "stiffness"
    wanted = wanted if wanted.any() else chosen
    return chosen, wanted[chosen]


def _design_signals(excitation: Excitation, chosen: Mask, interest: Mask) -> Excitation:
    """Return the excitation with its power, phases and scale."""
    freq_hz = excitation.plan.freq_hz
    stride = _choose_stride(excitation, int(chosen.sum()))
    thin = np.arange(stride // 2, len(freq_hz), stride)
    factors, saturation = _line_factors(excitation, freq_hz[thin], chosen)
    x = excitation.parametrisation.coordinates(excitation.theta)
    precision = posterior_precision(excitation.parametrisation, x)[chosen]
    # A line that is designed stands for all those about it.
    information = LineInformation(factors * np.sqrt(stride), saturation, precision, interest)
    crests = np.full(len(excitation.limited), _START_CREST)
    for _ in range(_DESIGNS):
        costs = np.array(
            [
                np.abs(signal.response[thin]) ** 2 * stride * (crest / signal.limit) ** 2
                for signal, crest in zip(excitation.limited, crests, strict=True)
            ]
        )
        design = design_spectrum(information, costs)
        power = np.stack([np.interp(freq_hz, freq_hz[thin], row) for row in design.power.T], axis=1)
        power = np.maximum(power, _MIN_LINE_SHARE * power.max(axis=0))
        amplitudes = _phase(excitation, power, (costs * design.power).sum(axis=1))
        excitation = replace(excitation, design=design, amplitudes=amplitudes)
        peaks = np.array(excitation.peaks())
        rms = [
            excitation.waveforms(signal.response).std(axis=1).max() for signal in excitation.limited
        ]
        crests = np.where(np.array(rms) > 0, peaks / np.maximum(rms, 1e-300), crests)
    used = max(peak / each.limit for peak, each in zip(peaks, excitation.limited, strict=True))
    return replace(excitation, amplitudes=excitation.amplitudes / used)


def _choose_stride(excitation: Excitation, coordinates: int) -> int:
    """Return which n-th lines are designed."""
    request = excitation.request
    entries = 2 * len(excitation.plan.lines) * len(request.drives) * len(request.outputs)
    return int(np.ceil(entries * coordinates / _MAX_FACTOR_ENTRIES))


def _line_factors(excitation: Excitation, freq_hz: Real, chosen: Mask) -> tuple[Real, Real]:
    """Return X_i of some coordinates; (n_freq, n_drive, n_row, n_x), and R_i."""
    request, varies = excitation.request, excitation.parametrisation
    frfs = FrfRequest(freq_hz, request.outputs, request.drives, request.quantity)
    lines = Evaluator(excitation.model, frfs).at(excitation.theta)
    numbers = np.append(np.where(chosen, np.cumsum(chosen) - 1, -1), -1)[varies.coordinate_of]
    acting = numbers >= 0
    rates = varies.rates(varies.coordinates(excitation.theta))
    columns = lines.sensitivities(acting, rates, numbers[acting]).columns()
    density = output_noise(excitation.model, excitation.theta, request, freq_hz)
    weight = np.sqrt(2 * excitation.plan.counted_s) / density
    scaled = (columns * weight[:, :, None, None]).swapaxes(1, 2)
    errors = FORCE_ERROR_FLOOR**2 * point_power_of(lines.values, request.outputs)
    ratio = (errors * (weight**2 / 2)[:, :, None]).swapaxes(1, 2)
    return np.concatenate([scaled.real, scaled.imag], axis=2), np.tile(ratio, 2)


def output_noise(model: Model, theta: Real, request: ExcitationRequest, freq_hz: Real) -> Real:
    """Return the noise of the outputs, one-sided [unit / sqrt(Hz)]; (n_freq, n_out).

    A controller feeds back the noise of what it reads, which the sensitivity 1 / (1 + K H) scales.

    Args:
        model: machine with its loops closed.
        theta: parameters [SI]; (n_parameter,).
        request: outputs with their noise.
        freq_hz: lines [Hz]; (n_freq,).
    """
    noise = np.tile(request.noise, (len(freq_hz), 1))
    for loop in model.machine.loops:
        read = [port for port, _ in loop.measured.terms]
        for row, output in enumerate(request.outputs):
            if read == [output]:
                noise[:, row] *= np.abs(
                    drive_command(model, theta, freq_hz, (loop.input,), 0)[:, 0]
                )
    return noise


def _phase(excitation: Excitation, power: Real, used: Real) -> Complex:
    """Return amplitudes with phases; (n_realisation, n_drive, n_freq).

    The peak is low of what is nearest to its limit, for each drive.

    Args:
        excitation: drives, lines and limits.
        power: of all lines; (n_freq, n_drive).
        used: part of each limit that each drive takes; (n_limit, n_drive).
    """
    plan, columns = excitation.plan, []
    for drive, row in enumerate(power.T):
        amplitude = np.sqrt(2 * row)
        phases = schroeder_phases(row)
        if excitation.request.kind == "multisine":
            response = excitation.limited[int(used[:, drive].argmax())].response[:, drive]
            phases = lower_peak(amplitude * response, plan.lines, plan.samples, phases)
        columns.append(amplitude * np.exp(1j * phases))
    turns = orthogonal_turns(len(power.T))
    return np.asarray(turns[:, :, None] * np.array(columns), np.complex128)


def predict_tests(
    machine: Machine,
    request: ExcitationRequest,
    freq_hz: Real,
    excitation: Excitation | None,
    tolerance: Tolerance,
) -> Campaign:
    """Return a test for each drive, as the nominal machine would give it.

    Args:
        freq_hz: lines [Hz]; (n_freq,).
        excitation: signals; None for FRFs without values, which say what is read.
    """
    shape = (len(freq_hz), len(request.outputs), len(request.drives))
    values, variance, averages = np.zeros(shape, complex), np.ones(shape), 2
    if excitation is not None:
        frfs = FrfRequest(freq_hz, request.outputs, request.drives, request.quantity)
        values = Evaluator(excitation.model, frfs).at(excitation.theta).values
        density = output_noise(excitation.model, excitation.theta, request, freq_hz)
        plan = excitation.plan
        energy = plan.counted_s * np.maximum(excitation.power, np.finfo(float).tiny)
        # The lines between those of the force tell what leaks, and leave some of their noise.
        factor = leakage_noise_factor(plan.periods - 1)
        variance = factor * density[:, :, None] ** 2 / energy[:, None, :]
        averages = plan.averages
    tests = []
    for column, drive in enumerate(request.drives):
        frf = Frf(freq_hz, values[:, :, [column]], request.outputs, (drive,), request.quantity)
        estimate = FrfEstimate(
            frf,
            variance[:, :, [column]],
            "stated",
            np.ones((len(request.outputs), 1), bool),
            averages=averages,
        )
        unit = input_unit(machine, drive)
        tests.append(Test(Condition("predicted", drive, drive_unit=unit), estimate))
    return Campaign(machine.name, machine.layout, tuple(tests), tolerance=tolerance)
