"""Play in a joint: its spring does not act within a gap, in whose middle or beside it it rests.

Within the gap the joint has no stiffness. A centred gap stiffens with the level; one against whose
side the joint is preloaded softens with it, and hits of both signs differ (``diagnosis.levels``).
"""

from functools import partial

from diagnosis.hypothesis import Effect
from diagnosis.levels.free_levels import propose_law

EFFECT = Effect(
    partial(propose_law, "backlash"),
    noun="backlash",
    means="the joint of {place} has play {direction}",
    confirm="push {place} {direction} to one side with a soft spring or a weight and repeat: the "
    "play is gone then",
)
