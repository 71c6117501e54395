"""Verdict of a diagnosis on the workbench: its causes on the machine, each switched on and off.

A cause that changes the equation of motion is a Part whose parameter is its share: 0 leaves it out,
1 is the fit. A fault of a sensor or a hit is a move of the tolerances that it releases.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identification.words import Campaign, Tolerance
from mbmodel import Machine, Model
from mbw.diagnose.headline import lead
from mbw.diagnose.sentences import cause_parameters
from mbw.results.diagnosed_files import StoredDiagnosis
from mbw.results.stored_causes import StoredCause, read_causes, read_fitted_values
from tuning import Parametrisation, parametrise

_MAX_SHARE = 1.5  # share of a cause that its slider reaches


@dataclass(frozen=True, eq=False)
class ShownVerdict:
    """A diagnosis with the causes that its fit has.

    Args:
        diagnosis: as its folder holds it.
        causes: of its fit, which can be switched.
    """

    diagnosis: StoredDiagnosis
    causes: tuple[StoredCause, ...]

    @classmethod
    def of(cls, diagnosis: StoredDiagnosis, campaign: Campaign) -> "ShownVerdict":
        """Return what the page shows of a diagnosis.

        Raises:
            InputError: its arrays do not belong together.
        """
        conditions = (test.condition for test in campaign.tests)
        tests = [(each.test, str(each.reference)) for each in conditions]
        return cls(diagnosis, read_causes(diagnosis.arrays, tests))

    def fitted_values(self) -> dict[str, float]:
        """Return the parameters of the fit [SI], and the whole share of each cause, by name."""
        shares = {_share(cause): 1.0 for cause in self.causes if cause.terms}
        return read_fitted_values(self.diagnosis.arrays) | shares

    def add_to(
        self, model: Model, varies: Parametrisation, tolerance: Tolerance
    ) -> tuple[Model, Parametrisation]:
        """Return a model with the causes as Parts, and coordinates whose bounds hold the fit.

        A fit releases the tolerance that a fault hides in, and admits a few that lie far out.

        Args:
            model: of the campaign.
            varies: its coordinates.
            tolerance: of the campaign.
        """
        parts = [
            cause.build_part(_share(cause), model.machine) for cause in self.causes if cause.terms
        ]
        whole = Model(model.machine, (*model.parts, *parts))
        extended = varies.extend(parametrise(whole, tolerance))
        fitted = self.fitted_values()
        theta = [fitted.get(each.name, each.drawn) for each in extended.parameters]
        x = extended.coordinates(np.where(extended.free, theta, extended.fixed))
        is_share = np.isin(extended.names, [_share(cause) for cause in self.causes])
        lower = np.where(is_share, 0.0, np.minimum(extended.lower, x))
        upper = np.where(is_share, _MAX_SHARE, np.maximum(extended.upper, x))
        return whole, replace(extended, lower=lower, upper=upper)

    def describe(self, coordinates: Mapping[str, float]) -> dict[str, Any]:
        """Return the headline and a row for each cause of the verdict.

        Args:
            coordinates: x of the fit, by name.
        """
        verdict, shown = self.diagnosis.verdict, self.diagnosis.shown
        switched = {(cause.effect, cause.location): cause for cause in self.causes}
        rows = []
        for row, means in zip(verdict.causes, shown.means, strict=True):
            cause = switched.get((row.effect, row.location))
            names = (
                [] if cause is None else [*cause.values, *([_share(cause)] if cause.terms else [])]
            )
            rows.append(
                {
                    "name": f"{row.effect} at {row.location}{f' {row.dof}' if row.dof else ''}",
                    "probability": row.probability,
                    "means": means,
                    "sizes": cause_parameters(row),
                    "places": row.places or [row.location],
                    "moves": {name: coordinates[name] for name in names if name in coordinates},
                }
            )
        return {"headline": lead(self.diagnosis), "causes": rows}

    def list_marks(self, machine: Machine) -> list[dict[str, Any]]:
        """Return the places of the causes in the picture, numbered as the verdict lists them."""
        bodies, centres = machine.layout.bodies, machine.layout.centres
        marks = []
        for number, row in enumerate(self.diagnosis.verdict.causes, start=1):
            place = self.diagnosis.shown.places[row.location]
            stages = [bodies.index(body) for body in place.bodies if body in bodies]
            spots = place.points or [centres[stage].tolist() for stage in stages]
            marks += [
                {"name": str(number), "stage": stages[-1], "place": list(spot), "kind": "cause"}
                for spot in spots
                if stages
            ]
        return marks


def _share(cause: StoredCause) -> str:
    """Return the name of the parameter that switches a cause."""
    return f"{cause.effect}@{cause.location}.share"
