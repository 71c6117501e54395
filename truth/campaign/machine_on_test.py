"""A machine with its effects on test: what it records on each occasion."""

from collections.abc import Hashable
from dataclasses import dataclass, field

from truth.effects import Effect
from truth.machine.rig import Occasion, Prepared, Rig, accelerance, build
from truth.machine.station import Complex, Hammer, Real, Station


@dataclass(frozen=True, eq=False)
class TrueMachine:
    """The true machine, its hammers and its effects.

    Args:
        station: the true one.
        hammers: three hits for every node that is hit, in x, y, z, node by node.
        effects: what the drawing lacks.
    """

    station: Station
    hammers: tuple[Hammer, ...]
    effects: tuple[Effect, ...] = ()

    def prepare(self, occasion: Occasion) -> Prepared:
        """Return the machine on an occasion before its equations are written."""
        tested = Prepared(self.station, self.hammers)
        for effect in self.effects:
            tested = effect.to_machine(tested, occasion)
        return tested

    def rig(self, occasion: Occasion) -> Rig:
        """Return the machine's equations on an occasion."""
        tested = self.prepare(occasion)
        rig = build(tested)
        for effect in self.effects:
            rig = effect.to_rig(rig, tested, occasion)
        return rig

    def when(self, occasion: Occasion) -> Hashable:
        """Return what of an occasion matters to the effects."""
        return tuple(effect.when(occasion) for effect in self.effects)

    def column(self, occasion: Occasion) -> int:
        """Return the number of an occasion's hammer."""
        nodes = [hammer.node for hammer in self.hammers]
        return nodes.index(occasion.node) + occasion.axis


@dataclass(frozen=True, eq=False)
class Known:
    """Accelerances of a machine at given lines, each rig computed once.

    Args:
        machine: the machine.
        freq_hz: lines [Hz]; (n_freq,).
    """

    machine: TrueMachine
    freq_hz: Real
    _cache: dict[Hashable, tuple[Rig, Complex]] = field(default_factory=dict)

    def on(self, occasion: Occasion) -> tuple[Rig, Complex]:
        """Return the rig of an occasion and its linear accelerance; (n_freq, n_out, n_in)."""
        key = self.machine.when(occasion)
        if key not in self._cache:
            rig = self.machine.rig(occasion)
            self._cache[key] = rig, accelerance(rig, self.freq_hz)
        return self._cache[key]
