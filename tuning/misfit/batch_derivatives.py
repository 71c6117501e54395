"""Residuals, weights and weighted derivatives of one linearised batch of tests."""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Complex, Integers, Real
from mbmodel import Linearised
from tuning.misfit.accumulation import SensorColumns, WeightedJacobian
from tuning.misfit.partition import CoordinatePartition
from tuning.misfit.reduction import (
    BodyProjection,
    BodyWeightRoot,
    apply_body_weights,
    body_projections,
    body_weight_roots,
)
from tuning.misfit.weights import WeightedBatch, squared_size


@dataclass(frozen=True, eq=False)
class BatchSums:
    """Residuals and weights of a linearised batch, summed over the tests of each input.

    The factors c of the readings multiply them, so that derivatives are those before the factors.

    Args:
        lines: model at theta.
        values: sum w |r|^2; (n_freq,).
        curvature: sum w |g c|^2, 1/2 where bodies are weighted; (n_freq, n_out, n_in).
        weighted_residual: sum w conj(g c) r, complex; (n_freq, n_out, n_in).
        body_roots: square roots of the weights of bodies, if residuals count there.
    """

    lines: Linearised
    values: Real
    curvature: Real
    weighted_residual: Complex
    body_roots: tuple[BodyWeightRoot, ...]


def sum_batch(term: WeightedBatch, lines: Linearised, *, logarithmic: bool) -> BatchSums:
    """Sum residuals and weights of a batch over the tests of each input.

    Args:
        term: measured values and their weights.
        logarithmic: whether r is the logarithm of the ratio.
    """
    sum_by_input = term.batch.sum_by_input
    values, weighted, curvature = compute_residual(term, lines, logarithmic=logarithmic)
    curvature, weighted = sum_by_input(curvature.astype(complex)).real, sum_by_input(weighted)
    factor = None if lines.output_factor is None else lines.output_factor.T
    if factor is not None:  # derivatives are those of H before the factors of the readings
        weighted = weighted * factor.conj()[:, :, None]
        curvature = curvature * np.abs(factor[:, :, None]) ** 2
    sums = BatchSums(lines, values, curvature, weighted, ())
    if term.body_weights is not None:
        n_in = sums.weighted_residual.shape[2]
        body_roots = body_weight_roots(term.body_weights, term.batch.columns, n_in, factor)
        half = np.zeros(sums.weighted_residual.shape)
        for body in body_roots:
            half[:, body.rows] = 0.5
        sums = replace(sums, curvature=half, body_roots=body_roots)
    return sums


def compute_jacobian(
    sums: BatchSums, partition: CoordinatePartition, rates: Real, *, all_channels: bool = False
) -> WeightedJacobian:
    """Return the weighted derivatives of one batch.

    Args:
        sums: residuals and weights.
        partition: shared coordinates, and blocks of sensors.
        rates: derivatives of the parameters by their coordinates; (n_parameter,).
        all_channels: whether channels stay apart instead of being projected onto their body's
            motion.
    """
    root = np.sqrt(2 * sums.curvature)
    target = 2 * np.divide(
        sums.weighted_residual,
        root,
        out=np.zeros(root.shape, complex),
        where=sums.curvature > 0,
    )
    for body in sums.body_roots:
        target[:, body.rows] = np.einsum("ftij,fjt->fit", body.inverse, target[:, body.rows])
    forward = sums.lines.sensitivities(partition.shared_parameters, rates, partition.places)
    sensor_slopes = sums.lines.sensitivities(partition.sensor_parameters)
    columns = list(partition.sensor_columns(sensor_slopes, rates))
    projections = body_projections(
        sums.lines.ports.readout,
        root,
        target,
        sums.body_roots,
        together=[rows for rows, _, _ in columns],
        all_channels=all_channels or forward.has_readout_terms,
    )
    sensors = (
        _project_sensor(rows, values, root, target, projections) for rows, values, _ in columns
    )
    return WeightedJacobian(partition, forward, projections, tuple(sensors))


def compute_residual(
    term: WeightedBatch, lines: Linearised, *, logarithmic: bool
) -> tuple[Real, Complex, Real]:
    """Return sum w |r|^2 of each line, w conj(g) r and w |g|^2.

    Shapes are (n_freq,), (n_freq, n_out, n_test) and (n_freq, n_out, n_test).
    """
    batch, weight = term.batch, term.weight
    model = batch.select_inputs(lines.values)
    if not logarithmic:
        residual = model - batch.values
        weighted = (
            weight * residual
            if term.body_weights is None
            else apply_body_weights(term.body_weights, residual)
        )
        return _line_sums(residual, weighted), weighted, weight
    model = np.where(weight > 0, model, 1.0)
    product = model * np.where(weight > 0, batch.values, 1.0).conj()
    square = squared_size(model)
    log_ratio = 0.5 * np.log(square) - (0.0 if term.log_size is None else term.log_size)
    residual = log_ratio + 1j * np.arctan2(product.imag, product.real)
    power = weight * squared_size(batch.values)
    weighted = power * residual / model.conj()
    return _line_sums(residual, power * residual), weighted, power / square


def _project_sensor(
    rows: Integers,
    values: Complex,
    root: Real,
    target: Complex,
    projections: tuple[BodyProjection, ...],
) -> SensorColumns:
    """Project a sensor's derivatives (n_freq, n_row, n_in, n_own) like the channels of its body."""
    is_read = bool(len(rows))  # a sensor may have no channel here
    index = next(
        k for k, projection in enumerate(projections) if not is_read or rows[0] in projection.rows
    )
    projection = projections[index]
    slopes = _real_and_imaginary(values)
    matrix = projection.matrix[..., np.searchsorted(projection.rows, rows)][:, :, None]
    weight = root[:, rows].transpose(0, 2, 1)[:, :, None, :, None]
    return SensorColumns(
        index,
        matrix @ slopes,
        weight * slopes,
        _real_and_imaginary(target[:, rows, :, None])[..., 0],
    )


def _real_and_imaginary(values: Complex) -> Real:
    """Stack real and imaginary parts: (n_freq, n_row, n_in, n) to (n_freq, n_in, 2, n_row, n)."""
    n_freq, n_row, n_in, count = values.shape
    parts = np.empty((n_freq, n_in, 2, n_row, count))
    by_input = values.swapaxes(1, 2)
    parts[:, :, 0], parts[:, :, 1] = by_input.real, by_input.imag
    return parts


def _line_sums(first: Complex, second: Complex) -> Real:
    """Return Re sum conj(first) second over each line; (n_freq,)."""
    products = first.real * second.real + first.imag * second.imag
    return products.sum(axis=(1, 2))
