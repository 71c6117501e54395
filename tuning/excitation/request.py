r"""What is asked of an excitation: drives with limits, outputs with noise, band, time and rate.

An encoder that counts steps q at the rate f rounds its position, which is white noise of the
one-sided density q^2 / (6 f) (Widrow and Kollar 2008, ch. 4).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from identification.words import Dof, Input, Output, Quantity, Real, Signal, UsageError
from mbmodel import (
    Machine,
    Noise,
    as_drawn,
    model_modes,
    output_unit,
    parse_input,
    parse_output,
    usual_quantity,
)
from mbmodel.modes.modal_overlap import highest_separate_mode
from tuning.excitation.limits import DriveLimits, motion_of
from tuning.excitation.record_plan import RATE_OVER_BAND

Kind = Literal["multisine", "sweep"]
KINDS: tuple[Kind, ...] = ("multisine", "sweep")
DEFAULT_SECONDS = 60.0
DEFAULT_STEP = 1e-6  # m or rad: of an encoder whose noise nobody states
_BAND_MARGIN = (0.5, 1.2)  # of the default band, about the modes that a test tells apart
_MAX_NUMBERS = 1e8  # of a record: 0.8 GB, and as much again for its noise and its text
_NICE_RATES = (1.0, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0)  # of controllers, times a power of ten


@dataclass(frozen=True, eq=False)
class ExcitationRequest:
    """What is asked of an excitation.

    Args:
        limits: limits of each drive, in the order of the signals.
        outputs: what is recorded.
        noise: white noise of each output, one-sided [unit / sqrt(Hz)]; (n_out,).
        band: lowest and highest frequency [Hz].
        seconds: length of the record, at most [s].
        rate_hz: samples per second.
        quantity: of the FRFs, for outputs that are points.
        kind: ``multisine`` with a low peak, or ``sweep``.
    """

    limits: Mapping[Input, DriveLimits]
    outputs: tuple[Output, ...]
    noise: Real
    band: tuple[float, float]
    seconds: float
    rate_hz: float
    quantity: Quantity = "accelerance"
    kind: Kind = "multisine"

    @property
    def drives(self) -> tuple[Input, ...]:
        """The drives."""
        return tuple(self.limits)


@dataclass(frozen=True)
class ExcitationOptions:
    """What a user states, by labels; empty and None for the defaults.

    Args:
        limits: limits of each drive.
        outputs: what is recorded; encoders and accelerometers of the model by default.
        noise: white noise of outputs, one-sided [unit / sqrt(Hz)].
        steps: smallest steps of encoders [unit].
        band: lowest and highest frequency [Hz]; that of the modes by default.
        seconds: length of the record, at most [s].
        rate_hz: samples per second; five times the band by default, or a little more.
        kind: ``multisine`` or ``sweep``.
        ignored: channels that are no outputs by default.
    """

    limits: Mapping[str, DriveLimits]
    outputs: Sequence[str] = ()
    noise: Mapping[str, float] = field(default_factory=dict)
    steps: Mapping[str, float] = field(default_factory=dict)
    band: tuple[float, float] | None = None
    seconds: float = DEFAULT_SECONDS
    rate_hz: float | None = None
    kind: str = "multisine"
    ignored: Sequence[str] = ()


def build_request(
    machine: Machine, options: ExcitationOptions
) -> tuple[ExcitationRequest, tuple[str, ...]]:
    """Return the request that a user's options mean for a machine.

    Args:
        machine: with its loops closed.

    Returns:
        The request, and remarks on what was assumed.

    Raises:
        UsageError: a label or value that cannot be used.
    """
    kind = next((kind for kind in KINDS if kind == options.kind), None)
    if kind is None:
        raise UsageError(f"--kind {options.kind!r}: write one of {', '.join(KINDS)}")
    if not options.limits:
        names = ", ".join(machine.motors) or "no motor; name a force such as acc1:+tx"
        raise UsageError(f"no drive is named (the model has {names}): state --drives and --limits")
    drives = [parse_input(machine, name) for name in options.limits]
    _refuse_repeated("drive", list(options.limits), drives)
    limits = dict(zip(drives, options.limits.values(), strict=True))
    outputs = _find_outputs(machine, drives, options.outputs, options.ignored)
    quantity = usual_quantity(outputs)
    band = options.band or _default_band(machine)
    rate_hz = options.rate_hz or _nice_rate(RATE_OVER_BAND * band[1])
    for name, value in (("--seconds", options.seconds), ("--rate", rate_hz)):
        if not (np.isfinite(value) and value > 0):
            raise UsageError(f"{name} {value:g}: give a number above 0")
    numbers = options.seconds * rate_hz * (len(limits) + len(outputs))
    if numbers > _MAX_NUMBERS:
        raise UsageError(
            f"--seconds {options.seconds:g} and --rate {rate_hz:g} make a record of {numbers:.2g} "
            f"numbers, more than {_MAX_NUMBERS:g}: lower one of them"
        )
    noise, remarks = _find_noise(machine, outputs, quantity, options, rate_hz)
    request = ExcitationRequest(
        limits, outputs, noise, band, options.seconds, rate_hz, quantity, kind
    )
    return request, remarks


def _find_outputs(
    machine: Machine, drives: Sequence[Input], labels: Sequence[str], ignored: Sequence[str]
) -> tuple[Output, ...]:
    """Return what is recorded: what is stated, or encoders and accelerometers."""
    if labels:
        outputs = tuple(parse_output(machine, label) for label in labels)
        _refuse_repeated("--output", labels, outputs)
        if any(isinstance(port, Dof) for port in outputs):
            joints = [str(p) for p in outputs if isinstance(p, Signal) and p.is_joint]
            if joints:
                raise UsageError(
                    f"{joints[0]} is a position beside accelerations in one record: give the model "
                    "a jointpos sensor there, and name it instead"
                )
        return outputs
    encoders = [
        Signal(name)
        for name, reading in machine.sensors.readings.items()
        if reading.unit in ("m", "rad") and (reading.joint.any() or reading.body.any())
    ]
    channels = (Dof.of(site, axis) for site in machine.layout.sensors for axis in range(3))
    points = [channel for channel in channels if str(channel) not in ignored]
    places = [motion_of(machine, drive) for drive in drives if not (encoders or points)]
    return (*encoders, *points, *dict.fromkeys(places))


def _refuse_repeated(what: str, labels: Sequence[str], ports: Sequence[Input | Output]) -> None:
    """Refuse two labels of one place and direction, of either sign."""
    places = [port.positive for port in ports]
    for label, place, number in zip(labels, places, range(len(places)), strict=True):
        first = places.index(place)
        if first < number:
            raise UsageError(f"{what} {label} is {labels[first]} once more: name it once")


def _find_noise(
    machine: Machine,
    outputs: Sequence[Output],
    quantity: Quantity,
    options: ExcitationOptions,
    rate_hz: float,
) -> tuple[Real, tuple[str, ...]]:
    """Return the noise of each output [unit / sqrt(Hz)], and remarks on what was assumed."""
    names = [str(port) for port in outputs]
    for name, value in (*options.noise.items(), *options.steps.items()):
        if name not in names:
            raise UsageError(f"noise of {name}: it is no output; outputs are {', '.join(names)}")
        if not (np.isfinite(value) and value > 0):
            raise UsageError(f"noise of {name} is {value:g}: give a number above 0")
    stated = {name: step / np.sqrt(6 * rate_hz) for name, step in options.steps.items()}
    stated |= options.noise
    assumed: dict[str, str] = {}
    for name, port in zip(names, outputs, strict=True):
        if name in stated:
            continue
        unit = output_unit(machine, port, quantity)
        if unit in ("m", "rad"):
            stated[name] = DEFAULT_STEP / np.sqrt(6 * rate_hz)
            assumed[name] = f"{name} with steps of {DEFAULT_STEP:g} {unit}"
        elif isinstance(port, Dof):
            stated[name] = Noise().motion
            assumed["points"] = f"accelerometers with {Noise().motion:g} {unit}/sqrt(Hz)"
        else:
            raise UsageError(f"{name} reads {unit}: state its noise, --noise {name}=DENSITY")
    density = np.array([stated[name] for name in names])
    if not assumed:
        return density, ()
    return density, (
        "intervals follow the noise of the sensors, which is not stated of all of them; assumed: "
        f"{', '.join(assumed.values())}; state --noise or --resolution",
    )


def _default_band(machine: Machine) -> tuple[float, float]:
    """Return the band of the modes that a test can tell apart [Hz]."""
    model = as_drawn(machine)
    modes = model_modes(model, model.drawn)
    natural, damping = (array[modes.oscillates] for array in (modes.freq_hz, modes.damping))
    highest = highest_separate_mode(natural, damping)
    if not highest:
        raise UsageError(f"{machine.source} has no mode below critical damping: state --band")
    return _BAND_MARGIN[0] * float(natural.min()), _BAND_MARGIN[1] * highest


def _nice_rate(least_hz: float) -> float:
    """Return the next usual rate of a controller above a rate [Hz]."""
    decade = 10.0 ** np.floor(np.log10(least_hz))
    return float(min(step * decade for step in _NICE_RATES if step * decade >= least_hz))
