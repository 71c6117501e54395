"""Assembly of the uncertain plant from a model and the posterior of its parameters."""

from dataclasses import dataclass

import numpy as np

from identification.words import Integers, Real, UsageError
from mbmodel import Evaluator, FrfRequest, Linearised, Part, PartContext, SystemMatrices
from mbmodel.export.branch_states import branch_states
from mbmodel.export.state_space import first_order_form
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.plant.uncertainty.matrix_slopes import part_slopes
from tuning.plant.uncertainty.uncertain_plant import UncertainPlant

_RANK_TOLERANCE = 1e-11  # of the largest singular value of a scaled slope: below it is rounding
_LINEAR_TOLERANCE = 1e-9  # of a Part's change from its slope, relative to the slope
_TRIAL_STEP = 0.5  # relative, or in units of the scale: at which a Part is tried for linearity
_CHUNK_LINES_BYTES = 64 * 2**20  # of derivatives that are held at once
_MIN_VARIANCE_SHARE = 1e-6  # of all parameters' variance of an FRF, for a block to be kept


def assemble_uncertain_plant(
    posterior: PosteriorOfModel, request: FrfRequest, min_share: float = _MIN_VARIANCE_SHARE
) -> UncertainPlant:
    """Return the uncertain plant between ports.

    Args:
        request: outputs, inputs and quantity; its lines say which parameters matter, and in which
            band laws of springs are approximated.
        min_share: parameters whose share in the variance of every FRF, at every line, is smaller
            get no block; 0 to keep all.

    Raises:
        UsageError: an acceleration of the floor with another quantity than the accelerance, a
            force sensor as output, or a closed loop.
    """
    lines = Evaluator(posterior.model, request).at(posterior.model.drawn)
    if lines.ports.has_floor and min(request.output_orders) < 2:
        raise UsageError(
            "the uncertain plant takes motions of the floor with the accelerance only: request it"
        )
    if posterior.model.loops:
        raise UsageError(
            "the uncertain plant holds the machine with its control loops open: open them, and "
            "close them around the plant"
        )
    if lines.ports.further is not None:
        raise UsageError(
            "the uncertain plant has no outputs of force sensors, whose reading depends on the "
            "parameters itself: leave them out, or draw samples"
        )
    slopes = _coordinate_slopes(posterior, lines)
    kept = _visible_coordinates(posterior, lines, min_share)
    scales = _typical_sizes(lines)
    factors = [_factorise(slopes[k].stack, scales) for k in kept]
    is_exact = np.array([slopes[k].is_exact for k in kept], bool)
    left = np.hstack([np.zeros((scales[0].size, 0)), *(pair[0] for pair in factors)])
    right = np.vstack([np.zeros((0, scales[1].size)), *(pair[1] for pair in factors)])
    blocks = posterior.posterior
    a, b, c, d = _open_plant(lines, left, right)
    return UncertainPlant(
        tuple(blocks.names[k] for k in kept),
        np.array([pair[0].shape[1] for pair in factors], np.intp),
        is_exact,
        blocks.is_logarithmic[kept],
        blocks.root[kept],
        blocks.scale[kept],
        a,
        b,
        c,
        d,
        tuple(map(str, request.inputs)),
        tuple(map(str, request.outputs)),
        request.quantity,
    )


@dataclass(frozen=True, eq=False)
class _CoordinateSlope:
    """Derivative of all matrices by a block's delta, and whether they are linear in it."""

    stack: Real
    is_exact: bool


def _coordinate_slopes(posterior: PosteriorOfModel, lines: Linearised) -> list[_CoordinateSlope]:
    """Return the derivative by the delta of each coordinate; n_x."""
    model, blocks = posterior.model, posterior.posterior
    orders = lines.request.output_orders
    coordinate = dict(zip(posterior.indices.tolist(), blocks.coordinate_of.tolist(), strict=True))
    totals: dict[int, Real] = {}
    exact = dict.fromkeys(range(blocks.size), True)
    context, start = PartContext(model.machine), 0
    varies = np.isin(np.arange(len(model.parameters)), list(coordinate))
    of_parts = model.slopes(model.drawn, None, varies)
    for part, values, changes in zip(
        model.parts, model.split_parameters(model.drawn), of_parts, strict=True
    ):
        varying = [k for k in range(len(values)) if start + k in coordinate]
        if varying:
            slopes = part_slopes(lines, changes)
            for k in varying:
                member = coordinate[start + k]
                step = float(posterior.units[start + k])
                totals[member] = totals.get(member, 0.0) + step * slopes[k].stack(orders)
                trial = _TRIAL_STEP * (step if blocks.is_logarithmic[member] else 1e-2)
                exact[member] &= _is_linear(part, values, context, k, trial)
                exact[member] &= len(changes) == len(part.slopes(values, context))
        start += len(values)
    return [_CoordinateSlope(np.asarray(totals[k]), exact[k]) for k in range(blocks.size)]


