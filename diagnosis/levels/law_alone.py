"""A law at one joint direction, the rest of the machine held: its residuals, and its start."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.hypothesis import JointDirection, Scene
from diagnosis.levels.free_levels import list_levels
from diagnosis.levels.joint_update import JointUpdate
from diagnosis.levels.law_family import LawFamily
from diagnosis.levels.law_simulation import compute_peak_stretch
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from identification.words import Complex, Real
from tuning import thin_lines
from tuning.misfit.residual_statistics import ModelError


@dataclass(frozen=True, eq=False)
class LawStart:
    """A law, and where its refit begins.

    Args:
        joint: direction of the joint.
        theta: its parameters.
        parallel: stiffness and damping of the joint's linear spring and damper in parallel; (2,).
        cost: -ln L of the FRFs with it per value, but for a constant [nats].
        floor: relative model error that it leaves.
        is_loose: whether it is a gap that the motion does not leave at the lowest level.
    """

    joint: JointDirection
    family: LawFamily
    theta: tuple[float, ...]
    parallel: Real
    cost: float
    floor: float
    is_loose: bool = False


@dataclass(frozen=True, eq=False)
class TriedLaw:
    """A law with its residuals.

    Args:
        values: its parameters, without that of the joint's stiffness, then stiffness and damping of
            the joint in parallel with it; (n_value,).
        residuals: of all values; (n_value,).
        error: model error that they show.
    """

    family: LawFamily
    values: Real
    residuals: Complex
    error: ModelError


@dataclass(frozen=True, eq=False)
class LawAlone:
    """A fit of one joint's law, the rest of the machine held.

    Args:
        joint: direction of the joint.
        tested: machine and hits.
        update: FRFs as the joint's stiffness changes.
        stiffest: largest stiffness of the joint at any level.
        middle_stretch: largest stretch of the linear machine under hits of the middle level.
        largest_stretch: under any hit.
    """

    joint: JointDirection
    tested: TestedJoint
    update: JointUpdate
    stiffest: float
    middle_stretch: float
    largest_stretch: float

    @classmethod
    def of_scene(cls, scene: Scene, joint: JointDirection, stiffest: float) -> "LawAlone":
        """Return the fit of a joint's law about a linear machine.

        Args:
            scene: linear machine at the lowest level.
            stiffest: largest stiffness of the joint at any level.
        """
        campaign = scene.session.campaign
        thin = thin_lines(campaign, LEVEL_SETTINGS.start_stride * scene.stride_factor)
        tested = replace(
            TestedJoint.of_scene(scene, joint),
            steps_per_period=LEVEL_SETTINGS.coarse_steps_per_period,
        )
        levels = list_levels(campaign)
        peaks = compute_peak_stretch(tested.transient(), tested.hits)
        middle = levels[len(levels) // 2]
        is_low = np.array([(test.condition.level_n or 0.0) <= middle for test in campaign.tests])
        update = JointUpdate.of_scene(scene, joint, tested, thin)
        return cls(joint, tested, update, stiffest, float(peaks[is_low].max()), float(peaks.max()))

    def list_starts(self, family: LawFamily, least_damping: float) -> list[Real]:
        """Return where a family may begin: any level's least damping, and the lowest level's."""
        stiffness = self.tested.stiffness if family.softest_is_linear else self.stiffest
        starts = []
        for theta in family.starts(stiffness, self.middle_stretch):
            parameters = np.array(theta[: family.count])
            stiff = stiffness - family.stuck(parameters)
            for damping in (least_damping, self.tested.damping):
                values = np.array([*parameters, stiff, damping])
                starts.append(self.limit(family, values))
        return starts

    def evaluate(self, tried: Sequence[tuple[LawFamily, Real]]) -> list[TriedLaw | None]:
        """Return laws with their residuals; None for one whose motion grows without bound."""
        points: list[TriedLaw | None] = []
        for (family, values), kappa in zip(tried, self._add(tried), strict=True):
            residuals = self.update.residuals(kappa)
            if np.isfinite(residuals).all():
                error = self.update.estimate_error(residuals)
                points.append(TriedLaw(family, values, residuals, error))
            else:
                points.append(None)
        return points

    def limit(self, family: LawFamily, values: Real) -> Real:
        """Return values within the bounds of a family; spring near any level's, damper near it."""
        bounds = family.bounds(self.tested.stiffness, self.largest_stretch)[: family.count]
        share = LEVEL_SETTINGS.min_own_share
        spring = share * self.tested.stiffness, self.stiffest / share
        damper = share * self.tested.damping, self.tested.damping / share
        lower, upper = np.array([*bounds, spring, damper]).T
        return np.clip(values, lower, upper)

    def build_start(self, point: TriedLaw) -> LawStart:
        """Return where the refit of a law begins."""
        theta = point.family.complete(point.values[:-2], float(point.values[-2]))
        return LawStart(
            self.joint,
            point.family,
            tuple(theta.tolist()),
            point.values[-2:],
            cost=point.error.cost / point.error.values,
            floor=point.error.floor,
        )

    def _add(self, tried: Sequence[tuple[LawFamily, Real]]) -> Complex:
        """Return the complex stiffness that laws add; (n_law, n_test, n_freq)."""
        laws = [
            (family, family.complete(values[:-2], float(values[-2])), values[-2:])
            for family, values in tried
        ]
        return self.tested.add_laws(laws, self.update.freq_hz)
