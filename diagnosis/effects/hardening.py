"""A spring that stiffens with its stretch, k x + k3 x^3 (Duffing 1918); it softens if k3 < 0."""

from functools import partial

from diagnosis.hypothesis import Effect
from diagnosis.levels.free_levels import propose_law

EFFECT = Effect(
    partial(propose_law, "hardening"),
    noun="a spring that hardens",
    means="the spring of {place} stiffens or softens {direction} with its stretch",
    confirm="repeat at a quarter and at four times the level, and at the first level again: at the "
    "joint of {place} the frequency follows the square of the level, and the damping stays",
)
