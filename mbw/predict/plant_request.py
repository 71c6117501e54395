"""What a prediction shall say of the plant: bands, samples, reduction, discrete time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.words import InputError, Real, UsageError, read_number
from mbw.files import check_json_target
from tuning.plant import ReductionMethod

_METHODS: tuple[ReductionMethod, ...] = ("balanced", "modal")
_FORMATS = (".npz", ".mat")
_MAX_INPUT_DELAY_S = 10.0  # of an input: a longer one was given in ms


@dataclass(frozen=True)
class PlantRequest:
    """What is asked for of the plant.

    Args:
        bands: whether the bands of the FRFs are written.
        diagnosed: folder of a diagnosis, whose causes are alternatives; None for none.
        samples: number of samples of the posterior.
        seed: of the samples.
        uncertain: file of the uncertain plant; None for none.
        weight: order of the weight of the input error; None for none.
        reduction: method; None for the whole state space.
        order: states of the reduced state space; None to choose it.
        delays: texts ``SECONDS`` or ``INPUT=SECONDS`` of the inputs' delays.
        period_s: sampling period; None for continuous time [s].
        statespace: file of the state space; None for none.
    """

    bands: bool = False
    diagnosed: Path | None = None
    samples: int = 0
    seed: int = 0
    uncertain: Path | None = None
    weight: int | None = None
    reduction: str | None = None
    order: int | None = None
    delays: Sequence[str] = ()
    period_s: float | None = None
    statespace: Path | None = None

    @property
    def needs_fit(self) -> bool:
        """Whether something is asked for that a fit alone knows."""
        return self.bands or self.samples > 0 or self.uncertain is not None or self.has_weight

    @property
    def has_weight(self) -> bool:
        """Whether a weight is asked for."""
        return self.weight is not None

    @property
    def needs_ports(self) -> bool:
        """Whether outputs and inputs are needed."""
        return self.statespace is not None or self.bands or self.samples > 0 or bool(self.uncertain)

    @property
    def has_output(self) -> bool:
        """Whether a file of the plant is asked for."""
        return self.statespace is not None or self.needs_fit

    @property
    def has_folder(self) -> bool:
        """Whether files go into the folder of the result."""
        return self.bands or self.samples > 0 or self.has_weight

    @property
    def method(self) -> ReductionMethod | None:
        """Method of the reduction; an order alone means balanced truncation.

        Raises:
            UsageError: another method.
        """
        if self.reduction is None:
            return "balanced" if self.order is not None else None
        for method in _METHODS:
            if self.reduction == method:
                return method
        raise UsageError(f"--reduce {self.reduction}: write {' or '.join(_METHODS)}")

    def check(self) -> None:
        """Refuse what cannot be used before the computation starts.

        Raises:
            UsageError: a file, method or period that cannot be used.
        """
        for option, target in (("statespace", self.statespace), ("uncertain", self.uncertain)):
            if target is not None and target.suffix not in _FORMATS:
                raise UsageError(f"--{option} {target}: it is written as .npz or .mat")
            if target is not None:
                check_json_target(target)
        of_state_space = {
            "--reduce": self.reduction is not None,
            "--order": self.order is not None,
            "--discrete": self.period_s is not None,
            "--input-delay": bool(self.delays),
        }
        _ = self.method
        if self.diagnosed is not None and not self.bands:
            raise UsageError("--diagnosed widens the bands by alternatives: add --bands")
        for option, is_given in of_state_space.items():
            if is_given and self.statespace is None:
                raise UsageError(f"{option} changes the state space: name its file by --statespace")
        if self.period_s is not None and not 0 < self.period_s < math.inf:
            raise UsageError(f"--discrete {self.period_s:g}: give a sampling period above 0 s")

    def delays_of(self, inputs: Sequence[str]) -> Real:
        """Return the delay of each input [s]; (n_in,).

        Args:
            inputs: labels of the inputs.

        Raises:
            UsageError: a text that is no delay, or an input that is not requested.
            InputError: a negative delay, or one beyond all plants.
        """
        delays = np.zeros(len(inputs))
        for text in self.delays:
            name, _, number = text.rpartition("=")
            if math.isnan(value := read_number(number)):
                raise UsageError(f"--input-delay {text!r}: write SECONDS or INPUT=SECONDS")
            if not 0 <= value <= _MAX_INPUT_DELAY_S:
                raise InputError(f"--input-delay {text}: give 0 to {_MAX_INPUT_DELAY_S:g} s")
            if name and name not in inputs:
                raise UsageError(
                    f"--input-delay {text}: {name!r} is none of the inputs {', '.join(inputs)}"
                )
            for k, label in enumerate(inputs):
                if not name or label == name:
                    delays[k] = value
        return delays
