"""FRFs and frequency lines that a prediction is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import (
    MAX_FREQUENCY_HZ,
    MIN_FREQUENCY_HZ,
    Dof,
    Input,
    Output,
    Quantity,
    Real,
    UsageError,
    parse_quantity,
)
from mbmodel import (
    Evaluator,
    FrfRequest,
    Machine,
    Model,
    Modes,
    as_drawn,
    parse_input,
    parse_output,
    usual_quantity,
)
from mbw.site_kinds import hammer_sites, sensor_sites

DEFAULT_BAND_HZ = (0.0, 200.0)
_MIN_SHOWN_FREQUENCY = 0.1  # of the default band's upper limit; a mode above it is shown well
_MAX_BAND_MODES = 12  # modes that a band above or below the default one includes


@dataclass(frozen=True)
class PredictRequest:
    """Inputs, outputs and frequency lines of FRFs or of a state space.

    Args:
        inputs, outputs: labels; empty for all hammer points and all accelerometers.
        quantity: quantity of the outputs.
        band: lowest and highest frequency [Hz]; None for 0..200 Hz, on the page for the band that
            holds the modes.
        lines: number of frequency lines.
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    quantity: str | None
    band: tuple[float, float] | None
    lines: int


def frf_request(machine: Machine, request: PredictRequest, *, is_needed: bool) -> FrfRequest | None:
    """Return the request of FRFs.

    Args:
        machine: with its labels.
        request: as the user states it.
        is_needed: whether an output needs labels, so that an empty request means all; otherwise
            None is returned for it.

    Raises:
        UsageError: a band, quantity or label that cannot be used.
    """
    lines = band_lines(request)
    quantity = read_quantity(request)
    if not (is_needed or request.inputs or request.outputs):
        return None
    layout = machine.layout
    inputs: tuple[Input, ...] = tuple(parse_input(machine, text) for text in request.inputs)
    outputs: tuple[Output, ...] = tuple(parse_output(machine, text) for text in request.outputs)
    if request.quantity is None:
        quantity = usual_quantity(outputs)
    frfs = FrfRequest(
        lines,
        outputs or _axes(sensor_sites(layout)),
        inputs or _axes(hammer_sites(layout) or sensor_sites(layout)),
        quantity,
    )
    model = as_drawn(machine)
    Evaluator(model, frfs)  # refuses unknown labels before anything is written
    if request.band is None and not _responds_at_rest(model, frfs):
        return replace(frfs, freq_hz=lines[1:])
    return frfs


def _responds_at_rest(model: Model, request: FrfRequest) -> bool:
    """Return whether a machine has a finite response at 0 Hz, as no free machine has."""
    try:
        Evaluator(model, replace(request, freq_hz=np.zeros(1))).at(model.drawn)
    except UsageError:
        return False
    return True


def band_lines(request: PredictRequest) -> Real:
    """Return the frequency lines of the user's band, 0..200 Hz by default; (n_freq,).

    Raises:
        UsageError: a band without lines, or beyond the frequencies of machines.
    """
    low, high = request.band or DEFAULT_BAND_HZ
    if not 0 <= low < high:
        raise UsageError(f"the band {low:g}..{high:g} Hz is empty: give LOW below HIGH")
    if not MIN_FREQUENCY_HZ <= high <= MAX_FREQUENCY_HZ:
        raise UsageError(
            f"the band ends at {high:g} Hz, where no machine has modes: give HIGH in Hz, from "
            f"{MIN_FREQUENCY_HZ:g} to {MAX_FREQUENCY_HZ:g}"
        )
    return np.linspace(low, high, request.lines)


def read_quantity(request: PredictRequest) -> Quantity:
    """Return the quantity of a request; the accelerance without one."""
    return "accelerance" if request.quantity is None else parse_quantity(request.quantity)


def _axes(points: Sequence[str]) -> tuple[Dof, ...]:
    if not points:
        raise UsageError("the model has no site: name --input and --output, such as body:+tx")
    return tuple(Dof.of(point, axis) for point in points for axis in range(3))


def frequency_lines(modes: Modes, request: PredictRequest) -> Real:
    """Return frequency lines in the user's band; else in 0..200 Hz, or in a band with modes."""
    band = request.band
    if band is None:
        natural, highest = modes.freq_hz[modes.oscillates], DEFAULT_BAND_HZ[1]
        is_inside = ((natural > _MIN_SHOWN_FREQUENCY * highest) & (natural < highest)).any()
        if is_inside or not natural.size:
            band = DEFAULT_BAND_HZ
        else:
            band = (0.0, 1.5 * float(np.sort(natural)[:_MAX_BAND_MODES][-1]))
    return np.linspace(*band, request.lines)
