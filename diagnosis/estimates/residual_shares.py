"""Where the remaining gap shows: the baseline that every diagnosis has to beat.

The excess of the channels on a body is a symptom, not a cause: a fault at one joint moves every
body above it. So these shares say where to look first, and nothing about why.
"""

from dataclasses import dataclass

import numpy as np

from identification.words import Layout
from tuning import ChannelGaps


@dataclass(frozen=True)
class ResidualShare:
    """One body's part of the remaining gap.

    Args:
        body: its name.
        share: of the sum of (e_c / noise_c)^2 over all channels.
        excess: rms of e_c / noise_c over the body's channels.
        channels: how many those are.
    """

    body: str
    share: float
    excess: float
    channels: int


def compute_residual_shares(gaps: ChannelGaps, layout: Layout) -> tuple[ResidualShare, ...]:
    """Divide the excess among the bodies, the largest first.

    Args:
        gaps: of each channel; those without noise are left out, since they have no excess.
        layout: which point sits on which body.
    """
    has_noise = gaps.noise > 0
    squares = np.where(has_noise, gaps.error / np.where(has_noise, gaps.noise, 1.0), 0.0) ** 2
    bodies = np.array([layout.body_name(dof.point) for dof in gaps.outputs])
    total = squares.sum()
    shares = []
    for body in layout.bodies:
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
