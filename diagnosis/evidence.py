"""What a verdict is judged by, as plain numbers: it can be kept, and judged again.

Fits take half a minute, the judgement a millisecond. So the judgement's constants are calibrated
on evidence that is kept, and a new calibration needs no fit.
"""

from pydantic import BaseModel, ConfigDict

from identification.words import VarianceSource

Key = tuple[str, str, str | None]  # effect, location, dof
BENDS = "flexible_body"  # what a gate proves of a body, not of a sensor


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Named(_Row):
    effect: str
    location: str
    dof: str | None

    @property
    def key(self) -> Key:
        """Effect, place and direction."""
        return self.effect, self.location, self.dof


class Scored(_Named):
    """The best hypothesis of an effect and place.

    Args:
        gains: in nats, with an allowance of 3 %, with none, with 10 %.
    """

    gains: tuple[float, ...]


class _Fitted(_Row):
    cost: float
    chi_square: float
    loose: float | None = None
    pull: float | None = None
    foretold: float | None = None

    def left(self, outlier: float) -> float:
        """Chi square less one; of tolerances none of which is more than an outlier, unbounded.

        Args:
            outlier: standard deviations.
        """
        beyond = self.loose is None or self.pull is None or self.pull > outlier
        return self.chi_square - 1 if beyond else min(self.chi_square, self.loose or 0.0) - 1


class Refitted(_Named, _Fitted):
    """A hypothesis fitted at the weights of the noise.

    Args:
        cost: in nats, priors and all.
        chi_square: mean square of residual over noise; 1 is noise alone.
        loose: the same if tolerances have no bounds; None where that was not asked.
        pull: the largest of them then, in standard deviations.
        foretold: nats that it leaves of what its fits did not see; None where nobody asked.
        off: of what only releases tolerances, how far they are off: as unlikely as one alone that
            is off by so many standard deviations.
    """

    off: float | None = None


class Paired(_Fitted):
    """Two hypotheses, fitted at once.

    Args:
        keys: of both.
        cost, chi_square, loose, pull, foretold: as of one.
        off: of each, as of one.
    """

    keys: tuple[Key, Key]
    off: tuple[float | None, float | None] = (None, None)


class Pushed(_Row):
    """What a force of any spectrum would explain at one place, in its best direction.

    Args:
        location: a joint or body.
        dof: about or along which world axis, of a rigid direction the nearest; None of a joint
            that is drawn askew.
        gain: in nats, less what it would gain by chance.
    """

    location: str
    dof: str | None
    gain: float


class Evidence(_Row):
    """All that a verdict is judged by.

    Args:
        proven: what gates took out before.
        unknown: places of sensors that gates proved wrong by no fault of the catalogue.
        cost, chi_square: of the refit without any effect, as of ``Refitted``.
        loose: chi square if tolerances have no bounds; as above where that was not asked.
        pull: the largest of them then, in standard deviations.
        refits: with one effect each.
        pairs: with two.
        pushed: places, the one first whose free force explains most.
        variance: where the noise's variance comes from; the worse source if there are two.
        unsteady: how many tests met different machines from hit to hit.
        scored: the most promising first; for who reads on, no judgement needs them.
    """

    proven: tuple[Key, ...]
    unknown: tuple[str, ...] = ()
    cost: float
    chi_square: float
    loose: float
    pull: float
    refits: tuple[Refitted, ...]
    pairs: tuple[Paired, ...] = ()
    pushed: tuple[Pushed, ...]
    variance: VarianceSource
    unsteady: int = 0
    scored: tuple[Scored, ...] = ()