def _is_linear(part: Part, theta: Real, context: PartContext, index: int, step: float) -> bool:
    """Return whether a Part's matrices are linear in one parameter: then its block is exact.

    Args:
        part: the Part.
        theta: values of its parameters.
        context: machine.
        index: of the parameter.
        step: a large change of it, in SI.
    """
    moved = theta.copy()
    moved[index] += step
    before, after = part.changes(theta, context), part.changes(moved, context)
    slopes = part.slopes(theta, context)
    if not len(before) == len(after) == len(slopes):
        return False
    for old, new, slope in zip(before, after, slopes, strict=True):
        expected = step * slope.core[index]
        size = np.abs(expected).max(initial=0.0)
        if np.abs(new.core - old.core - expected).max(initial=0.0) > _LINEAR_TOLERANCE * size:
            return False
        if slope.slot == "path" and size > 0:  # the equation has T' and T: it is quadratic
            return False
    return True


def _visible_coordinates(
    posterior: PosteriorOfModel, lines: Linearised, min_share: float
) -> Integers:
    """Return the coordinates that matter to some FRF at some line, in order; (n_kept,)."""
    blocks = posterior.posterior
    sensitivities = lines.sensitivities(posterior.varies, posterior.rates)
    values, largest = np.asarray(lines.values), np.zeros(blocks.size)
    step = max(1, _CHUNK_LINES_BYTES // (16 * values[0].size * max(blocks.size, 1)))
    for start in range(0, len(values), step):
        slopes = sensitivities.columns(slice(start, start + step)) @ posterior.membership
        variance = np.abs(slopes) ** 2 * np.diag(blocks.covariance)
        total = (np.abs(slopes @ blocks.root) ** 2).sum(axis=-1, keepdims=True)
        share = variance / np.where(total == 0, 1.0, total)
        largest = np.maximum(largest, share.reshape(-1, blocks.size).max(axis=0))
    return np.flatnonzero(largest > min_share)


def _typical_sizes(lines: Linearised) -> tuple[Real, Real]:
    """Return units of the rows and columns of a slope, in which its entries are of like size.

    They are those of the forces and motions at the middle of the band.
    """
    matrices, request = lines.assembly.matrices, lines.request
    freq = request.freq_hz[request.freq_hz > 0]
    omega = 2 * np.pi * float(np.exp(np.log(freq).mean())) if len(freq) else 1.0
    forces = sum(
        omega**power * np.abs(np.diag(matrix))
        for power, matrix in enumerate((matrices.stiffness, matrices.damping, matrices.mass))
    )
    force = np.sqrt(np.asarray(forces))
    motions = [omega**power / force for power in range(3)]
    inputs = np.linalg.norm(lines.drive / force[:, None], axis=0)
    outputs = np.linalg.norm(lines.readout / force, axis=1) * omega ** np.array(
        request.output_orders
    )
    rows = np.concatenate([force, np.where(outputs == 0, 1.0, outputs)])
    columns = np.concatenate([*motions, 1 / np.where(inputs == 0, 1.0, inputs)])
    return rows, columns


def _factorise(slope: Real, scales: tuple[Real, Real]) -> tuple[Real, Real]:
    """Return U and V' with slope = U V', of the smallest rank; (n_row, r) and (r, n_column).

    Args:
        slope: of all matrices; (n_row, n_column).
        scales: units of rows and columns.
    """
    rows, columns = scales
    left, values, right = np.linalg.svd(slope / rows[:, None] * columns, full_matrices=False)
    rank = int((values > _RANK_TOLERANCE * values.max(initial=0.0)).sum())
    root = np.sqrt(values[:rank])
    return left[:, :rank] * root * rows[:, None], root[:, None] * right[:rank] / columns


def _open_plant(lines: Linearised, left: Real, right: Real) -> tuple[Real, Real, Real, Real]:
    """Return A, B, C, D of M.

    Args:
        lines: the nominal model.
        left: U of all blocks; (nv + n_out, width).
        right: V' of all blocks; (width, 3 nv + n_in).
    """
    assembly, request = lines.assembly, lines.request
    size, n_in = lines.drive.shape
    branches = branch_states(assembly.matrices, assembly.frequency_dependent, request.freq_hz)
    form = first_order_form(branches, np.hstack([-left[:size], lines.drive]))
    width = left.shape[1]
    reading = np.zeros((width, len(form.dynamics)))
    through = np.hstack([np.zeros((width, width)), right[:, 3 * size :]])
    for order in range(3):
        c, d = form.read(order, right[:, order * size : (order + 1) * size])
        reading, through = reading + c, through + d
    pairs = [
        form.read(order, lines.readout[[row]]) for row, order in enumerate(request.output_orders)
    ]
    c, d = np.vstack([pair[0] for pair in pairs]), np.vstack([pair[1] for pair in pairs])
    d = d + np.hstack([left[size:], np.zeros((len(c), n_in))])
    accelerates = np.array(request.output_orders) == 2
    d[accelerates, width:] += (lines.ports.readout @ lines.ports.floor)[accelerates]
    plant = SystemMatrices(
        form.dynamics, form.gain, np.vstack([reading, c]), np.vstack([through, d])
    ).behind((None,) * width + lines.ports.activations)
    return plant.a, plant.b, plant.c, plant.d
