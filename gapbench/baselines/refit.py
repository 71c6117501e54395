"""The refit that all baselines share: stiffness, damping and tolerances, and what it leaves."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.words import Complex, Mask, Real, Test
from tuning import Session, fit_at_error_floor, open_session, predict


@dataclass(frozen=True, eq=False)
class TestResidual:
    """What the refit leaves of a test.

    Args:
        test: as it was measured.
        model: FRFs of the re-tuned model; (n_freq, n_out).
        left: measured less predicted; (n_freq, n_out).
        variance: of it; like left.
        moves: channels that were measured and move; (n_out,).
    """

    test: Test
    model: Complex
    left: Complex
    variance: Real
    moves: Mask


@dataclass(frozen=True, eq=False)
class CampaignRefit:
    """A re-tuned model and what it leaves.

    Args:
        session: campaign and model.
        theta: parameters of the refit [SI]; (n_parameter,).
        tests: residual of each test; of a machine before and after a change, what the change made.
    """

    session: Session
    theta: Real
    tests: tuple[TestResidual, ...]

    @property
    def excess(self) -> float:
        """Root mean square over channels of the residual over its noise; 1: nothing is left."""
        return float(np.sqrt(np.mean(np.concatenate([channel_excess(t) for t in self.tests]))))


def channel_excess(residual: TestResidual) -> Real:
    """Return the power of each channel's residual over that of its noise; (n_moving,)."""
    power = (np.abs(residual.left) ** 2).sum(axis=0) / residual.variance.sum(axis=0)
    return np.asarray(power[residual.moves])


def refit(folder: Path) -> CampaignRefit:
    """Tune a campaign's model to its tests.

    Of tests before and after a change, the model is tuned to those before; what is left is then
    the measured difference.
    """
    session = open_session(folder)
    tuned = session.campaign.select_state("before")
    theta = fit_at_error_floor(session.model, tuned, session.parametrisation).fit.theta
    later = session.campaign.select_state("after")
    predicted = predict(session.model, theta, later)
    tests = []
    for number, (test, values) in enumerate(zip(later.tests, predicted, strict=True)):
        measured, variance = test.estimate.frf.values[:, :, 0], test.estimate.variance[:, :, 0]
        base = values[:, :, 0]
        if session.campaign.has_states:
            before = tuned.tests[number].estimate
            base, variance = before.frf.values[:, :, 0], variance + before.variance[:, :, 0]
        moves = test.estimate.measured[:, 0] & (np.abs(measured) ** 2).any(axis=0)
        moves &= variance.sum(axis=0) > 0
        tests.append(TestResidual(test, values[:, :, 0], measured - base, variance, moves))
    return CampaignRefit(session, theta, tuple(tests))
