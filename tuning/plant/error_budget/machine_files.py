"""Machine of a budget from its MJCF, with what the fit that wrote it knows of its errors."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

from identification.words import Real
from mbmodel import Model, SpringPart, machine_model, with_loops
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.files.plant_folder import HeldOutResult, has_posterior, held_out_beside
from tuning.files.posterior_file import read_posterior

POSTERIOR_MACHINES = 60  # for bands and stability: a deviation is right to 9 %
MACHINE_SEED = 1


@dataclass(frozen=True, eq=False)
class FittedMachine:
    """A machine at its nominal values, and the errors of the fit that wrote its MJCF.

    Args:
        model: of the machine; that of the posterior if there is one.
        posterior: of the parameters; None for a machine that no fit wrote.
        source: MJCF of the fit, beside which its held-out FRFs lie; None for none.
    """

    model: Model
    posterior: PosteriorOfModel | None = None
    source: Path | None = None

    @classmethod
    def read(cls, model: Model, path: Path) -> Self:
        """Return a model with the posterior of the fit that wrote its MJCF, if there is one.

        Args:
            model: nominal model of a machine. With what is put on it, or with laws of its springs
                beyond the MJCF, it is not the fitted one.
            path: MJCF from which the machine was made.

        Raises:
            InputError: the posterior is broken or of another machine.
        """
        is_alone = all(isinstance(part, SpringPart) for part in model.parts)
        if not (is_alone and model.machine.source.name == path.name and has_posterior(path)):
            return cls(model)
        posterior = read_posterior(path.parent).on(machine_model(model.machine))
        return cls(posterior.model, posterior, path)

    @cached_property
    def thetas(self) -> Real | None:
        """Parameters of machines drawn from the posterior [SI]; (n_sample, n_theta), or None."""
        posterior = self.posterior
        return None if posterior is None else posterior.sample(POSTERIOR_MACHINES, MACHINE_SEED)

    @cached_property
    def held_out(self) -> HeldOutResult | None:
        """FRFs of the fit on held-out lines; None if they are not the plant's, or without a fit.

        Raises:
            InputError: files of the fit are damaged.
        """
        return None if self.source is None else held_out_beside(self.source)

    def open_loops(self) -> Self:
        """Return the machine without the loops that are closed around it."""
        model, posterior = open_loops(self.model), self.posterior
        if posterior is not None:
            posterior = replace(posterior, model=model)
        return replace(self, model=model, posterior=posterior)


def open_loops(model: Model) -> Model:
    """Return a model without the loops that are closed around its machine."""
    return replace(model, machine=with_loops(model.machine, ())) if model.loops else model
