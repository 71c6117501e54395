r"""A link that bypasses joints, between bodies that no joint joins: a hose, a cable, a bridge.

At a point p the upper body moves against the lower one by

    r = R u,   R = [-G(p - c_low), G(p - c_high)],   G(d) = [1, -[d]x].

The lower one may be the ground, as for a cable to the frame: then R = G(p - c_high). A joint of six
directions without a spring joins nothing, such as that of a platform on closed chains.

The link answers with K r + s C r, K and C symmetric and without negative eigenvalues: springs and
dampers along the same axes, or along one alone (``link.py``). It adds R' (K + s C) R, which is no
net force on both bodies together.

Score tests take K and C along the world axes, at a point halfway between the centres of mass and at
six points about it. Refits start at the best of these and fit point and axes, with dR/dp linear in
p. An alternative start is a link as stiff in all directions as the drawn slides of the upper body:
from no link to a stiff one a fit takes many steps, while joints soften that are too stiff without
the link. A link along one axis is the same anywhere on its line.

The verdict states the diagonals of K and C in world axes, and the point: those of a strut along n
are k n_a^2. A component along an axis in which nothing moves both bodies apart is not known.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from itertools import combinations

import numpy as np

from diagnosis.effects.body_box import find_jacobian
from diagnosis.effects.link import Link
from diagnosis.effects.link_place import list_places
from diagnosis.effects.scales import ARM_UNIT_M
from diagnosis.hypothesis import Effect, Hypothesis, Scene
from diagnosis.movable import Movable
from diagnosis.scene_points import are_joined, find_middle_frequency
from identification.words import Real
from mbmodel import WORLD


def propose(scene: Scene) -> Iterator[Hypothesis]:
    """Yield one for each pair of bodies, or of the ground and a body, and start point."""
    machine, omega = scene.model.machine, find_middle_frequency(scene)
    bodies, jacobian = machine.layout.bodies, find_jacobian(scene)
    # The coordinate of a body's mode is a point, to which no link is tied.
    solid = [k for k in range(len(bodies)) if machine.body_mass[6 * k + 3, 6 * k + 3] > 0]
    pairs = [*combinations(solid, 2), *((None, body) for body in solid)]
    for low, high in pairs:
        if not are_joined(machine, WORLD if low is None else bodies[low], bodies[high]):
            for place in list_places(machine, jacobian, (low, high)):
                if not place.moved.any():
                    continue
                link = Link(place, omega)
                yield Hypothesis(
                    "parallel_path",
                    f"pair:{link.name}",
                    parts=(link.part,),
                    scored=link.scored,
                    signed=True,
                    bounds=link.bounds,
                    otherwise=link.stiff_starts,
                    movable=Movable(
                        link.bodies, partial(_read_values, link), partial(_start_values, link)
                    ),
                    state=link.state,
                )


def _read_values(link: Link, fitted: Mapping[str, float]) -> dict[str, Real]:
    """Return the sizes of springs and dampers [SI], the entries of N, and the point [m]."""
    theta = np.array([fitted[name] for name in link.names])
    return {
        "sizes": link.units[:, None] * theta[:6].reshape(2, 3),
        "axes": theta[6:9],
        "point": link.place.locate(theta[9:]),
    }


def _start_values(link: Link, values: Mapping[str, Real]) -> dict[str, float]:
    """Return start values from those of a link between other bodies."""
    sizes = (values["sizes"] / link.units[:, None]).ravel()
    point = (values["point"] - link.place.start) / ARM_UNIT_M
    theta = np.concatenate([sizes, values["axes"], point]).tolist()
    return dict(zip(link.names, theta, strict=True))


EFFECT = Effect(
    propose,
    noun="a link that bypasses joints",
    means="a link between {place} bypasses the joints: a hose, a cable, a bridge",
    confirm="take cables and hoses between {place} off and repeat: the stiffness goes",
    undoes=True,
)
