"""Hits of a virtual hammer test: half-sine pulses with scatter, and their mean over each step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import Real
from mbmodel.simulation.integration import InputMeans
from mbmodel.virtual_test.plan import HammerTestPlan, RecordedFile

# Second pulse of a double hit: time after the first [pulse durations], and its height.
_BOUNCE_DELAY_PULSES = (4.0, 12.0)
_BOUNCE_HEIGHT = (0.2, 0.7)


@dataclass(frozen=True, eq=False)
class Hits:
    """Hits along one direction.

    Args:
        onsets: first rise of each pulse, from the start of its record [s]; (n_hit, 2).
        peaks: of each pulse, 0 for no second one [N]; (n_hit, 2).
        widths: duration of each pulse [s]; (n_hit, 2).
        turns: rotation vectors of the aim [rad]; (n_hit, 3).
        places: displacements [m]; (n_hit, 3).
    """

    onsets: Real
    peaks: Real
    widths: Real
    turns: Real
    places: Real

    def means(self, step_s: float) -> InputMeans:
        """Return the mean force over each step, exactly.

        A half sine f = P sin(pi t / T) has the integral P T / pi (1 - cos(pi t / T)).

        Args:
            step_s: [s].
        """

        def mean(start: int, stop: int) -> Real:
            edges = np.arange(start, stop + 1) * step_s
            inside = np.clip(
                (edges[None, None] - self.onsets[:, :, None]) / self.widths[:, :, None], 0.0, 1.0
            )
            impulse = (self.peaks * self.widths / np.pi)[:, :, None] * (1 - np.cos(np.pi * inside))
            force: Real = np.diff(impulse.sum(axis=1), axis=1) / step_s
            return force[:, :, None]

        return mean

    def select(self, chosen: Sequence[int]) -> "Hits":
        """Return some of the hits."""
        numbers = list(chosen)
        return Hits(*(array[numbers] for array in vars(self).values()))


def draw_hits(plan: HammerTestPlan, file: RecordedFile, random: np.random.Generator) -> Hits:
    """Draw the hits along one direction of a file.

    Args:
        plan: with the scatter.
        file: with the level and the number of hits.
    """
    scatter, count = plan.scatter, file.hits
    first = file.level_n * (1 + scatter.peak * random.uniform(-1, 1, count))
    width = plan.mean_pulse_s * (1 + scatter.width * random.uniform(-1, 1, count))
    onset = plan.pretrigger_s + random.uniform(0, 1, count) / plan.rate_hz
    is_double = random.uniform(0, 1, count) < scatter.double_share
    heights, delays = draw_bounces(count, random)
    second, later = np.where(is_double, first * heights, 0.0), onset + width * delays
    return Hits(
        onsets=np.stack([onset, later], axis=1),
        peaks=np.stack([first, second], axis=1),
        widths=np.stack([width, width], axis=1),
        turns=scatter.angle * random.standard_normal((count, 3)),
        places=scatter.place * random.standard_normal((count, 3)),
    )


def draw_bounces(count: int, random: np.random.Generator) -> tuple[Real, Real]:
    """Draw height over the first pulse and delay [pulse durations] of bounces; (count,) each."""
    return random.uniform(*_BOUNCE_HEIGHT, count), random.uniform(*_BOUNCE_DELAY_PULSES, count)
