"""Virtual hammer tests: half-sine pulses on a system of known modes, its motion without aliasing.

The motion is the sum over modes of phi_o l / (s - s_r) and its twin, each the exact answer of one
first-order system to a force that is linear between the samples of a finer clock.
"""

from dataclasses import dataclass, field

import numpy as np
from identification_examples import Function
from scipy.signal import lfilter

from identification.words import Dof, Records

FINER = 32


@dataclass(frozen=True, eq=False)
class System:
    """Modes with receptance sum_r phi_or l_r / (s - s_r) + conjugate; real shapes, proportional."""

    freq_hz: np.ndarray
    damping: np.ndarray
    shapes: np.ndarray  # (n_out, n_mode)
    drive: np.ndarray  # (n_mode,)

    @property
    def poles(self):
        omega = 2 * np.pi * self.freq_hz
        return omega * (-self.damping + 1j * np.sqrt(1 - self.damping**2))

    @property
    def residues(self):
        """Of receptance, unit modal mass: phi l / (2 i w_d); (n_out, n_mode)."""
        return self.shapes * self.drive / (2j * self.poles.imag)

    def accelerance(self, laplace):
        """(n_freq, n_out)."""
        s = np.asarray(laplace)[:, None, None]
        pair = self.residues / (s - self.poles) + self.residues.conj() / (s - self.poles.conj())
        return (s[:, :, 0] ** 2) * pair.sum(axis=2)

    def answer(self, force, step):
        """Acceleration to a force linear between samples; (n_out, n_sample).

        q' = s q + f exactly over a step: q_1 = e q_0 + a f_0 + b f_1. The acceleration is
        sum of R s^2 q and conjugates, plus sum of R s and conjugates times f (the part that
        answers at once); sum of R and conjugates is zero.
        """
        total = np.zeros((len(self.shapes), len(force)))
        for pole, residue in zip(self.poles, self.residues.T, strict=True):
            grown = np.exp(pole * step)
            both = (grown - 1) / pole
            later = (both / step - 1) / pole  # weight of f_1
            states = lfilter([later, both - later], [1, -grown], force.astype(complex))
            total += 2 * np.real(np.outer(residue * pole**2, states))
            total += 2 * np.real(residue * pole)[:, None] * force
        return total


def a_system(seed=3, n_out=4, freq_hz=(31.0, 55.0, 88.0, 140.0), damping=0.02):
    """Modes of unit mass of a ton, every shape different; the first output is the drive point."""
    rng = np.random.default_rng(seed)
    freq = np.asarray(freq_hz, float)
    shapes = rng.uniform(0.3, 1.0, (n_out, len(freq))) * rng.choice([-1, 1], (n_out, len(freq)))
    shapes = shapes / np.sqrt(1000.0)
    return System(freq, np.broadcast_to(damping, freq.shape).astype(float), shapes, shapes[0])


@dataclass(frozen=True, eq=False)
class Hammer:
    """How the test was made: hits at times [s] of each record, with peaks [N]."""

    rate_hz: float = 1024.0
    duration_s: float = 4.0
    pulse_s: float = 0.004
    times_s: tuple[tuple[float, ...], ...] = tuple((0.1 + 0.0003 * k,) for k in range(8))
    peaks_n: tuple[tuple[float, ...], ...] | None = None
    noise: float = 0.0  # m/s^2, of the motion
    force_noise: float = 0.0  # N
    seed: int = 11
    outputs: tuple[str, ...] = field(default=("11:+z", "1:+x", "1:-y", "2:+z"))
    reference: str = "11:+z"


def strike(system, hammer):
    """Records of a hammer test; peaks of 150..250 N unless given."""
    rng = np.random.default_rng(hammer.seed)
    samples = round(hammer.rate_hz * hammer.duration_s)
    step = 1 / hammer.rate_hz / FINER
    padded = samples + round(0.25 * hammer.rate_hz)  # so that the filter does not join both ends
    time = np.arange(padded * FINER) * step
    fade = 0.5 * (
        1 + np.cos(np.pi * np.clip(np.arange(len(time)) / FINER - samples - 64, 0, 64) / 64)
    )
    force = np.zeros((len(hammer.times_s), samples))
    motion = np.zeros((len(hammer.times_s), len(system.shapes), samples))
    for record, times in enumerate(hammer.times_s):
        peaks = hammer.peaks_n[record] if hammer.peaks_n else rng.uniform(150, 250, len(times))
        fine = np.zeros(len(time))
        for when, peak in zip(times, peaks, strict=True):
            fine += peak * half_sine(time - when, hammer.pulse_s * rng.uniform(0.9, 1.1))
        clean = _sampled(np.vstack([fine, system.answer(fine, step)]) * fade)[:, :samples]
        force[record], motion[record] = clean[0], clean[1:]
    force += hammer.force_noise * rng.normal(size=force.shape)
    motion += hammer.noise * rng.normal(size=motion.shape)
    return Records(
        hammer.rate_hz,
        force,
        motion,
        tuple(Dof.parse(text) for text in hammer.outputs),
        Dof.parse(hammer.reference),
        "accelerance",
        test="hits.uff",
    )


def half_sine(time, length):
    return np.where((time > 0) & (time < length), np.sin(np.pi * time / length), 0.0)


def _sampled(fine):
    """Every channel through one and the same low-pass far above the band of interest, then picked.

    A sharp spectrum cut at 0.9 of Nyquist: what is left has no aliases, and since force and motion
    share the filter, their ratio is untouched below.
    """
    spectrum = np.fft.rfft(fine)
    top = spectrum.shape[-1] - 1
    cut = int(0.9 * top / FINER)
    width = int(0.3 * top / FINER)
    line = np.arange(top + 1)
    gain = 0.5 * (1 + np.cos(np.pi * np.clip((line - (cut - width)) / width, 0, 1)))
    return np.fft.irfft(spectrum * gain)[..., ::FINER]


def channel_functions(records, *, order="", single=False, even=True, node_of_reference=True):
    """Datasets 58 of records: hit by hit the force, then every motion."""
    kinds = {"receptance": 8, "mobility": 11, "accelerance": 12}
    step = 1 / records.rate_hz
    time = step * np.arange(records.force.shape[1])
    place = _ends(records.reference)
    found = []
    for force, motion in zip(records.force, records.motion, strict=True):
        channels = [(place, 13, force)]
        channels += [
            (_ends(dof), kinds[records.quantity], values)
            for dof, values in zip(records.outputs, motion, strict=True)
        ]
        found += [
            Function(
                values,
                time,
                rsp=end,
                ref=place if node_of_reference or kind == 13 else (0, 0),
                func=1,
                ordinate=kind,
                even=even,
                single=single,
                order=order,
            )
            for end, kind, values in channels
        ]
    return found


def _ends(dof):
    return int(dof.point), dof.sign * (dof.axis + 1)
