r"""FRFs from averaged spectra: H1, H2, Hv, their coherence and their variance.

With X_h and F_h the spectra of hit h of n, G_ff = mean |F|^2, G_xx = mean |X|^2 and
G_xf = mean X conj(F) (Bendat and Piersol 2010, ch. 6; Ewins 2000, ch. 3.5):

    H1 = G_xf / G_ff,   H2 = G_xx / conj(G_xf),   g2 = |G_xf|^2 / (G_ff G_xx)

H1 is least squares with noise on the responses only, and low by 1 + N_ff / G_ff if there is noise
on the force; H2 has noise on the force only, and is high by 1 + N_xx / (|H|^2 G_ff) if there is
noise on the response. Hv is total least squares: the largest eigenvector (v_f, v_x) of the matrix
of G_ff / N_ff, G_xf / sqrt(N_ff N_xx), G_xx / N_xx gives H = v_x / v_f sqrt(N_xx / N_ff). It
needs the ratio of the noises; where they are not known they count as the same share of G_ff and
G_xx, and Hv = sqrt(G_xx / G_ff) exp(i arg G_xf), the geometric mean of H1 and H2. Its size is never
below that of H1, never above that of H2.

To first order in the noise n_x, n_f all three make one error, mean conj(F) (n_x - H n_f) / G_ff: of
H1 at once, of H2 since 2 Re(e) - conj(e) = e, of Hv since an eigenvector moves by its part across.
So all three have the variance |H|^2 (1 - g2) / (g2 (n - 1)), which for H1 with any noise on the
responses is without bias, since it is that of least squares with n - 1 free values.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Estimator, Real

_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Averages:
    """Spectra averaged over hits.

    Args:
        force: G_ff; (n_freq,).
        motion: G_xx; (n_freq, n_out).
        cross: G_xf; (n_freq, n_out).
        count: n.
    """

    force: Real
    motion: Real
    cross: Complex
    count: int

    @property
    def coherence(self) -> Real:
        """g2, 0 .. 1; (n_freq, n_out)."""
        product = self.force[:, None] * self.motion
        ratio = np.abs(self.cross) ** 2 / np.where(product > 0, product, 1.0)
        coherence: Real = np.clip(np.where(product > 0, ratio, 0.0), 0.0, 1.0)
        return coherence


def average(force: Complex, motion: Complex) -> Averages:
    """Average F (n_hit, n_freq) and X (n_hit, n_freq, n_out) over hits."""
    return Averages(
        (np.abs(force) ** 2).mean(axis=0),
        (np.abs(motion) ** 2).mean(axis=0),
        np.asarray((motion * force.conj()[:, :, None]).mean(axis=0)),
        len(force),
    )


def estimate_frf(
    averages: Averages, estimator: Estimator, noise: tuple[Real, Real] | None = None
) -> Complex:
    """H1, H2 or Hv; (n_freq, n_out).

    Args:
        averages: over hits.
        estimator: which.
        noise: N_ff (n_freq,) and N_xx (n_freq, n_out), up to a common factor, for Hv; None for
            the same share of both.
    """
    if estimator == "H1":
        return _ratio(averages.cross, averages.force[:, None])
    if estimator == "H2":
        return _ratio(averages.motion, averages.cross.conj())
    if noise is None:
        return _total(averages, averages.force, averages.motion)
    return _total(averages, *noise)


def _total(averages: Averages, noise_force: Real, noise_motion: Real) -> Complex:
    """Total least squares with noises of these powers.

    With p = G_ff / N_ff, q = G_xx / N_xx, r = G_xf / sqrt(N_ff N_xx) the eigenvector has
    v_x / v_f = (q - p + d) / (2 conj r) = 2 r / (p - q + d), d = sqrt((q - p)^2 + 4 |r|^2); the
    form without cancellation is taken.
    """
    a = np.maximum(noise_force, _TINY)[:, None]
    b = np.maximum(noise_motion, _TINY)
    p, q = averages.force[:, None] / a, averages.motion / b
    r = averages.cross / np.sqrt(a) / np.sqrt(b)
    root = np.sqrt((q - p) ** 2 + 4 * np.abs(r) ** 2)
    high = _ratio(q - p + root, 2 * r.conj())
    low = _ratio(2 * r, p - q + root)
    return np.asarray(np.where(q > p, high, low) * np.sqrt(b) / np.sqrt(a), np.complex128)


def _ratio(above: Complex | Real, below: Complex | Real) -> Complex:
    there = np.abs(below) > 0
    ratio = np.where(there, above / np.where(there, below, 1.0), 0.0)
    return ratio.astype(np.complex128)
