"""Shares of the residual gap by body: the baseline that every diagnosis has to beat.

The excess of the channels on a body is a symptom, not a cause, because a fault at one joint moves
every body above it. The shares say where to look first, and nothing about the cause.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Layout
from tuning import ChannelGaps


@dataclass(frozen=True)
class ResidualShare:
    """Share of one body in the residual gap.

    Args:
        body: name of the body.
        share: share of the sum of (e_c / noise_c)^2 over all channels.
        excess: rms of e_c / noise_c over the channels of the body.
        channels: number of these channels.
    """

    body: str
    share: float
    excess: float
    channels: int


def compute_residual_shares(gaps: ChannelGaps, layout: Layout) -> tuple[ResidualShare, ...]:
    """Return the shares of the bodies, the largest first.

    Args:
        gaps: gap of each channel; channels without noise have no excess and do not count.
        layout: points of the bodies.
    """
    has_noise = gaps.noise > 0
    squares = np.where(has_noise, gaps.error / np.where(has_noise, gaps.noise, 1.0), 0.0) ** 2
    bodies = np.array([layout.owner_name(dof) for dof in gaps.outputs])
    total = squares.sum()
    shares = []
    for body in dict.fromkeys((*layout.bodies, *bodies.tolist())):
        is_on_body = (bodies == body) & has_noise
        if is_on_body.any() and total > 0:
            shares.append(
                ResidualShare(
                    body=body,
                    share=float(squares[is_on_body].sum() / total),
                    excess=float(np.sqrt(squares[is_on_body].mean())),
                    channels=int(is_on_body.sum()),
                )
            )
    return tuple(sorted(shares, key=lambda share: -share.share))
