"""The frequency responses that a page shows: those asked for, else drive points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Dof, Input, Motor, Quantity, Real, UsageError
from mbmodel import Evaluator, Model, Modes, Question
from mbmodel.frf.ports import is_floor
from mbw.site_kinds import hammers

_MOTION = {
    "accelerance": ("m/s²", "rad/s²"),
    "mobility": ("m/s", "rad/s"),
    "receptance": ("m", "rad"),
}
_MOST, _MOST_POINTS = 300, 12
_BYTES = 300 * 2**20  # of motion that is worked on at once
_BESIDE = np.array([-4.0, -2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0, 2.0, 4.0])  # half widths


@dataclass(frozen=True, eq=False)
class Curves:
    """Frequency responses with their labels.

    Args:
        freq_hz: [Hz]; (n_freq,).
        quantity: of all.
        labels: ``<output> / <input>``; n_curve.
        groups: what to show together; n_curve.
        units: of each; n_curve.
        values: H; (n_curve, n_freq).
        remark: what is left out or went wrong; empty if nothing.
    """

    freq_hz: Real
    quantity: Quantity
    labels: tuple[str, ...]
    groups: tuple[str, ...]
    units: tuple[str, ...]
    values: Complex
    remark: str = ""


Pair = tuple[Dof, Input]


def asked(model: Model, modes: Modes, question: Question) -> Curves:
    """The FRFs of a question; of more than 300 those between equal points, or the first."""
    pairs: list[Pair] = [(out, inp) for inp in question.inputs for out in question.outputs]
    chosen, remark = pairs, ""
    if len(pairs) > _MOST:
        chosen = ([pair for pair in pairs if pair[0] == pair[1]] or pairs)[:_MOST]
        what = "drive points" if chosen[0][0] == chosen[0][1] else "first"
        remark = (
            f"{len(pairs)} FRFs were asked for, and the {len(chosen)} {what} are shown: name fewer "
            "by --input and --output to see others."
        )
    groups = [f"input {inp}" for _, inp in chosen]
    if remark:
        groups = [out.point for out, _ in chosen]
    return _curves(model, modes, question, chosen, groups, remark)


def drive_points(model: Model, modes: Modes, freq_hz: Real, quantity: Quantity) -> Curves:
    """FRFs of hammer points, else of centres of mass, each along the direction of its force."""
    layout = model.machine.layout
    points = hammers(layout) or list(layout.bodies)
    remark = ""
    if len(points) > _MOST_POINTS:
        remark = (
            f"Drive points of the first {_MOST_POINTS} of {len(points)}: name others by --input "
            "and --output."
        )
    dofs = [Dof.of(point, axis) for point in points[:_MOST_POINTS] for axis in range(3)]
    question = Question(freq_hz, tuple(dofs), tuple(dofs), quantity)
    pairs: list[Pair] = [(dof, dof) for dof in dofs]
    return _curves(model, modes, question, pairs, [dof.point for dof in dofs], remark)


def _curves(
    model: Model,
    modes: Modes,
    question: Question,
    pairs: Sequence[Pair],
    groups: Sequence[str],
    remark: str,
) -> Curves:
    freq = _with_lines_at_poles(question.freq_hz, modes)
    try:
        values = _values(model, freq, question.quantity, pairs)
    except UsageError as error:
        pairs, groups, remark = (), (), f"No FRF: {error}."
        values = np.zeros((0, len(freq)), complex)
    moving = [k for k in range(len(pairs)) if values[k].any()]
    return Curves(
        freq,
        question.quantity,
        tuple(f"{pairs[k][0]} / {pairs[k][1]}" for k in moving),
        tuple(groups[k] for k in moving),
        tuple(_unit(model, question.quantity, *pairs[k]) for k in moving),
        values[moving],
        remark,
    )


def _values(model: Model, freq: Real, quantity: Quantity, pairs: Sequence[Pair]) -> Complex:
    """H of each pair, some inputs at a time."""
    inputs = list(dict.fromkeys(inp for _, inp in pairs))
    size = 16 * len(freq) * (len(model.machine.coordinates) + len({out for out, _ in pairs}))
    step = max(1, _BYTES // size)
    values = np.zeros((len(pairs), len(freq)), complex)
    for start in range(0, len(inputs), step):
        some = tuple(inputs[start : start + step])
        wanted = [(k, out, inp) for k, (out, inp) in enumerate(pairs) if inp in some]
        outputs = tuple(dict.fromkeys(out for _, out, _ in wanted))
        found = Evaluator(model, Question(freq, outputs, some, quantity)).at(model.drawn).values
        for k, out, inp in wanted:
            values[k] = found[:, outputs.index(out), some.index(inp)]
    return values


def _with_lines_at_poles(freq: Real, modes: Modes) -> Real:
    """The lines above 0 Hz, and some at each resonance so sharp that equal steps miss its peak."""
    swinging, damping = modes.freq_hz[modes.oscillates], modes.damping[modes.oscillates]
    half = swinging * np.maximum(np.abs(damping), 1e-4)
    sharp = half < 2 * (freq[1] - freq[0])
    near = (swinging[sharp, None] + half[sharp, None] * _BESIDE).ravel()
    near = near[(near > freq[0]) & (near < freq[-1])]
    lines: Real = np.unique(np.concatenate([freq[freq > 0], near]))
    return lines


def _unit(model: Model, quantity: Quantity, out: Dof, inp: Input) -> str:
    above = _MOTION[quantity][out.is_rotation]
    if isinstance(inp, Motor):
        return f"{above} per unit of control"
    if is_floor(model.machine, inp):
        return f"{above} per {_MOTION['accelerance'][inp.is_rotation]}"
    return f"{above} per {'N m' if inp.is_rotation else 'N'}"
