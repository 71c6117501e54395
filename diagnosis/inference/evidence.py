"""What a verdict is judged by, as plain numbers: it can be kept, and judged again.

Fits take half a minute, the judgement a millisecond. So the judgement's constants are calibrated
on evidence that is kept, and a new calibration needs no fit.
"""

from pydantic import BaseModel, ConfigDict

from identification.words import VarianceSource

Key = tuple[str, str, str | None]  # effect, location, dof
BENDS = "flexible_body"  # what a gate proves of a body, not of a sensor
_NOISE = 0.03  # of the variance: what is left up to there is nothing
_WHITE = 0.005  # the same of what neighbouring lines share, which scatters by 0.001 to 0.003
_EXACT, _EXACT_WHITE = 0.05, 0.02  # likewise, beside an effect that was tuned to the end
_MANY = 20_000  # values of a fit, one line in four: of as many the mean scatters by 0.002
# Of the variance, what it may be wrong by: from coherences, from third differences of sharp modes.
BADLY_KNOWN = {"coherence": 0.1, "differences": 0.3}


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


class Gapped:
    """What a fit leaves.

    Its residual's mean square over the noise's stated variance is one more than the gap's only if
    that variance is right, which from a few hits it is not. Neighbouring lines share the gap, but
    not the noise of sensors: the mean product of their residuals is the gap's mean square however
    large that noise is (``Misfit.serial``). Beside modes that are narrower than the lags it misses
    a gap: chi square counts beside it, less what a badly known variance may add.

    Args:
        chi_square: mean square of residual over noise; 1 is noise alone.
        serial: mean product of the residuals of neighbouring lines; None where noise is shared.
        doubt: what chi square may exceed one by where nothing is left.
        loose: one more than the gap if tolerances have no bounds; None where that was not asked.
        pull: the largest of them then, in standard deviations.
    """

    chi_square: float
    serial: float | None
    doubt: float
    loose: float | None
    pull: float | None

    def nats(self) -> float:
        """Cost, priors and all."""
        raise NotImplementedError

    @property
    def gap(self) -> float:
        """Its mean square over that of the noise."""
        beyond = self.chi_square - 1
        return beyond if self.serial is None else max(self.serial, beyond - self.doubt)

    @property
    def scatter(self) -> float:
        """How many times as much as of many values the mean over few scatters; 1 of the gap's."""
        if self.serial is None:
            return 1.0
        return float(max(1.0, (_MANY * self.chi_square / max(self.nats(), 1.0)) ** 0.5))

    @property
    def is_noise(self) -> bool:
        """Whether so little is left that nothing is asked for."""
        return self.gap <= (_NOISE if self.serial is None else _WHITE * self.scatter)

    @property
    def exact(self) -> float:
        """The gap that the one effect there is may leave."""
        return _EXACT if self.serial is None else _EXACT_WHITE * self.scatter

    def left(self, outlier: float) -> float:
        """The gap; of tolerances none of which is more than an outlier, unbounded.

        Args:
            outlier: standard deviations.
        """
        if self.loose is None or self.pull is None or self.pull > outlier:
            return self.gap
        return min(self.gap, self.loose - 1)


class _Gap(_Row, Gapped):
    cost: float
    chi_square: float
    serial: float | None = None
    doubt: float = BADLY_KNOWN["differences"]

    def nats(self) -> float:
        """Cost, priors and all."""
        return self.cost


class _Fitted(_Gap):
    loose: float | None = None
    pull: float | None = None
    foretold: float | None = None


class Refitted(_Named, _Fitted):
    """A hypothesis fitted at the weights of the noise.

    Args:
        cost: in nats, priors and all.
        chi_square, serial, doubt, loose, pull: as of ``Gapped``.
        foretold: nats that it leaves of what its fits did not see; None where nobody asked.
        off: of what only releases tolerances, how far they are off: as unlikely as one alone that
            is off by so many standard deviations.
    """

    off: float | None = None


class Paired(_Fitted):
    """Two hypotheses, fitted at once.

    Args:
        keys: of both.
        cost, chi_square, serial, doubt, loose, pull, foretold: as of one.
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


class Evidence(_Gap):
    """All that a verdict is judged by.

    Args:
        proven: what gates took out before.
        unknown: places of sensors that gates proved wrong by no fault of the catalogue.
        cost, chi_square, serial, doubt: of the refit without any effect, as of ``Gapped``.
        loose, pull: likewise; as tolerances are if nobody asked.
        refits: with one effect each.
        pairs: with two.
        pushed: places, the one first whose free force explains most.
        variance: where the noise's variance comes from; the worse source if there are two.
        unsteady: how many tests met different machines from hit to hit.
        scored: the most promising first; for who reads on, no judgement needs them.
    """

    proven: tuple[Key, ...]
    unknown: tuple[str, ...] = ()
    loose: float
    pull: float
    refits: tuple[Refitted, ...]
    pairs: tuple[Paired, ...] = ()
    pushed: tuple[Pushed, ...]
    variance: VarianceSource
    unsteady: int = 0
    scored: tuple[Scored, ...] = ()

    @property
    def by(self) -> str:
        """What the gap is known by: neighbouring lines, or the variance and where that is from."""
        return self.variance if self.serial is None else "lines"
