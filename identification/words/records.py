"""Time records of a hammer test, before anything was made of them."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from identification.words._arrays import Mask, Real, frozen
from identification.words.dof import Dof
from identification.words.frf import ORDER, Quantity


@dataclass(frozen=True, eq=False)
class Records:
    """Synchronous records of force and motion, all with the hammer at one reference.

    A record may hold one hit, or a recording of many.

    Args:
        rate_hz: samples per second [Hz].
        force: of the hammer along the reference [N, N m]; (n_record, n_sample).
        motion: along the outputs [m, m/s or m/s^2; rad for rotations];
            (n_record, n_out, n_sample).
        outputs: where and along what the motion is read, each once; n_out.
        reference: where and along what the hammer hits.
        quantity: of the FRFs that these records make: accelerance of accelerations.
        ceilings: full scale of the force and of every output, in the units above, where known;
            (1 + n_out,).
        test: the file, for messages.

    Raises:
        ValueError: shapes or values that contradict this.
    """

    rate_hz: float
    force: Real
    motion: Real
    outputs: tuple[Dof, ...]
    reference: Dof
    quantity: Quantity
    ceilings: Real | None = None
    test: str = ""

    def __post_init__(self) -> None:
        """Validate and freeze."""
        if not (np.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise ValueError(f"rate is {self.rate_hz} Hz, expected more than 0")
        force = frozen(self.force, np.float64, (None, None), "force")
        if not force.size:
            raise ValueError("there is no sample of the force")
        n_record, n_sample = force.shape
        shape = (n_record, len(self.outputs), n_sample)
        checked: dict[str, Any] = {
            "force": force,
            "motion": frozen(self.motion, np.float64, shape, "motion"),
            "outputs": tuple(self.outputs),
        }
        if not self.outputs:
            raise ValueError("there is no channel of motion")
        if len({dof.positive for dof in self.outputs}) < len(self.outputs):
            raise ValueError(f"an output appears twice: {', '.join(map(str, self.outputs))}")
        if self.quantity not in ORDER:
            raise ValueError(f"{self.quantity!r} is none of {', '.join(ORDER)}")
        if self.ceilings is not None:
            checked["ceilings"] = frozen(
                self.ceilings, np.float64, (1 + len(self.outputs),), "ceilings"
            )
            if not (checked["ceilings"] > 0).all():
                raise ValueError("a ceiling is not above 0")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def channels(self, chosen: Mask) -> Self:
        """Keep these outputs; (n_out,)."""
        ceilings = self.ceilings
        return replace(
            self,
            motion=self.motion[:, chosen],
            outputs=tuple(dof for dof, keep in zip(self.outputs, chosen, strict=True) if keep),
            ceilings=None if ceilings is None else ceilings[np.append(True, chosen)],
        )
