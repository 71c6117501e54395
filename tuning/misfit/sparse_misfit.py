"""Misfit whose normal equations come from some of the lines only."""

from dataclasses import dataclass

from identification.words import Real
from tuning.misfit.misfit import Misfit
from tuning.misfit.normal_equations import QuadraticModel


@dataclass(frozen=True, eq=False)
class SparseMisfit:
    """Misfit whose normal equations come from evenly spaced lines only.

    Resonances are wider than a line, so that the lines left out resemble those that count. The
    minimum does not move, because the gradient comes from all lines.

    Args:
        whole: misfit of all lines.
        thin: misfit of the lines from which N comes.
        ratio: number of all lines over that of the thin misfit.
    """

    whole: Misfit
    thin: Misfit
    ratio: float

    def __call__(self, x: Real) -> tuple[float, Real]:
        """Return J and dJ/dx of all lines."""
        return self.whole(x)

    def value(self, x: Real) -> float:
        """Return J of all lines."""
        return self.whole.value(x)

    def quadratic_model(self, x: Real) -> QuadraticModel:
        """Return J and dJ/dx of all lines, and scaled normal equations of the thin lines."""
        return (*self.whole(x), self.thin.quadratic_model(x)[2] * self.ratio)
