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
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.inference.evidence import ForceGain
from diagnosis.search.linearised_fit import Factor
from identification.words import Campaign, Integers, Real
from tuning import Fit, Misfit, thin_lines
from tuning.misfit.accumulation import FreeForceReduction

_FORCE_STRIDE = 16
_COMMON_POWER = 100.0  # p |u|^2 of the median line, for all directions
_FURTHER_POWERS = (1.0, 10.0, 1e3, 1e4)  # for the best of them
_MAX_REFINED = 12
_MAX_NUMBERS_AT_ONCE = 2**24  # numbers of normal equations


def fit_free_forces(scene: Scene, fit: Fit, model_error_floor: float) -> tuple[ForceGain, ...]:
    """Free forces, the best direction of every joint and body; what explains most first.

    Args:
        scene: campaign and drawn model.
        fit: the fit about which all is linear.
        model_error_floor: relative model error that it tolerates.
    """
    directions = list(_directions(scene))
    forces = np.array([force for _, _, force in directions]).T
    work = _Work.about(scene, fit, model_error_floor)
    gains = work.gains(forces, _COMMON_POWER)
    best = np.argsort(-gains)[:_MAX_REFINED]
    for power in _FURTHER_POWERS:
        gains[best] = np.maximum(gains[best], work.gains(forces[:, best], power))
    rows: dict[str, ForceGain] = {}
    for k in np.argsort(-gains, kind="stable"):
        place, dof, _ = directions[k]
        gain = float(gains[k])
        row = ForceGain(location=place, dof=dof, gain=gain, share=gain / work.data_cost)
        rows.setdefault(place, row)
    return tuple(rows.values())


def _directions(scene: Scene) -> Iterator[tuple[str, str, Real]]:
    """Place, direction and force at the joints' coordinates; (nv,)."""
    machine = scene.model.machine
    unit, held = (
        np.eye(len(machine.coordinates)),
        {direction.coordinate: direction.dof for direction in scene.rigid_directions},
    )
    for axle in machine.axles:
        dof = held.get(axle.coordinate, axle.dof)
        yield f"joint:{axle.stage}", dof, unit[axle.coordinate]
    for number, body in enumerate(machine.layout.bodies):
        for axis, dof in enumerate(("tx", "ty", "tz", "rx", "ry", "rz")):
            yield f"body:{body}", dof, machine.jacobian[6 * number + axis]


@dataclass(frozen=True, eq=False)
class _Work:
    """Linearised fit that all directions share.

    Args:
        x: coordinates of the fit; (n_x,).
        runs: misfits of tests that have forces of their own.
        gradient: of the cost; (n_x,).
        matrix: normal equations with priors; (n_x, n_x).
        free: coordinates that no bound holds.
        data_cost: cost of the residual [nats].
    """

    x: Real
    runs: tuple[Misfit, ...]
    gradient: Real
    matrix: Real
    free: Integers
    data_cost: float

    @classmethod
    def about(cls, scene: Scene, fit: Fit, model_error_floor: float) -> "_Work":
        """Linearise about a fit."""
        varies, model = fit.parametrisation, scene.session.model
        thin = thin_lines(scene.session.campaign, _FORCE_STRIDE * scene.stride_factor)

        def misfit(campaign: Campaign) -> Misfit:
            return Misfit(model, campaign, varies, model_error_floor=model_error_floor)

        whole = misfit(thin)
        value, gradient, normal = whole.quadratic_model(fit.x)
        return cls(
            fit.x,
            tuple(misfit(campaign) for campaign in _split_by_reference(thin)),
            gradient,
            normal.dense() + np.diag(varies.has_prior.astype(float)),
            np.flatnonzero(~varies.coordinates_at_bound(fit.x)),
            max(value - whole.prior(fit.x), np.finfo(float).tiny),
        )

    @property
    def _scale(self) -> Real:
        return 1 / np.sqrt(np.maximum(np.diag(self.matrix), np.finfo(float).tiny))

    def gains(self, forces: Real, power: float) -> Real:
        """Of free forces with a variance relative to the median line's answer; (n_force,)."""
        step = max(1, _MAX_NUMBERS_AT_ONCE // max(self.matrix.size, 1))
        starts = range(0, forces.shape[1], step)
        return np.concatenate([self._gains_of_some(forces[:, k : k + step], power) for k in starts])

    def _gains_of_some(self, forces: Real, power: float) -> Real:
        before = self._explained_cost(self.matrix, self.gradient)
        reduction = FreeForceReduction.zeros(forces.shape[1], len(self.x))
        for runs in self.runs:
            runs.add_force_reduction(self.x, forces, power, reduction)
        gains = reduction.value - reduction.expected_gain
        for k, (normal, slope) in enumerate(zip(reduction.normal, reduction.gradient, strict=True)):
            gains[k] += self._explained_cost(self.matrix - normal, self.gradient - slope) - before
        return gains

    def _explained_cost(self, matrix: Real, gradient: Real) -> float:
        """1/2 g' A^-1 g over what no bound holds."""
        chosen = self.free
        factor = Factor.of(matrix[np.ix_(chosen, chosen)], self._scale[chosen])
        return 0.5 * float(gradient[chosen] @ factor.solve(gradient[chosen][:, None])[:, 0])


def _split_by_reference(campaign: Campaign) -> list[Campaign]:
    """Tests of one reference one by one: levels and set-ups have forces of their own."""
    rounds: list[list[int]] = []
    seen: dict[str, int] = {}
    for number, test in enumerate(campaign.tests):
        reference = str(test.condition.reference.positive)
        turn = seen[reference] = seen.get(reference, -1) + 1
        if turn == len(rounds):
            rounds.append([])
        rounds[turn].append(number)
    return [
        replace(campaign, tests=tuple(campaign.tests[k] for k in numbers)) for numbers in rounds
    ]
