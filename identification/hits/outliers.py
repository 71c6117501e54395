r"""Detection of hits whose FRFs deviate from those of the other hits.

Let M be the median FRF of all hits (real and imaginary parts separately, line by line). Hit h
leaves the residual ``e_h`` with the energy ``E_h`` in response o and chunk c of 16 lines:

    e_h = X_h - M F_h,   E_h(c, o) = sum of |e_h|^2 over chunk c

The noise does not depend on the force, so E_h over its median over hits is about 1 in every chunk
and response. The mean of this ratio is the squared distance D_h^2 of the hit. A hit is an outlier
if D_h is three times the median distance and e_h is 2 % of X_h. Scatter of hammer point and
direction does not reach the first limit, which is wider for fewer than six hits, whose median is
uncertain; a deviation below the second does not matter.
"""

import numpy as np

from identification.words import Complex, Mask, Real

_CHUNK_LINES = 16  # lines of a chunk
_MIN_OUTLIER_DISTANCE = 3.0  # times the median distance
_FEW_HITS = 6  # with fewer, that limit grows by 6 over their number: twice as wide for three
_MIN_OUTLIER_SHARE = 0.02  # of the response
_MAX_MIRROR_CORRELATION = -0.5  # with the response that the median FRF predicts
MIN_EXCITATION = 0.1  # of the largest force over lines: lines with less do not count
_MAX_USABLE_SHARE = 0.8  # of half the sampling rate: anti-aliasing filters act above
_TINY_ENERGY = 1e-300  # avoids a division by zero

Reasons = list[str | None]  # for each hit the reason to reject it, or None


def find_mirrored_hits(force: Complex, motion: Complex) -> Reasons:
    """Find hits whose responses have the opposite sign to those of the other hits.

    The median over channels of the correlation of X_h and M F_h is then near -1: the hammer hit
    from the opposite side without a change of sign, or a cable was reversed.

    Args:
        force: spectra F of the force; (n_hit, n_freq).
        motion: spectra X of the motion; (n_hit, n_freq, n_out).

    Returns:
        For each hit the reason to reject it, or None; n_hit.
    """
    force, motion, expected = _expected_motion(force, motion)
    size = np.sqrt((np.abs(motion) ** 2).sum(axis=1) * (np.abs(expected) ** 2).sum(axis=1))
    product = (motion * expected.conj()).real.sum(axis=1)
    correlation = np.median(product / np.where(size > 0, size, 1.0), axis=1)
    return [
        "its responses have the sign opposite to the other hits"
        if value < _MAX_MIRROR_CORRELATION
        else None
        for value in correlation
    ]


def find_outlying_hits(force: Complex, motion: Complex) -> Reasons:
    """Find hits whose FRFs deviate from those of the other hits by far more than noise.

    Args:
        force (n_hit, n_freq), motion (n_hit, n_freq, n_out): as for ``find_mirrored_hits``.

    Returns:
        For each hit the reason to reject it, or None; n_hit.
    """
    distances, shares = outlier_distances(force, motion)
    typical = float(np.median(distances))
    limit = _MIN_OUTLIER_DISTANCE * max(1.0, _FEW_HITS / len(distances))
    return [
        f"outlier: {distance / typical:.1f} times the others' distance from the median FRF, "
        f"{100 * share:.0f} % of its response"
        if distance > limit * typical and share > _MIN_OUTLIER_SHARE
        else None
        for distance, share in zip(distances, shares, strict=True)
    ]


def outlier_distances(force: Complex, motion: Complex) -> tuple[Real, Real]:
    """Compute the distance D_h of each hit, and the size of its residual e_h over that of X_h.

    All channels have equal weight in the second.

    Args:
        force (n_hit, n_freq), motion (n_hit, n_freq, n_out): as for ``find_mirrored_hits``.

    Returns:
        Distances and relative residuals; (n_hit,) each.
    """
    _, motion, expected = _expected_motion(force, motion)
    error = np.abs(motion - expected) ** 2
    count = max(error.shape[1] // _CHUNK_LINES, 1)
    chunks = np.array_split(error, count, axis=1)
    energy = np.stack([chunk.sum(axis=1) for chunk in chunks], axis=1)
    typical = np.median(energy, axis=0)
    typical = np.where(typical > 0, typical, max(float(energy.max()), _TINY_ENERGY))
    distance = np.sqrt((energy / typical).mean(axis=(1, 2)))
    size = (np.abs(motion) ** 2).sum(axis=1)
    share = np.sqrt((error.sum(axis=1) / np.where(size > 0, size, 1.0)).mean(axis=1))
    return distance, share


def _expected_motion(force: Complex, motion: Complex) -> tuple[Complex, Complex, Complex]:
    """Return F, X and the predicted motion M F on the lines that the hits excite."""
    excited = excited_lines(force)
    force, motion = force[:, excited], motion[:, excited]
    ratios = motion / force[:, :, None]
    middle = np.median(ratios.real, axis=0) + 1j * np.median(ratios.imag, axis=0)
    return force, motion, np.asarray(middle * force[:, :, None], np.complex128)


def excited_lines(force: Complex) -> Mask:
    """Return the lines above 0 Hz and below 0.8 of Nyquist that all hits excite; (n_freq,)."""
    size = np.abs(force).min(axis=0)
    excited: Mask = size > MIN_EXCITATION * size[1:].max()
    excited[0] = False
    excited[int(_MAX_USABLE_SHARE * len(size)) + 1 :] = False
    if not excited.any():
        excited[1] = True
    return excited
