"""The model of a campaign whose tests had models or poses of their own, at tuned parameters."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification import read_settings
from identification.readers.result_files import read_result_json
from identification.words import Loop, Real
from mbmodel import Model, load_machine, machine_model, with_loops
from tuning.assessment.parameter_posterior import PosteriorOfModel
from tuning.campaign_machine import state_machine
from tuning.files.result import TUNED_JSON
from tuning.files.schema import TunedFile


@dataclass(frozen=True, eq=False)
class VariantModel:
    """A model with the variants of its campaign.

    Args:
        model: of the campaign's machine with its variants; no loop is closed.
        theta: its parameters, tuned ones where there are [SI]; (n_parameter,).
    """

    model: Model
    theta: Real

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variants."""
        return tuple(self.model.machine.variants)

    def with_loops(self, loops: tuple[Loop, ...]) -> Model:
        """Return the model with these loops closed around the machine and its variants."""
        return replace(self.model, machine=with_loops(self.model.machine, loops))

    def thetas(self, posterior: PosteriorOfModel, drawn: Real) -> Real:
        """Return parameters of machines drawn from the posterior; (n_sample, n_parameter).

        Args:
            posterior: of the tuned machine.
            drawn: parameters of that machine's model; (n_sample, n_theta).
        """
        index_of = {parameter.name: k for k, parameter in enumerate(self.model.parameters)}
        numbers = [index_of[name] for name in posterior.posterior.parameters]
        thetas: Real = np.tile(self.theta, (len(drawn), 1))
        thetas[:, numbers] += (drawn - posterior.model.drawn)[:, posterior.indices]
        return thetas


def read_variant_model(campaign: Path, tuning: Path | None = None) -> VariantModel | None:
    """Return the model of a campaign with the machines of its tests.

    Args:
        campaign: path of campaign.toml.
        tuning: folder whose tuned values it gets; None for the nominal ones.

    Returns:
        None if all tests were made with the campaign's machine as it stands.

    Raises:
        InputError: a file that cannot be used.
    """
    source, settings = read_settings(campaign)
    if settings.model is None or not any(entry.variant for entry in settings.test):
        return None
    nominal = load_machine(source.parent / settings.model, key=settings.key)
    model = machine_model(state_machine(source, settings, nominal))
    tuned: dict[str, float] = {}
    if tuning is not None:
        summary = read_result_json(tuning / TUNED_JSON, TunedFile, "mbw tune")
        tuned = {row.name: row.tuned for row in summary.parameters}
    theta = np.array([tuned.get(each.name, each.drawn) for each in model.parameters])
    return VariantModel(model, theta)
