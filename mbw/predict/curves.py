"""FRFs of the page of ``mbw predict``: those that the user names, else drive points."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.words import (
    Complex,
    Dof,
    Input,
    Output,
    Port,
    Quantity,
    Real,
    UsageError,
)
from identification.words.ports import FLOOR
from mbmodel import Evaluator, FrfRequest, Machine, Model, Modes
from mbmodel.ports.port_units import CONTROL, input_unit, output_unit
from mbmodel.ports.ports import find_ports
from mbw.site_kinds import hammer_sites

_MAX_CURVES = 300  # FRFs that the page shows; more would make it slow
_MAX_DRIVE_POINTS = 12  # points of which the page shows the drive-point FRFs
_MAX_MOTION_BYTES = 300 * 2**20  # memory of the motions that one evaluation holds
# Distances from a resonance in half-power half widths, at which frequency lines are added.
_RESONANCE_OFFSETS = np.array([-4.0, -2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0, 2.0, 4.0])


Pair = tuple[Output, Input]


@dataclass(frozen=True, eq=False)
class Curves:
    """FRFs with their labels.

    Args:
        freq_hz: frequency lines [Hz]; (n_freq,).
        quantity: quantity of all FRFs.
        labels: ``<output> / <input>`` of each FRF; n_curve.
        groups: group in which each FRF is shown; n_curve.
        units: unit of each FRF; n_curve.
        values: FRFs; (n_curve, n_freq).
        pairs: output and input of each FRF; n_curve.
        before: FRFs of the machine without what is put on it, nan where it lacks a label;
            (n_curve, n_freq); without curves where there is nothing to compare with.
        remark: what is left out or went wrong; empty if nothing.
        interval: both ends of the 95 % interval of each magnitude, (n_curve, n_freq); None for
            none.
    """

    freq_hz: Real
    quantity: Quantity
    labels: tuple[str, ...]
    groups: tuple[str, ...]
    units: tuple[str, ...]
    values: Complex
    pairs: tuple[Pair, ...]
    before: Complex
    remark: str = ""
    interval: tuple[Real, Real] | None = None

    def with_interval(self, request: FrfRequest, ends: tuple[Real, Real]) -> "Curves":
        """Return the curves with the 95 % intervals of their magnitudes.

        Args:
            request: outputs and inputs of the intervals.
            ends: both ends on the lines of the curves; (n_freq, n_out, n_in) each.
        """
        places = [
            (request.outputs.index(out), request.inputs.index(inp)) for out, inp in self.pairs
        ]
        shape = (len(places), len(self.freq_hz))
        low, high = (
            np.array([values[:, out, inp] for out, inp in places]).reshape(shape) for values in ends
        )
        return replace(self, interval=(low, high))


def requested_curves(model: Model, modes: Sequence[Modes], request: FrfRequest) -> Curves:
    """Compute the FRFs of a request; of more than 300 only drive points, or the first ones."""
    pairs: list[Pair] = [(out, inp) for inp in request.inputs for out in request.outputs]
    chosen, remark = pairs, ""
    if len(pairs) > _MAX_CURVES:
        chosen = ([pair for pair in pairs if pair[0] == pair[1]] or pairs)[:_MAX_CURVES]
        what = "drive points" if chosen[0][0] == chosen[0][1] else "first"
        remark = (
            f"Of {len(pairs)} FRFs the {len(chosen)} {what} are shown: name fewer by --input and "
            "--output to see others."
        )
    groups = [f"input {inp}" for _, inp in chosen]
    if remark:
        groups = [out.point for out, _ in chosen]
    return _curves(model, modes, request, chosen, groups, remark)


def drive_points(model: Model, modes: Sequence[Modes], freq_hz: Real, quantity: Quantity) -> Curves:
    """Compute drive-point FRFs of hammer points; of centres of mass if there are none."""
    layout = model.machine.layout
    points = hammer_sites(layout) or list(layout.bodies)
    remark = ""
    if len(points) > _MAX_DRIVE_POINTS:
        remark = (
            f"Drive points of the first {_MAX_DRIVE_POINTS} of {len(points)} points are shown: "
            "name others by --input and --output."
        )
    dofs = [Dof.of(point, axis) for point in points[:_MAX_DRIVE_POINTS] for axis in range(3)]
    request = FrfRequest(freq_hz, tuple(dofs), tuple(dofs), quantity)
    pairs: list[Pair] = [(dof, dof) for dof in dofs]
    return _curves(model, modes, request, pairs, [dof.point for dof in dofs], remark)


def _curves(
    model: Model,
    modes: Sequence[Modes],
    request: FrfRequest,
    pairs: Sequence[Pair],
    groups: Sequence[str],
    remark: str,
) -> Curves:
    freq = _with_lines_at_poles(request.freq_hz, modes)
    try:
        values = _values(model, freq, request.quantity, pairs)
    except UsageError as error:
        pairs, groups, remark = (), (), f"No FRF: {error}."
        values = np.zeros((0, len(freq)), complex)
    moving = [k for k in range(len(pairs)) if values[k].any()]
    return Curves(
        freq,
        request.quantity,
        tuple(f"{pairs[k][0]} / {pairs[k][1]}" for k in moving),
        tuple(groups[k] for k in moving),
        tuple(port_unit(model.machine, request.quantity, *pairs[k]) for k in moving),
        values[moving],
        tuple(pairs[k] for k in moving),
        np.zeros((0, len(freq)), complex),
        remark,
    )


def with_curves_before(curves: Curves, model: Model) -> Curves:
    """Return curves with the FRFs of the machine alone, before something was put on it.

    Args:
        curves: of the combined machine.
        model: the machine alone.
    """
    layout = model.machine.layout
    labels = {*layout.points, *layout.bodies, FLOOR}
    numbers = [
        k
        for k, pair in enumerate(curves.pairs)
        if all(_has_port(model.machine, port, labels) for port in pair)
    ]
    before = np.full(curves.values.shape, np.nan, complex)
    pairs = [curves.pairs[k] for k in numbers]
    before[numbers] = _values(model, curves.freq_hz, curves.quantity, pairs)
    return replace(curves, before=before)


def _has_port(machine: Machine, port: Port, labels: Collection[str]) -> bool:
    """Return whether a machine has a port, as an output or as an input."""
    if isinstance(port, Dof):
        return port.point in labels
    sides: tuple[tuple[tuple[Port, ...], tuple[Port, ...]], ...] = (((port,), ()), ((), (port,)))
    for outputs, inputs in sides:
        try:
            find_ports(machine, outputs, inputs)
        except UsageError:
            continue
        return True
    return False


def _values(model: Model, freq: Real, quantity: Quantity, pairs: Sequence[Pair]) -> Complex:
    """Compute the FRF of each pair; evaluate a limited number of inputs at once."""
    inputs = list(dict.fromkeys(inp for _, inp in pairs))
    size = 16 * len(freq) * (len(model.machine.coordinates) + len({out for out, _ in pairs}))
    step = max(1, _MAX_MOTION_BYTES // size)
    values = np.zeros((len(pairs), len(freq)), complex)
    for start in range(0, len(inputs), step):
        batch = tuple(inputs[start : start + step])
        batch_pairs = [(k, out, inp) for k, (out, inp) in enumerate(pairs) if inp in batch]
        outputs = tuple(dict.fromkeys(out for _, out, _ in batch_pairs))
        request = FrfRequest(freq, outputs, batch, quantity)
        frfs = Evaluator(model, request).at(model.drawn).values
        for k, out, inp in batch_pairs:
            values[k] = frfs[:, outputs.index(out), batch.index(inp)]
    return values


def _with_lines_at_poles(freq: Real, modes: Sequence[Modes]) -> Real:
    """Return the frequency lines above 0 Hz, and further lines around each sharp resonance.

    A resonance is sharp if equally spaced lines could miss its peak.
    """
    natural = np.concatenate([each.freq_hz[each.oscillates] for each in modes])
    damping = np.concatenate([each.damping[each.oscillates] for each in modes])
    half = natural * np.maximum(np.abs(damping), 1e-4)
    sharp = half < 2 * (freq[1] - freq[0])
    near = (natural[sharp, None] + half[sharp, None] * _RESONANCE_OFFSETS).ravel()
    near = near[(near > freq[0]) & (near < freq[-1])]
    return np.unique(np.concatenate([freq[freq > 0], near]))


def port_unit(machine: Machine, quantity: Quantity, out: Output, inp: Input) -> str:
    """Return the unit of an FRF, such as ``m/s² per N``."""
    source = input_unit(machine, inp)
    per = "unit of control" if source == CONTROL else source
    return f"{output_unit(machine, out, quantity)} per {per}"
