"""Reduction of accelerometers to the six degrees of freedom of each solid body (seed, ch. 2.1)."""

from dataclasses import replace

import numpy as np

from identification.words import Dof, Frf, FrfEstimate, Layout, Mask, Output, Real

_MIN_SINGULAR_VALUE = 1e-8  # singular value over the largest below which a motion is undetermined
_MAX_MIXING = 1e-6  # part of a determined degree of freedom in undetermined motions


def reduce_to_bodies(estimate: FrfEstimate, layout: Layout) -> FrfEstimate:
    """Compute the motion of each body's centre of mass from any number of channels on it.

    The channels y of a body move as y = R x, with R the rows of its layout (seed, eq. 2.2 to 2.4)
    in each channel's own axes, and x = pinv(R) y (eq. 2.5). The errors of channels are independent,
    so var x = pinv(R)^2 var y. Lengths are scaled by the distance of the sensors from the centre,
    so that the inverse does not depend on the unit of length.

    A degree of freedom that the channels on a body do not determine is left out. If channels are
    missing for one input only, its cell is masked.

    Args:
        estimate: measured FRFs at points of the layout.

    Returns:
        FRFs at the centres of mass in world axes, without coherence.
    """
    frf = estimate.frf
    shape = (len(frf.freq_hz), 6 * len(layout.bodies), len(frf.inputs))
    values, variance = np.zeros(shape, complex), np.zeros(shape)
    measured = np.zeros(shape[1:], bool)
    rows = layout.rows(frf.outputs)
    for column in range(len(frf.inputs)):
        channels = estimate.measured[:, column]
        for body in range(len(layout.bodies)):
            block = slice(6 * body, 6 * body + 6)
            local = channels & rows[:, block].any(axis=1)
            inverse, determined = body_inverse(rows[local, block])
            values[:, block, column] = frf.values[:, local, column] @ inverse.T
            variance[:, block, column] = estimate.variance[:, local, column] @ (inverse**2).T
            measured[block, column] = determined
    kept = np.flatnonzero(measured.any(axis=1))
    dofs = tuple(layout.body_dofs()[k] for k in kept)
    return replace(
        estimate,
        frf=Frf(frf.freq_hz, (values * measured)[:, kept], dofs, frf.inputs, frf.quantity),
        variance=(variance * measured)[:, kept],
        measured=measured[kept],
        coherence=None,
    )


def reduction_covariance(estimate: FrfEstimate, layout: Layout) -> Real:
    """Compute the covariance of the motions that ``reduce_to_bodies`` returns.

    With P = pinv(R) and independent errors of the channels, the errors e of a body's six motions
    have E[e e^H] = P diag(var y) P', which is real. Bodies share no channel, so motions of
    different bodies are uncorrelated. Only the noise of the channels counts, not the tolerances of
    the sensors.

    Args:
        estimate: measured FRFs at points of the layout.

    Returns:
        Covariance [unit of the FRFs squared], rows and columns tx ty tz rx ry rz; zero for a motion
        that the channels do not determine; (n_freq, n_in, n_body, 6, 6).
    """
    rows = layout.rows(estimate.frf.outputs)
    n_freq, _, n_in = estimate.variance.shape
    covariance = np.zeros((n_freq, n_in, len(layout.bodies), 6, 6))
    for column in range(n_in):
        for body in range(len(layout.bodies)):
            block = rows[:, 6 * body : 6 * body + 6]
            local = estimate.measured[:, column] & block.any(axis=1)
            inverse, _ = body_inverse(block[local])
            weighted = estimate.variance[:, None, local, column] * inverse
            covariance[:, column, body] = weighted @ inverse.T
    return covariance


def reconstruct(reduced: Frf, outputs: tuple[Output, ...], layout: Layout) -> Frf:
    """Compute the readings of sensors on solid bodies (seed, ch. 2.2).

    Args:
        reduced: FRFs at all six degrees of freedom of the bodies concerned.
        outputs: sensors whose readings are computed.

    Raises:
        UsageError: a body that was not fully determined.
    """
    bodies = dict.fromkeys(layout.body_name(dof.point) for dof in outputs)
    dofs = tuple(Dof.of(body, axis) for body in bodies for axis in range(6))
    rows = layout.rows(outputs)
    columns = [layout.bodies.index(dof.point) * 6 + dof.axis for dof in dofs]
    motion = reduced.select(dofs, reduced.inputs)
    return replace(motion, values=rows[:, columns] @ motion.values, outputs=tuple(outputs))


def body_inverse(rows: Real) -> tuple[Real, Mask]:
    """Compute the pseudo-inverse of a body's rows, lengths scaled by the sensors' distance.

    Args:
        rows: readings of the channels per motion of the body; (n, 6).

    Returns:
        (6, n), zero for undetermined degrees of freedom, and which of the six are determined; (6,).
    """
    if not len(rows):
        return np.zeros((6, 0)), np.zeros(6, bool)
    arm = np.sqrt((rows[:, 3:] ** 2).sum() / max((rows[:, :3] ** 2).sum(), 1e-300))
    scale = np.array([1.0] * 3 + [arm if arm > 0 and np.isfinite(arm) else 1.0] * 3)
    left, values, right = np.linalg.svd(rows / scale, full_matrices=False)
    kept = values > _MIN_SINGULAR_VALUE * values[0]
    determined = np.abs(1.0 - (right[kept] ** 2).sum(axis=0)) < _MAX_MIXING
    inverse = (right[kept].T / values[kept]) @ left[:, kept].T / scale[:, None]
    return inverse * determined[:, None], determined
