"""What a user wants to be drawn: effects, places and sizes of his choice, in his own test."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from truth.campaign.draw import Tolerances
from truth.campaign.protocol import Protocol
from truth.random_streams import stream

_SURE_NOTHING = 5  # chosen cases for one with nothing


@dataclass(frozen=True)
class Choice:
    """Effects, places and sizes that are drawn.

    Args:
        effects: names; empty for all of the deck.
        places: locations such as ``joint:ty``; empty for a place that is drawn.
        ratios: survival ratios; empty for 1, 2, 4 and 8.
        parameter: name and value of the parameter of the answer that sets the size, instead.
        dirt: part of the motion that small imperfections leave of a re-tuned machine, in per cent.
    """

    effects: tuple[str, ...] = ()
    places: tuple[str, ...] = ()
    ratios: tuple[float, ...] = ()
    parameter: tuple[str, float] | None = None
    dirt: float = 0.0

    @property
    def is_made(self) -> bool:
        """Whether effects, places or sizes are chosen, instead of the whole deck."""
        return bool(self.effects)

    def rounds(
        self, seed: int, usual: tuple[float, ...]
    ) -> Iterator[tuple[str, str, float] | None]:
        """Go through effect, place and ratio of the cases, shuffled, round after round.

        One in six cases has no effect: None.

        Args:
            seed: of the whole test.
            usual: ratios that are drawn if none are chosen.
        """
        ratios = (0.0,) if self.parameter else self.ratios or usual
        chosen = list(product(self.effects, self.places or ("",), ratios))
        cards: list[tuple[str, str, float] | None] = [*chosen] * _SURE_NOTHING
        cards += [None] * len(chosen)
        turn = 0
        while True:
            random = stream(seed, f"chosen.{turn}")
            for number in random.permutation(len(cards)).tolist():
                yield cards[number]
            turn += 1


WHOLE_DECK = Choice()


@dataclass(frozen=True, eq=False)
class OwnTest:
    """The user's own test of his own model.

    Args:
        protocol: with what was measured.
        tolerance: of his campaign.
    """

    protocol: Protocol
    tolerance: Tolerances
