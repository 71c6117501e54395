"""Dry friction beside a joint's spring: a Jenkins element in parallel, which slides at a force.

At small motion it is a spring k; it slides where its force reaches the limit (Jenkins 1962). So the
joint softens with the level, and its damping rises, has a maximum and falls (``diagnosis.levels``).
Elements that slide bit by bit (Iwan 1966), or along a smooth curve (LuGre, Canudas de Wit et al.
1995; Bouc-Wen, Wen 1976), do so as well, and the effect stands for all of them.
"""

from functools import partial

from diagnosis.hypothesis import Effect
from diagnosis.levels.free_levels import propose_law

EFFECT = Effect(
    partial(propose_law, "friction"),
    noun="friction",
    means="the joint of {place} sticks {direction} at small motion and slides at large motion",
    confirm="repeat at a quarter and at four times the level, and at the first level again: the "
    "joint of {place} softens {direction} with the level, and comes back",
    laws=("Jenkins", "Iwan", "LuGre", "Bouc-Wen"),
)
