r"""Starts of effects along a force at a joint that explains much of a gap, in dynamic stiffness.

In one direction g of a joint, linear effects, the joint's spring and its damper add z(omega) g g'
to the dynamic stiffness. With u = H g at the channels, d = g' H at the references and h = g' H g,
the FRFs change by a matrix of rank one (Sherman and Morrison 1950),

    H -> H - u d' z / (1 + h z),

so that on each line the residual of a fit gives the z_0 with which it is least. What a z leaves
beyond that is, in units of the noise, |u d'| (z - z_0) / ((1 + h z) (1 + h z_0)): linear in z but
for one factor of the denominator, for which that of the step before is taken (Sanathanan and
Koerner 1963, IEEE Trans. Autom. Control 8, 56-58). z is linear in most sizes.

FRFs are far from linear in a strong effect: stiffness that was tuned without it may have made up
for it, as that of a joint which an inerter locks above its antiresonance. A refit of all parameters
then stays where it begins, unless it begins with the values of this fit.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from diagnosis.hypothesis import Hypothesis, Scene
from diagnosis.inference.evidence import ForceGain
from diagnosis.refits.refit import Refit, map_values
from diagnosis.refits.refitting import add_hypotheses, find_start
from diagnosis.scene_points import find_middle_frequency
from diagnosis.search.local_gap import acts_along
from diagnosis.search.score_test import Score, select_best_of_sites
from diagnosis.settings import DiagnosisSettings
from identification.words import Complex, Real
from mbmodel import AddedPart, Change, Model, Parameter, Part, PartContext
from tuning import Misfit, Parametrisation, thin_lines

_PROBE = "probe"


def begin_along(
    scene: Scene,
    base: Refit,
    ranked: Sequence[Score],
    force: ForceGain | None,
    settings: DiagnosisSettings,
) -> list[Hypothesis]:
    """Return the effects along a force at a joint, each of which begins at its fit there.

    Args:
        scene: machine, and thinning of the lines.
        base: set beside which they are refitted.
        ranked: scores of all hypotheses, the most promising first.
        force: force of any spectrum that explains much of what the set leaves; None for none.
        settings: lines that count, and steps of the fits.
    """
    along = select_best_of_sites([row for row in ranked if acts_along(row.hypothesis, force)])
    axles = [
        axle
        for axle in scene.model.machine.axles
        if force and (f"joint:{axle.stage}", axle.dof) == (force.location, force.dof)
    ]
    if not along or len(axles) != 1:
        return []
    motion = axles[0].motion(len(scene.model.machine.coordinates))
    gap = _GapAlong.measure(scene, base, axles[0].joint, motion, settings)
    begun = (gap.begin(row.hypothesis) for row in along)
    return [hypothesis for hypothesis in begun if hypothesis is not None]


@dataclass(frozen=True, eq=False)
class _GapAlong:
    """Dynamic stiffness that a model lacks in one direction of a joint, on each line of each batch.

    Args:
        base: the fit that lacks it.
        joint: name of the joint with this direction.
        motion: g; (nv,).
        omega: [rad/s]; (n_line,).
        lacking: z_0 [N/m, N m/rad]; (n_line,).
        receptance: h [m/N, rad/(N m)]; (n_line,).
        weight: |u d'| over the deviation [m/N, rad/(N m)]; (n_line,).
        max_steps: steps of the denominator.
    """

    base: Refit
    joint: str
    motion: Real
    omega: Real
    lacking: Complex
    receptance: Complex
    weight: Real
    max_steps: int

    @classmethod
    def measure(
        cls, scene: Scene, base: Refit, joint: str, motion: Real, settings: DiagnosisSettings
    ) -> "_GapAlong":
        """Return what a fit lacks, from its residuals without and with two springs there."""
        machine = base.session.model.machine
        core = np.zeros((1, 3, 1, 1))
        core[0, 0] = 1.0
        change = Change("joint", motion[:, None], motion[:, None], core)
        probe = AddedPart.linear(_PROBE, (Parameter(_PROBE, 0.0, "", positive=False),), (change,))
        session = add_hypotheses(base.session, Hypothesis(_PROBE, _PROBE, parts=(probe,)))
        spring = float(motion @ machine.mass @ motion) * find_middle_frequency(scene) ** 2
        campaign = thin_lines(session.campaign, settings.score_stride * scene.stride_factor)
        varies = session.parametrisation
        misfit = Misfit(session.model, campaign, varies, model_error_floor=base.floor)

        def compute_residuals(size: float) -> Iterator[Complex]:
            begun = Hypothesis(_PROBE, _PROBE, begin={_PROBE: size})
            return misfit.unit_residuals(varies.coordinates(find_start(base, session, begun)))

        lines = []
        sizes = 0.0, spring, 2 * spring
        for without, with_one, with_two in zip(*map(compute_residuals, sizes), strict=True):
            of_one, of_two = with_one - without, with_two - without
            power = (np.abs(of_one) ** 2).sum(axis=(1, 2))
            power = np.maximum(power, np.finfo(float).tiny)
            ratio = (of_one.conj() * of_two).sum(axis=(1, 2)) / power
            wanted = -(of_one.conj() * without).sum(axis=(1, 2)) / power
            # Changes of H are as z / (1 + h z): that of two springs is ratio times that of one.
            receptance = (2 - ratio) / (2 * spring * (ratio - 1))
            part = wanted / (1 + receptance * spring)
            lacking = part * spring / (1 - receptance * spring * part)
            weight = np.sqrt(power) * np.abs(1 + receptance * spring) / spring
            lines.append((lacking, receptance, weight))
        lacking, receptance, weight = map(np.concatenate, zip(*lines, strict=True))
        omega = np.tile(2 * np.pi * campaign.freq_hz, len(lines))
        good = np.isfinite(lacking) & np.isfinite(receptance) & (weight > 0)
        of_lines = (omega[good], lacking[good], receptance[good], weight[good])
        return cls(base, joint, motion, *of_lines, settings.schedule.max_steps)

    def begin(self, hypothesis: Hypothesis) -> Hypothesis | None:
        """Return a hypothesis that begins where its fit ends; None if it acts elsewhere too."""
        acting = Model(self.base.session.model.machine, hypothesis.parts).acting_fractions(None)
        if not acting or not all(acting) or not all(map(self._is_along, hypothesis.parts)):
            return None
        session = add_hypotheses(self.base.session, hypothesis)
        varies = session.parametrisation
        added = {p.name for part in hypothesis.parts for p in part.parameters}
        springs = {f"{self.joint}.{kind}" for kind in ("stiffness", "damping")}
        is_local = np.isin(np.array(varies.names), list(added | springs))
        ends = []
        for size in ({}, *hypothesis.otherwise):
            begun = replace(hypothesis, begin={**hypothesis.begin, **size})
            x = varies.coordinates(find_start(self.base, session, begun))
            ends.append(self._fit(hypothesis.parts, varies.restrict(is_local, x), x[is_local]))
        _, theta = min(ends, key=lambda end: end[0])
        values = map_values(varies, theta)
        local = (name for name, moves in zip(varies.names, is_local, strict=True) if moves)
        return replace(hypothesis, begin={**hypothesis.begin, **{k: values[k] for k in local}})

    def _fit(
        self, parts: Sequence[Part], varies: Parametrisation, start: Real
    ) -> tuple[float, Real]:
        """Return the cost of a fit and its parameters [SI]; (n_parameter,)."""

        def compute(x: Real) -> Complex:
            return self._add_up(parts, map_values(varies, varies.theta(x)))

        def weigh(values: Complex) -> Complex:
            z, h = self.lacking, self.receptance
            return self.weight / ((1 + h * z) * (1 + h * values))

        x = np.clip(start, varies.lower, varies.upper)
        denominator = weigh(self.lacking)
        best = np.inf, varies.theta(x)
        for _ in range(self.max_steps):

            def residual(x: Real, denominator: Complex = denominator) -> Real:
                difference = denominator * (compute(x) - self.lacking)
                return np.concatenate([difference.real, difference.imag])

            x = least_squares(residual, x, bounds=(varies.lower, varies.upper)).x
            values = compute(x)
            denominator = weigh(values)
            cost = float((np.abs(denominator * (values - self.lacking)) ** 2).sum())
            best = min(best, (cost, varies.theta(x)), key=lambda end: end[0])
        return best

    def _add_up(self, parts: Sequence[Part], values: Mapping[str, float]) -> Complex:
        """Return z of Parts, and of what spring and damper changed since the fit; (n_line,)."""
        s: Complex = 1j * self.omega.astype(complex)
        before = map_values(self.base.session.parametrisation, self.base.fit.theta)
        total = np.zeros(len(s), complex)
        for order, kind in enumerate(("stiffness", "damping")):
            name = f"{self.joint}.{kind}"
            total += (values.get(name, 0.0) - before.get(name, 0.0)) * s**order
        scale = self.motion / (self.motion @ self.motion)
        for part in parts:
            theta = np.array([values[parameter.name] for parameter in part.parameters])
            for change in part.changes(theta, self._context):
                core = np.tensordot(s[:, None] ** np.arange(3), change.core, 1)
                shape = np.ones(1) if change.shape is None else np.asarray(change.shape(s))
                shape = shape.reshape(len(shape), *(shape.shape[1:] or (1, 1)))
                total += np.einsum(
                    "i,lij,j->l", scale @ change.left, shape * core, scale @ change.right
                )
        return total

    def _is_along(self, part: Part) -> bool:
        """Return whether a Part acts in this direction of the joint alone."""
        drawn = np.array([parameter.drawn for parameter in part.parameters])
        unit = self.motion / np.linalg.norm(self.motion)
        return all(
            change.slot == "joint" and np.allclose(side, np.outer(unit, unit @ side))
            for change in part.slopes(drawn, self._context)
            for side in (change.left, change.right)
        )

    @property
    def _context(self) -> PartContext:
        return PartContext(self.base.session.model.machine, None)
