r"""FRF estimators H1, H2 and Hv from averaged spectra, their coherence, and their variance formula.

With X_h and F_h the spectra of hit h of n, G_ff = mean |F|^2, G_xx = mean |X|^2 and
G_xf = mean X conj(F) (Bendat and Piersol 2010, ch. 6; Ewins 2000, ch. 3.5):

    H1 = G_xf / G_ff,   H2 = G_xx / conj(G_xf),   g2 = |G_xf|^2 / (G_ff G_xx)

H1 is the least-squares estimate for noise on the responses alone; noise on the force lowers it by
the factor 1 + N_ff / G_ff. H2 is the estimate for noise on the force alone; noise on the response
raises it by 1 + N_xx / (|H|^2 G_ff). Hv is the total-least-squares estimate: the eigenvector
(v_f, v_x) of the largest eigenvalue of the matrix

    [G_ff / N_ff,                  conj(G_xf) / sqrt(N_ff N_xx)]
    [G_xf / sqrt(N_ff N_xx),       G_xx / N_xx                 ]

gives H = v_x / v_f sqrt(N_xx / N_ff). It needs the ratio of the noise powers. If that is unknown,
the noise is taken as an equal share of G_ff and G_xx. Then Hv = sqrt(G_xx / G_ff) exp(i arg G_xf),
the geometric mean of H1 and H2. The modulus of Hv lies between those of H1 and H2.

To first order in the noise n_x and n_f all three estimators have one error,
e = mean conj(F) (n_x - H n_f) / G_ff: H1 directly, H2 since 2 Re(e) - conj(e) = e, and Hv since an
eigenvector moves by the orthogonal part of a perturbation. All three therefore have the variance
|H|^2 (1 - g2) / (g2 (n - 1)) (Bendat and Piersol 2010, ch. 9). For H1 with noise on the responses
it is unbiased, as the least-squares variance with n - 1 degrees of freedom.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Complex, Estimator, Real

_TINY_POWER = 1e-300  # avoids a division by zero


@dataclass(frozen=True, eq=False)
class AveragedSpectra:
    """Spectra averaged over hits.

    Args:
        force: auto-spectrum G_ff of the force; (n_freq,).
        motion: auto-spectra G_xx of the motion; (n_freq, n_out).
        cross: cross-spectra G_xf; (n_freq, n_out).
        count: number n of hits.
    """

    force: Real
    motion: Real
    cross: Complex
    count: int

    @property
    def coherence(self) -> Real:
        """Ordinary coherence g2, 0 .. 1; (n_freq, n_out)."""
        product = self.force[:, None] * self.motion
        ratio = np.abs(self.cross) ** 2 / np.where(product > 0, product, 1.0)
        return np.clip(np.where(product > 0, ratio, 0.0), 0.0, 1.0)


def average_spectra(force: Complex, motion: Complex) -> AveragedSpectra:
    """Average the auto- and cross-spectra over hits.

    Args:
        force: spectra F of the force; (n_hit, n_freq).
        motion: spectra X of the motion; (n_hit, n_freq, n_out).
    """
    return AveragedSpectra(
        (np.abs(force) ** 2).mean(axis=0),
        (np.abs(motion) ** 2).mean(axis=0),
        np.asarray((motion * force.conj()[:, :, None]).mean(axis=0)),
        len(force),
    )


def estimate_frf(
    averages: AveragedSpectra, estimator: Estimator, noise: tuple[Real, Real] | None = None
) -> Complex:
    """Estimate the FRFs by H1, H2 or Hv.

    Args:
        averages: spectra averaged over hits.
        estimator: name of the estimator.
        noise: noise powers N_ff (n_freq,) and N_xx (n_freq, n_out) up to a common factor, for Hv;
            None for equal shares of G_ff and G_xx.

    Returns:
        FRFs; (n_freq, n_out).
    """
    if estimator == "H1":
        return _ratio(averages.cross, averages.force[:, None])
    if estimator == "H2":
        return _ratio(averages.motion, averages.cross.conj())
    if noise is None:
        return _total_least_squares(averages, averages.force, averages.motion)
    return _total_least_squares(averages, *noise)


def _total_least_squares(
    averages: AveragedSpectra, noise_force: Real, noise_motion: Real
) -> Complex:
    """Estimate the FRFs by total least squares with these noise powers.

    With p = G_ff / N_ff, q = G_xx / N_xx, r = G_xf / sqrt(N_ff N_xx) the eigenvector has
    v_x / v_f = (q - p + d) / (2 conj r) = 2 r / (p - q + d), where d = sqrt((q - p)^2 + 4 |r|^2).
    The form without cancellation is used.
    """
    a = np.maximum(noise_force, _TINY_POWER)[:, None]
    b = np.maximum(noise_motion, _TINY_POWER)
    p, q = averages.force[:, None] / a, averages.motion / b
    r = averages.cross / np.sqrt(a) / np.sqrt(b)
    root = np.sqrt((q - p) ** 2 + 4 * np.abs(r) ** 2)
    high = _ratio(q - p + root, 2 * r.conj())
    low = _ratio(2 * r, p - q + root)
    return np.asarray(np.where(q > p, high, low) * np.sqrt(b) / np.sqrt(a), np.complex128)


def _ratio(numerator: Complex | Real, denominator: Complex | Real) -> Complex:
    """Return the quotient, 0 for a zero denominator."""
    is_defined = np.abs(denominator) > 0
    ratio = np.where(is_defined, numerator / np.where(is_defined, denominator, 1.0), 0.0)
    return ratio.astype(np.complex128)
