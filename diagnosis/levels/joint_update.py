r"""FRFs of a machine whose one joint direction has another stiffness, by a rank-one update.

With d the joint direction, H_0 the FRFs of the machine, h_o and h_i its receptances from the
joint's force to the outputs and from the inputs to the joint's stretch, and h_g = d' Z^-1 d, the
machine with a complex stiffness kappa added to that joint has exactly (Sherman and Morrison 1950)

    H(kappa) = H_0 - h_o h_i kappa / (1 + kappa h_g).

The product h_o h_i follows from the FRFs with any one other stiffness of the joint, so that
corrections of sensors need no formula of their own. What a law of the joint does to all channels
thus takes no model, however often its parameters change.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from diagnosis.hypothesis import JointDirection, Scene
from diagnosis.levels.settings import LEVEL_SETTINGS
from diagnosis.levels.tested_joint import TestedJoint
from identification.words import Campaign, Complex, Integers, Real
from tuning import predict
from tuning.misfit.residual_statistics import ModelError, find_counted_values, profile_floor


@dataclass(frozen=True, eq=False)
class UpdatedTest:
    """FRFs of one test as the joint's stiffness changes, and what was measured.

    Args:
        base: H_0 - H of the values that count; (n_value,).
        product: h_o h_i of each; (n_value,).
        line: line of each; (n_value,).
        variance: variance of the noise of each; (n_value,).
        power: |H_point|^2 of each, above zero; (n_value,).
    """

    base: Complex
    product: Complex
    line: Integers
    variance: Real
    power: Real


@dataclass(frozen=True, eq=False)
class JointUpdate:
    """FRFs of all tests as one joint's complex stiffness changes.

    Args:
        freq_hz: lines above 0 Hz; (n_freq,).
        receptance: h_g; (n_freq,).
        tests: all tests.
    """

    freq_hz: Real
    receptance: Complex
    tests: tuple[UpdatedTest, ...]

    @classmethod
    def of_scene(
        cls, scene: Scene, joint: JointDirection, tested: TestedJoint, campaign: Campaign
    ) -> "JointUpdate":
        """Return the update of a scene's machine on the lines of a campaign above 0 Hz."""
        campaign = campaign.select_lines(campaign.freq_hz > 0)
        names = [parameter.name for parameter in scene.model.parameters]
        moved = scene.theta.copy()
        place = names.index(f"{joint.spring}.stiffness")
        moved[place] *= 1 + LEVEL_SETTINGS.compared_change
        change = float(moved[place] - scene.theta[place])
        receptance = tested.transient().receptances(campaign.freq_hz)[:, 0]
        factor = (1 + change * receptance) / change
        base, stiffer = (predict(scene.model, theta, campaign) for theta in (scene.theta, moved))
        tests = []
        for drawn, changed, test in zip(base, stiffer, campaign.tests, strict=True):
            estimate = test.estimate
            counts, power = find_counted_values(estimate)
            tests.append(
                UpdatedTest(
                    (drawn - estimate.frf.values)[counts],
                    ((drawn - changed) * factor[:, None, None])[counts],
                    np.nonzero(counts)[0],
                    np.asarray(estimate.variance)[counts],
                    power[counts],
                )
            )
        return cls(campaign.freq_hz, receptance, tuple(tests))

    @cached_property
    def variance(self) -> Real:
        """Variance of the noise of all values; (n_value,)."""
        return np.concatenate([test.variance for test in self.tests])

    @cached_property
    def power(self) -> Real:
        """|H_point|^2 of all values; (n_value,)."""
        return np.concatenate([test.power for test in self.tests])

    def residuals(self, added: Complex) -> Complex:
        """Return H(kappa) - H of all values, not finite where kappa is not; (n_value,).

        Args:
            added: kappa in each test; (n_test, n_freq).
        """
        with np.errstate(over="ignore", invalid="ignore"):
            factors = added / (1 + added * self.receptance)
            residuals = [
                test.base - test.product * factor[test.line]
                for test, factor in zip(self.tests, factors, strict=True)
            ]
        return np.concatenate(residuals)

    def weights(self, error: ModelError) -> Real:
        """Return 1 / (var + a^2 |H_point|^2) of all values; (n_value,)."""
        return 1 / (self.variance + error.floor**2 * self.power)

    def estimate_error(self, residuals: Complex) -> ModelError:
        """Return the model error that residuals show; ``residuals`` (n_value,)."""
        return profile_floor(np.abs(residuals) ** 2, self.variance, self.power)
