r"""A link that bypasses joints, between bodies that no joint joins: a hose, a cable, a bridge.

At a point p the upper body moves against the lower one by

    r = R u,   R = [-G(p - c_low), G(p - c_high)],   G(d) = [1, -[d]x]

and the link answers with K r + s C r, K and C symmetric: springs and dampers along any three axes,
or along one alone. So it adds R' (K + s C) R, and no force on both bodies together. It is scored
along the world's axes, halfway between the centres of mass and at six points about that; from the
best of them point and axes are fitted, with dR/dp linear in p. A fit may also begin with a link as
stiff in all directions as the upper body's slides are drawn: from none at all to a strong one it is
many steps, while joints give way that a fit without it made too stiff. A strut is the same anywhere
along its line. What is stated is the mean, weighted by the stiffness,

    k = tr(K K) / tr K,   c = tr(K C) / tr K:

of a link that is alike in all directions what it has in each, of one that pulls along an axis what
it has there.
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from diagnosis.effects.link import START_POINTS, Link
from diagnosis.effects.points import are_joined
from diagnosis.hypothesis import Effect, Hypothesis, Scene


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """One for each pair of bodies."""
    machine = scene.model.machine
    bodies = machine.layout.bodies
    band = scene.session.campaign.freq_hz
    omega = 2 * np.pi * float(np.sqrt(band[band > 0].min() * band[-1]))
    # The coordinate of a body's mode is a point: nothing is tied to it.
    solid = [k for k in range(len(bodies)) if machine.body_mass[6 * k + 3, 6 * k + 3] > 0]
    for low, high in combinations(solid, 2):
        if not are_joined(machine, bodies[low], bodies[high]):
            for at in range(len(START_POINTS)):
                link = Link(machine, (low, high), omega, at)
                yield Hypothesis(
                    "parallel_path",
                    f"pair:{link.name}",
                    parts=(link.part,),
                    scored=link.along_axes,
                    signed=True,
                    bounds=link.bounds,
                    otherwise=link.firm,
                    state=link.state,
                )


EFFECT = Effect(
    propose,
    noun="a link that bypasses joints",
    means="a link between {place} bypasses the joints: a hose, a cable, a bridge",
    confirm="take cables and hoses between {place} off and repeat: the stiffness goes",
    undoes=True,
)
