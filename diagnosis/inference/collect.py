"""Fits as plain numbers: the evidence of a verdict."""

from diagnosis.inference.evidence import FittedSet
from diagnosis.refits.refit import Refit


def fitted_set(refit: Refit) -> FittedSet:
    """Return a refit as plain numbers."""
    statistics = refit.statistics
    return FittedSet(
        keys=refit.keys,
        floor=statistics.floor,
        cost=statistics.cost,
        prior=refit.prior,
        values=statistics.values,
        fitted_values=refit.fitted_values,
        noise_share=statistics.noise_share,
        effective_values=statistics.effective_values,
        chi_square=statistics.chi_square,
        serial=refit.serial,
        doubt=refit.doubt,
        shifts=tuple(refit.tolerance_shift(cause) for cause in refit.causes),
    )
