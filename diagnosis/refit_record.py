"""Record of finished refits in a checkpoint, from which an interrupted diagnosis resumes.

The order of the refits follows from their results alone, so that a running number and the words of
the causes name each refit. A refit is kept as its coordinates and its last stage. The statistics of
its residual are computed again, to equal bits.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tuning import Checkpoint, Fit, FloorSchedule, Minimum, Parametrisation


@dataclass
class RefitRecord:
    """Finished refits of a diagnosis.

    Args:
        checkpoint: finished steps, whose ``recall`` gives what ``restore_fit`` needs.
        count: number of refits that have a name.
    """

    checkpoint: Checkpoint = field(default_factory=Checkpoint)
    count: int = 0

    def next_name(self, words: str) -> str:
        """Return the name of the next refit.

        Args:
            words: causes of the refit.
        """
        self.count += 1
        return f"refit {self.count}: {words}"

    def keep(self, name: str, fit: Fit) -> None:
        """Keep a finished refit; the last number of ``x`` is the floor of its last stage."""
        if fit.last_stage is None:
            raise ValueError("a fit of modes is no refit")
        x = np.append(fit.x, fit.last_stage.model_error_floor)
        end = Minimum(x, fit.cost, fit.evaluations, fit.outcome, fit.advice)
        self.checkpoint.keep(name, end)


def restore_fit(kept: Minimum, parametrisation: Parametrisation, schedule: FloorSchedule) -> Fit:
    """Return a refit that ``RefitRecord.keep`` has kept.

    Args:
        kept: record of the refit.
        schedule: schedule of the refit.
    """
    end = replace(kept, x=kept.x[:-1])
    return Fit(
        parametrisation=parametrisation,
        x=end.x,
        cost=end.value,
        evaluations=end.evaluations,
        outcome=end.outcome,
        advice=end.advice,
        start_costs=(end.value,),
        agreement_cost=end.value,
        start_thetas=parametrisation.theta(end.x)[None, :],
        last_stage=schedule.stage(float(kept.x[-1])),
    )
