"""FRFs of the model at all places that may have been hit, nominal or tuned by the findings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.hits.comparison import CompareWindow, Places
from identification.words import Complex, Dof, Input, Output, Quantity, Real, is_hammer_point
from mbmodel import Evaluator, FrfRequest, Model, as_drawn
from mbmodel.machine import Machine
from mbw.live.test import Place


@dataclass(eq=False)
class HitPredictor:
    """Prediction of the FRFs of hits.

    Args:
        machine: machine with all that campaign.toml states of it.
        places: planned places and directions.
        quantity: quantity of the records.
    """

    machine: Machine
    places: tuple[Place, ...]
    quantity: Quantity = "accelerance"
    _kept: dict[tuple[CompareWindow, tuple[Output, ...]], Places] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Begin with the nominal model."""
        self._model: Model = as_drawn(self.machine)
        self._theta: Real = self._model.drawn

    def tune(self, theta: Mapping[str, float]) -> None:
        """Use tuned parameters.

        Args:
            theta: values by name [SI]; those of instruments do not count.
        """
        names = [parameter.name for parameter in self._model.parameters]
        drawn = self._model.drawn.tolist()
        self._theta = np.array([theta.get(n, d) for n, d in zip(names, drawn, strict=True)])
        self._kept.clear()

    @property
    def _inputs(self) -> tuple[Dof, ...]:
        """Three directions of each planned point, and of each hammer point of the model."""
        points = [place[1].point for place in self.places if isinstance(place[1], Dof)]
        points += filter(is_hammer_point, self.machine.layout.points)
        return tuple(Dof.of(point, axis) for point in dict.fromkeys(points) for axis in range(3))

    def __call__(self, window: CompareWindow, outputs: tuple[Output, ...]) -> Places:
        """Return the FRFs of each place and direction along its positive axis."""
        key = window, outputs
        if key not in self._kept:
            values = self.frfs(window.freq_hz, outputs, self._inputs, window.tau)
            self._kept = {key: {dof: values[:, :, k] for k, dof in enumerate(self._inputs)}}
        return self._kept[key]

    def frfs(
        self, freq_hz: Real, outputs: Sequence[Output], inputs: Sequence[Input], tau: float
    ) -> Complex:
        """Return FRFs as an exponential window leaves them; (n_freq, n_out, n_in).

        Args:
            freq_hz, outputs, inputs, tau: as for ``FrfRequest``.
        """
        request = FrfRequest(freq_hz, tuple(outputs), tuple(inputs), self.quantity, window_tau=tau)
        return np.asarray(Evaluator(self._model, request).at(self._theta).values)
