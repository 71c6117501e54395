"""A machine's own FRFs with a known noise: what a tuning of stiffness and damping must recover."""

from dataclasses import dataclass

import numpy as np

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test
from mbmodel import Evaluator, FrfRequest, Model, as_drawn


@dataclass(frozen=True, eq=False)
class TuningCase:
    """What was drawn.

    Args:
        model: the machine, its stiffness and damping as parameters.
        truth: the parameters that made the data; (n_parameter,).
        campaign: three hits on one point; each value's variance is known.
    """

    model: Model
    truth: np.ndarray
    campaign: Campaign

    def start(self, seed, spread=0.5):
        """The truth times exp(N(0, spread)); (n_parameter,)."""
        return self.truth * np.exp(np.random.default_rng(seed).normal(0.0, spread, len(self.truth)))


def tuning_case(machine, seed, *, hit="acc11", points=23, highest_hz=200.0, lines=801, noise=0.01):
    """Accelerances from 0 Hz of all directions of some points, hit along all axes of one.

    The truth is the drawing, and no tolerance is off. Noise is complex normal, a share of each
    channel's rms over the band.
    """
    model = as_drawn(machine)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, points + 1) for axis in range(3))
    freq = np.linspace(0.0, highest_hz, lines)
    random = np.random.default_rng(seed)
    tests = []
    for axis in range(3):
        reference = Dof.of(hit, axis)
        clean = Evaluator(model, FrfRequest(freq, outputs, (reference,))).at(model.drawn).values
        sigma = noise * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
        error = random.normal(size=(2, *clean.shape)) * sigma / np.sqrt(2)
        frf = Frf(freq, clean + error[0] + 1j * error[1], outputs, (reference,), "accelerance")
        estimate = FrfEstimate(
            frf,
            np.broadcast_to(sigma**2, clean.shape),
            "coherence",  # of so many hits that nothing need be smoothed
            np.ones(clean.shape[1:], bool),
            averages=1000,
        )
        tests.append(Test(Condition("virtual.uff", reference), estimate))
    return TuningCase(model, model.drawn, Campaign("virtual", machine.layout, tuple(tests)))
