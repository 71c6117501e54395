r"""Free-force marginal likelihood: place at which an unknown force explains most of the gap.

An effect at a joint, linear or not, is a force between its two bodies that the model lacks. An
effect at a body is a force on the body. Suppose that the force, at one place and in one direction,
has any spectrum f in every test, independent on each line, with the prior variance p. It adds f u
to the FRFs, where u is the response of the model to a unit force there, so that the covariance W^-1
of the errors becomes W^-1 + p u u^H. About a fit with the normal equations A = N + D (D the
priors), the gradient g and the residual r, all weighted by the noise, the cost at its minimum is

    2 J_p = |r|^2 - sum k |u^H r|^2 - (g - h)' (A - sum k Re(t^H t))^-1 (g - h),
    k = p / (1 + p |u|^2),   t = u^H J,   h = sum k Re(t^H u^H r),

with J the derivatives of the FRFs by all that varies, which is so projected out. The gain is

    gain = J_0 - J_p - sum ln(1 + p |u|^2).

The last term is what a force of any spectrum gains on average where nothing is missing (evidence of
a Gaussian prior, Rasmussen and Williams 2006, ch. 2.3). Of several p, that of the largest gain with
nothing else varying is taken (empirical Bayes). An error at a single place and direction gains
thousands of nats more there than elsewhere, also if no effect of the catalogue describes it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import Scene
from diagnosis.inference.evidence import ForceGain
from diagnosis.search.linearised_fit import Factor
from identification.words import DIRECTIONS, Campaign, Integers, Real
from tuning import Fit, Misfit, thin_lines
from tuning.misfit.accumulation import FreeForceReduction


def fit_free_forces(scene: Scene, fit: Fit, model_error_floor: float) -> tuple[ForceGain, ...]:
    """Return the free force of every joint and body in its best direction, the largest gain first.

    Args:
        fit: fit about which the model is linearised.
        model_error_floor: relative model error that the fit tolerates.
    """
    directions = list(_list_directions(scene))
    forces = np.array([force for _, _, force in directions]).T
    linearised = _LinearisedFit.linearise(scene, fit, model_error_floor)
    most = scene.settings.max_force_values
    powers = linearised.choose_powers(forces, np.array(scene.settings.force_powers))
    gains = linearised.compute_gains(forces, powers, most)
    rows: dict[str, ForceGain] = {}
    for k in np.argsort(-gains, kind="stable"):
        place, dof, _ = directions[k]
        gain = float(gains[k])
        row = ForceGain(location=place, dof=dof, gain=gain, share=gain / linearised.data_cost)
        rows.setdefault(place, row)
    return tuple(rows.values())


def _list_directions(scene: Scene) -> Iterator[tuple[str, str, Real]]:
    """Yield place, direction and generalised force at the joints' coordinates; (nv,)."""
    machine = scene.model.machine
    rigid = {direction.coordinate: direction.dof for direction in scene.rigid_directions}
    for axle in machine.axles:
        dof = rigid.get(axle.coordinate, axle.dof)
        yield f"joint:{axle.stage}", dof, axle.motion(len(machine.coordinates))
    for number, body in enumerate(machine.layout.bodies):
        for axis, dof in enumerate(DIRECTIONS):
            yield f"body:{body}", dof, machine.jacobian[6 * number + axis]


@dataclass(frozen=True, eq=False)
class _LinearisedFit:
    """Linearised fit that all directions share.

    Args:
        x: coordinates of the fit; (n_x,).
        misfits: misfits of the groups of tests, each test with a force of its own.
        gradient: gradient of the cost; (n_x,).
        matrix: normal equations with priors; (n_x, n_x).
        free: coordinates that are not at a bound.
        data_cost: cost of the residual [nats].
    """

    x: Real
    misfits: tuple[Misfit, ...]
    gradient: Real
    matrix: Real
    free: Integers
    data_cost: float

    @classmethod
    def linearise(cls, scene: Scene, fit: Fit, model_error_floor: float) -> "_LinearisedFit":
        """Return the linearisation about a fit."""
        varies, model = fit.parametrisation, scene.session.model
        stride = scene.settings.score_stride * scene.stride_factor
        thin = thin_lines(scene.session.campaign, stride)

        def build_misfit(campaign: Campaign) -> Misfit:
            return Misfit(model, campaign, varies, model_error_floor=model_error_floor)

        whole = build_misfit(thin)
        value, gradient, normal = whole.quadratic_model(fit.x)
        return cls(
            fit.x,
            tuple(build_misfit(campaign) for campaign in _split_by_reference(thin)),
            gradient,
            normal.dense() + np.diag(varies.precision),
            np.flatnonzero(~varies.coordinates_at_bound(fit.x)),
            max(value - whole.prior(fit.x), np.finfo(float).tiny),
        )

    @property
    def _scale(self) -> Real:
        return 1 / np.sqrt(np.maximum(np.diag(self.matrix), np.finfo(float).tiny))

    def choose_powers(self, forces: Real, powers: Real) -> Real:
        """Return the power of each force with the largest gain if nothing else varies; (n_force,).

        Args:
            forces: generalised forces; (nv, n_force).
            powers: p |u|^2 of the median line; (n_power,).
        """
        gains = sum(misfit.force_gains(self.x, forces, powers) for misfit in self.misfits)
        chosen: Real = powers[np.argmax(gains, axis=0)]
        return chosen

    def compute_gains(self, forces: Real, powers: Real, most: int) -> Real:
        """Return the gains of free forces; (n_force,).

        Args:
            forces: generalised forces; (nv, n_force).
            powers: p |u|^2 of the median line, for each force; (n_force,).
            most: values of normal equations in memory at once.
        """
        step = max(1, most // max(self.matrix.size, 1))
        starts = range(0, forces.shape[1], step)
        return np.concatenate(
            [self._compute_some(forces[:, k : k + step], powers[k : k + step]) for k in starts]
        )

    def _compute_some(self, forces: Real, powers: Real) -> Real:
        before = self._explained_cost(self.matrix, self.gradient)
        reduction = FreeForceReduction.zeros(forces.shape[1], len(self.x))
        for misfit in self.misfits:
            misfit.add_force_reduction(self.x, forces, powers, reduction)
        gains = reduction.value - reduction.expected_gain
        for k, (normal, slope) in enumerate(zip(reduction.normal, reduction.gradient, strict=True)):
            gains[k] += self._explained_cost(self.matrix - normal, self.gradient - slope) - before
        return gains

    def _explained_cost(self, matrix: Real, gradient: Real) -> float:
        """Return 1/2 g' A^-1 g over the free coordinates."""
        chosen = self.free
        factor = Factor.factorise(matrix[np.ix_(chosen, chosen)], self._scale[chosen])
        return 0.5 * float(gradient[chosen] @ factor.solve(gradient[chosen][:, None])[:, 0])


def _split_by_reference(campaign: Campaign) -> list[Campaign]:
    """Return campaigns with one test of each reference: each test has a force of its own."""
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
