r"""Where something pushes that the model lacks, whatever it is.

An effect at a joint, linear or not, is a force between the two bodies beside what the model holds;
at a body, one on it. Suppose that such a force, at one place and in one direction, may have any
spectrum f in every test, each line on its own, normal with the variance p. What it adds to the FRFs
is f times the model's answer u to a unit force there, so that errors W^-1 become W^-1 + p u u^H.
About the fit with nothing missing, with the normal equations A = N + D and the gradient g,

    2 J_p = |r|^2 - sum k |u^H r|^2 - (g - ..)' (A - sum k Re(t^H t))^-1 (g - ..),
    k = p / (1 + p |u|^2),   t = u^H (columns of what varies),

    gain = J_0 - J_p - sum ln(1 + p |u|^2),

all weighted by the noise: how much better the data are explained, less what a force of any shape
would gain anyway (the evidence of a normal prior, Rasmussen and Williams 2006, ch. 2.3); p is
chosen to make it the most. What varies is projected out. An error in a single place and direction
stands out by thousands of nats from all others, though no effect has been thought of.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.inference.evidence import Pushed
from diagnosis.search.score_test import Factor
from identification.words import Campaign, Real
from tuning import Fit, Misfit, thin_lines
from tuning.misfit.accumulation import FreeForceReduction

_STRIDE = 16
_COMMON = 100.0  # p |u|^2 of the median line, for all directions
_OTHERS = (1.0, 10.0, 1e3, 1e4)  # for the best of them
_BEST = 12
_AT_ONCE = 2**24  # numbers of normal equations


def pushes(scene: Scene, found: Fit) -> tuple[Pushed, ...]:
    """Free forces, the best direction of every joint and body; what explains most first.

    Args:
        scene: campaign and drawn model.
        found: the fit with nothing missing, at the weights of the noise.
    """
    directions = list(_directions(scene))
    forces = np.array([force for _, _, force in directions]).T
    work = _Work(scene, found)
    gains = work.gains(forces, _COMMON)
    best = np.argsort(-gains)[:_BEST]
    for power in _OTHERS:
        gains[best] = np.maximum(gains[best], work.gains(forces[:, best], power))
    rows: dict[str, Pushed] = {}
    for k in np.argsort(-gains, kind="stable"):
        place, dof, _ = directions[k]
        rows.setdefault(place, Pushed(location=place, dof=dof, gain=float(gains[k])))
    return tuple(rows.values())


def _directions(scene: Scene) -> Iterator[tuple[str, str, Real]]:
    """Place, direction and force at the joints' coordinates; (nv,)."""
    machine = scene.model.machine
    unit, held = np.eye(len(machine.coordinates)), {one.coordinate: one.dof for one in scene.held}
    for axle in machine.axles:
        dof = held.get(axle.coordinate, axle.dof)
        yield f"joint:{axle.stage}", dof, unit[axle.coordinate]
    for number, body in enumerate(machine.layout.bodies):
        for axis, dof in enumerate(("tx", "ty", "tz", "rx", "ry", "rz")):
            yield f"body:{body}", dof, machine.jacobian[6 * number + axis]


class _Work:
    """What all directions share.

    Args:
        scene: campaign and drawn model.
        found: about which all is linear.
    """

    def __init__(self, scene: Scene, found: Fit) -> None:
        self._x, varies = found.x, found.parametrisation
        thin = thin_lines(scene.session.campaign, _STRIDE * scene.pace)
        model = scene.session.model
        self._runs = [Misfit(model, one, varies, model_error_floor=0.0) for one in _apart(thin)]
        whole = Misfit(model, thin, varies, model_error_floor=0.0)
        _, self._gradient, normal = whole.quadratic_model(self._x)
        self._matrix = normal.dense() + np.diag(varies.has_prior.astype(float))
        self._free = np.flatnonzero(~varies.coordinates_at_bound(self._x))
        self._scale = 1 / np.sqrt(np.maximum(np.diag(self._matrix), np.finfo(float).tiny))

    def gains(self, forces: Real, power: float) -> Real:
        """Of free forces with a variance relative to the median line's answer; (n_force,)."""
        step = max(1, _AT_ONCE // max(self._matrix.size, 1))
        starts = range(0, forces.shape[1], step)
        return np.concatenate([self._some(forces[:, k : k + step], power) for k in starts])

    def _some(self, forces: Real, power: float) -> Real:
        before = self._left(self._matrix, self._gradient)
        found = FreeForceReduction.zeros(forces.shape[1], len(self._x))
        for runs in self._runs:
            runs.add_force_reduction(self._x, forces, power, found)
        gains = found.value - found.expected_gain
        for k, (normal, slope) in enumerate(zip(found.normal, found.gradient, strict=True)):
            gains[k] += self._left(self._matrix - normal, self._gradient - slope) - before
        return gains

    def _left(self, matrix: Real, gradient: Real) -> float:
        """1/2 g' A^-1 g over what no bound holds."""
        chosen = self._free
        factor = Factor.of(matrix[np.ix_(chosen, chosen)], self._scale[chosen])
        return 0.5 * float(gradient[chosen] @ factor.solve(gradient[chosen][:, None])[:, 0])


def _apart(campaign: Campaign) -> list[Campaign]:
    """Tests of one reference one by one: levels and set-ups have forces of their own."""
    rounds: list[list[int]] = []
    seen: dict[str, int] = {}
    for number, test in enumerate(campaign.tests):
        reference = str(test.condition.reference.positive)
        turn = seen[reference] = seen.get(reference, -1) + 1
        if turn == len(rounds):
            rounds.append([])
        rounds[turn].append(number)
    return [replace(campaign, tests=tuple(campaign.tests[k] for k in one)) for one in rounds]
