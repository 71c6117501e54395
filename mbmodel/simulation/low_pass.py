r"""Anti-alias filter and decimation: from the steps of the integration to the recorder's rate.

The filter is that of a delta-sigma converter: a symmetric finite impulse response without phase
(Kaiser 1974), sinc times a Kaiser window,

    g(t) = sin(2 pi f_c t) / (pi t) I_0(beta sqrt(1 - (t / W)^2)) / I_0(beta).

It passes up to 0.4 of the recorder's rate and stops from 0.6 on, so that what folds back stays
above 0.4 of the rate. All channels have it alike, so FRFs do not show it. A delay tau of a channel
is exact: its taps are g(t - tau).
"""

from dataclasses import dataclass, field

import numpy as np

from identification.words import Real

PASS_SHARE, STOP_SHARE = 0.4, 0.6  # of the recorder's rate
_STOP_DB = 100.0  # below what a good converter resolves
# Kaiser's formulas for this attenuation A: beta = 0.1102 (A - 8.7), and the filter's length is
# (A - 8) / 14.36 over the width of the transition [Hz].
_KAISER_BETA = 0.1102 * (_STOP_DB - 8.7)
_LENGTH_TIMES_WIDTH = (_STOP_DB - 8.0) / 14.36


def half_width_s(rate_hz: float) -> float:
    """Return W, half the length of the filter [s].

    Args:
        rate_hz: of the recorder [Hz].
    """
    return _LENGTH_TIMES_WIDTH / ((STOP_SHARE - PASS_SHARE) * rate_hz) / 2


def filter_taps(rate_hz: float, step_s: float, delays_s: Real) -> Real:
    """Return the taps of every channel, for values in the middle of the steps.

    Args:
        rate_hz: of the recorder [Hz].
        step_s: of the integration [s].
        delays_s: of the channels [s]; (n_channel,).

    Returns:
        Taps whose sum is 1; (n_channel, 2 m), the first for the value m steps before the sample.
    """
    width = half_width_s(rate_hz)
    count = int(np.ceil(width / step_s)) + 1
    time = (count - np.arange(2 * count) - 0.5) * step_s - np.asarray(delays_s)[:, None]
    cut = 0.5 * (PASS_SHARE + STOP_SHARE) * rate_hz
    inside = np.clip(1 - (time / width) ** 2, 0.0, None)
    window = np.where(inside > 0, np.i0(_KAISER_BETA * np.sqrt(inside)), 0.0)
    taps = np.sinc(2 * cut * time) * window
    normalised: Real = taps / taps.sum(axis=1, keepdims=True)
    return normalised


@dataclass
class Decimator:
    """Filter that takes chunks of a signal and gives the recorder's samples as they come.

    Sample j is at the time j times factor times step. Before the first step all channels are zero.

    Args:
        taps: of the channels; (n_channel, 2 m).
        factor: steps of the integration per sample.
        kept: values that later samples still need; (n_record, n_channel, n).
        skipped: further values that no sample needs.
    """

    taps: Real
    factor: int
    kept: Real | None = field(default=None)
    skipped: int = 0

    def push(self, chunk: Real) -> Real:
        """Return the samples that a chunk completes.

        Args:
            chunk: next values in the middle of the steps; (n_record, n, n_channel).

        Returns:
            (n_record, n_channel, n_sample).
        """
        count = self.taps.shape[1]
        values = np.ascontiguousarray(np.moveaxis(chunk, 1, 2))
        if self.kept is None:
            self.kept = np.zeros((*values.shape[:2], count // 2))
        dropped = min(self.skipped, values.shape[2])
        self.skipped -= dropped
        values = np.concatenate([self.kept, values[:, :, dropped:]], axis=2)
        number = max(0, (values.shape[2] - count) // self.factor + 1)
        windows = np.lib.stride_tricks.sliding_window_view(values, min(count, values.shape[2]), 2)
        chosen = windows[:, :, : number * self.factor : self.factor][:, :, :number]
        self.kept = values[:, :, number * self.factor :].copy()
        self.skipped += max(0, number * self.factor - values.shape[2])
        if not number:
            return np.zeros((*values.shape[:2], 0))
        samples: Real = np.einsum("rcjl,cl->rcj", chosen, self.taps)
        return samples
