r"""Hits whose FRFs are not those of the others.

With M the median FRF of all hits (real and imaginary parts apart, line by line), a hit leaves

    e_h = X_h - M F_h,   E_h(c, o) = sum of |e_h|^2 over a chunk c of 16 lines

in the response o. Noise is alike in all hits, whatever their force, so that E_h over the median of
all hits is about one in every chunk and channel; its mean D_h^2 over both is the squared distance
of a hit. A hit is an outlier if D_h is three times the median, which the scatter of place and
direction does not reach, and if e_h is 2 % of X_h, so that there is a reason to care.
"""

import numpy as np

from identification.words import Complex, Mask, Real

_LINES = 16  # of a chunk
_FAR = 3.0  # times the median distance
_MATTERS = 0.02  # of the response
_MIRROR = -0.5  # correlation with the median of the others
_EXCITED = 0.1  # of the largest force: lines that count

Reasons = list[str | None]


def mirrored(force: Complex, motion: Complex) -> Reasons:
    """Hits whose responses are the negative of what the others let expect.

    The correlation of X_h and M F_h, channels weighing alike, is near -1: the hammer hit from
    the other side and reads the same sign, or a cable was turned.

    Args:
        force: F; (n_hit, n_freq).
        motion: X; (n_hit, n_freq, n_out).
    """
    force, motion, expected = _expected(force, motion)
    size = np.sqrt((np.abs(motion) ** 2).sum(axis=1) * (np.abs(expected) ** 2).sum(axis=1))
    product = (motion * expected.conj()).real.sum(axis=1)
    correlation = np.median(product / np.where(size > 0, size, 1.0), axis=1)
    return [
        "its responses have the sign opposite to the other hits" if value < _MIRROR else None
        for value in correlation
    ]


def outlying(force: Complex, motion: Complex) -> Reasons:
    """Hits whose FRFs deviate from the others by far more than noise.

    Args:
        force: F; (n_hit, n_freq).
        motion: X; (n_hit, n_freq, n_out).
    """
    distance, share = distances(force, motion)
    middle = float(np.median(distance))
    return [
        f"outlier: {far / middle:.1f} times the others' distance from the median FRF, "
        f"{100 * part:.0f} % of its response"
        if far > _FAR * middle and part > _MATTERS
        else None
        for far, part in zip(distance, share, strict=True)
    ]


def distances(force: Complex, motion: Complex) -> tuple[Real, Real]:
    """D_h, and the size of e_h over that of X_h with all channels weighing alike; (n_hit,) each."""
    _, motion, expected = _expected(force, motion)
    error = np.abs(motion - expected) ** 2
    count = max(error.shape[1] // _LINES, 1)
    chunks = np.array_split(error, count, axis=1)
    energy = np.stack([chunk.sum(axis=1) for chunk in chunks], axis=1)
    typical = np.median(energy, axis=0)
    typical = np.where(typical > 0, typical, max(float(energy.max()), 1e-300))
    distance = np.sqrt((energy / typical).mean(axis=(1, 2)))
    size = (np.abs(motion) ** 2).sum(axis=1)
    share = np.sqrt((error.sum(axis=1) / np.where(size > 0, size, 1.0)).mean(axis=1))
    return distance, share


def _expected(force: Complex, motion: Complex) -> tuple[Complex, Complex, Complex]:
    """F, X and M F on the lines that the hits excite."""
    excited = _excited(force)
    force, motion = force[:, excited], motion[:, excited]
    ratios = motion / force[:, :, None]
    middle = np.median(ratios.real, axis=0) + 1j * np.median(ratios.imag, axis=0)
    return force, motion, np.asarray(middle * force[:, :, None], np.complex128)


def _excited(force: Complex) -> Mask:
    """Lines above 0 Hz and below 0.8 of Nyquist where all forces are there; (n_freq,)."""
    size = np.abs(force).min(axis=0)
    excited: Mask = size > _EXCITED * size[1:].max()
    excited[0] = False
    excited[int(0.8 * len(size)) + 1 :] = False
    if not excited.any():
        excited[1] = True
    return excited
