"""A machine of three masses that forces shake, of which the exact FRFs are known."""

import numpy as np

from identification.words import Dof, Records

RATE_HZ = 256.0
OUTPUTS = tuple(Dof(f"acc{k}", "+tx") for k in (1, 2, 3))
# Three masses in a row on springs, 12, 30 and 43 Hz, damped in proportion to the stiffness.
MASS = np.diag([2.0, 1.0, 1.5])
STIFFNESS = 2e4 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
DAMPING = 2e-4 * STIFFNESS


SETTLING = 2048  # samples: the slowest mode decays to 1e-6


def exact(freq_hz):
    """Accelerance; (n_freq, 3, 3)."""
    s = 2j * np.pi * freq_hz[:, None, None]
    return s**2 * np.linalg.inv(s**2 * MASS + s * DAMPING + STIFFNESS)


def shake(force, points=(0,), noise=0.0, seed=0, cubic=0.0):
    """Records of forces (n_in, n_record, n_sample), after the machine has settled."""
    frf = exact(np.fft.rfftfreq(force.shape[2], 1 / RATE_HZ))[:, :, list(points)]
    spectrum = np.einsum("foi,irf->rof", frf, np.fft.rfft(force))
    motion = np.fft.irfft(spectrum, force.shape[2])[:, :, SETTLING:]
    force, scale = force[:, :, SETTLING:], motion.std()
    random = np.random.default_rng(seed)
    motion = motion + cubic * motion**3 / scale**2
    motion = motion + noise * scale * random.standard_normal(motion.shape)
    first, *others = (OUTPUTS[k] for k in points)
    return Records(
        RATE_HZ,
        force[0],
        motion,
        OUTPUTS,
        first,
        "accelerance",
        further_forces=force[1:],
        further_references=tuple(others),
        test="shaken.npz",
    )


def random_force(*shape, seed=1):
    return np.random.default_rng(seed).standard_normal(shape)


def multisine(n_in, n_record, periods, length=2048, seed=2):
    """Random phases of every line from 3 to 65 Hz, other ones in each realisation."""
    lines = np.arange(round(3 * length / RATE_HZ), round(65 * length / RATE_HZ))
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, (n_in, n_record, len(lines)))
    spectrum = np.zeros((n_in, n_record, length // 2 + 1), complex)
    spectrum[..., lines] = np.exp(1j * phases)
    period = np.fft.irfft(spectrum, axis=2) * np.sqrt(length)
    return np.tile(period, periods)


def ratio(records, result):
    """|error|^2 over its variance from 4 to 60 Hz, where all modes are."""
    frf = result.estimate.frf
    band = (frf.freq_hz > 4) & (frf.freq_hz < 60)
    column = OUTPUTS.index(records.reference)
    error = frf.values[band, :, 0] - exact(frf.freq_hz[band])[:, :, column]
    return np.abs(error) ** 2 / result.estimate.variance[band, :, 0]
