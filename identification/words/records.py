"""Raw time records of a test."""

from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from identification.words._arrays import (
    MAX_FREQUENCY_HZ,
    MAX_INPUT_MAGNITUDE,
    MIN_FREQUENCY_HZ,
    Mask,
    Real,
    frozen_array,
)
from identification.words.frf import DERIVATIVE_ORDER, Quantity
from identification.words.ports import Input, Output


@dataclass(frozen=True, eq=False)
class Records:
    """Synchronous time records of force and motion, all with the force at one reference.

    A record holds one hit or several, or a force that never rests. Other forces may act at the
    same time.

    Args:
        rate_hz: samples per second [Hz].
        force: force along the reference [N, N m]; (n_record, n_sample).
        motion: motion along the outputs [m, m/s or m/s^2; rad for rotations];
            (n_record, n_out, n_sample).
        outputs: degrees of freedom whose motion is read, each once; n_out.
        reference: degree of freedom at which the force acts.
        quantity: quantity of the resulting FRFs: accelerance if the motion is acceleration.
        ceilings: full scale of the force and of every output, in the units above, or None if
            unknown; (1 + n_out,).
        further_forces: forces that act at the same time [N, N m]; (n_further, n_record, n_sample).
        further_references: where they act; n_further.
        set_points: signals that are independent of the noise, such as a controller's reference;
            (n_set, n_record, n_sample).
        test: name of the file, for messages.
        remarks: sentences on the file that a reader of the result must know.

    Raises:
        ValueError: a shape or value contradicts this description.
    """

    rate_hz: float
    force: Real
    motion: Real
    outputs: tuple[Output, ...]
    reference: Input
    quantity: Quantity
    ceilings: Real | None = None
    further_forces: Real = field(default_factory=lambda: np.zeros((0, 0, 0)))
    further_references: tuple[Input, ...] = ()
    set_points: Real = field(default_factory=lambda: np.zeros((0, 0, 0)))
    test: str = ""
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Validate and freeze."""
        if not MIN_FREQUENCY_HZ <= self.rate_hz <= MAX_FREQUENCY_HZ:  # also false for NaN
            raise ValueError(
                f"the sampling rate is {self.rate_hz:g} Hz, expected more than 0 and at most "
                f"{MAX_FREQUENCY_HZ:g} Hz"
            )
        force = frozen_array(self.force, np.float64, (None, None), "force", MAX_INPUT_MAGNITUDE)
        if not force.size:
            raise ValueError("the force has no samples")
        n_record, n_sample = force.shape
        shape = (n_record, len(self.outputs), n_sample)
        checked: dict[str, Any] = {
            "force": force,
            "motion": frozen_array(self.motion, np.float64, shape, "motion", MAX_INPUT_MAGNITUDE),
            "outputs": tuple(self.outputs),
            "further_references": tuple(self.further_references),
        }
        for name, count in (("further_forces", len(self.further_references)), ("set_points", None)):
            checked[name] = _check_signals(getattr(self, name), name, count, force.shape)
        if not self.outputs:
            raise ValueError("there is no motion channel")
        if len({dof.positive for dof in self.outputs}) < len(self.outputs):
            raise ValueError(f"an output appears twice: {', '.join(map(str, self.outputs))}")
        if self.quantity not in DERIVATIVE_ORDER:
            raise ValueError(f"quantity {self.quantity!r} is none of {', '.join(DERIVATIVE_ORDER)}")
        if self.ceilings is not None:
            checked["ceilings"] = frozen_array(
                self.ceilings, np.float64, (1 + len(self.outputs),), "ceilings"
            )
            if not (checked["ceilings"] > 0).all():
                raise ValueError("a full-scale value (ceilings) is not above 0")
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def select_channels(self, chosen: Mask) -> Self:
        """Return the records with these outputs alone.

        Args:
            chosen: mask of the outputs; (n_out,).
        """
        ceilings = self.ceilings
        return replace(
            self,
            motion=self.motion[:, chosen],
            outputs=tuple(dof for dof, keep in zip(self.outputs, chosen, strict=True) if keep),
            ceilings=None if ceilings is None else ceilings[np.append(True, chosen)],
        )


def _check_signals(values: Real, name: str, count: int | None, shape: tuple[int, ...]) -> Real:
    """Return signals that were recorded beside the force, as (n_signal, n_record, n_sample).

    Args:
        values: the signals; no signal may have any shape.
        name: of the field.
        count: number of signals; None for any.
        shape: of the force.
    """
    signals = np.asarray(values)
    if not len(signals):
        signals = np.zeros((0, *shape))
    return frozen_array(signals, np.float64, (count, *shape), name, MAX_INPUT_MAGNITUDE)
