"""Plan of a virtual hammer test: recorder, hits, files; what is drawn stands in other modules."""

from dataclasses import dataclass, field

from identification.words import Dof, UsageError

_MIN_RATE_HZ, _MAX_RATE_HZ = 1.0, 1e6
_MAX_BLOCK_SAMPLES = 1_000_000
_MAX_FILE_BYTES = 4e9  # of the records of one file, which are kept in memory
_PULSE_TIMES_BAND = 1.14  # pulse duration times the band's upper limit: the force falls by 14 dB
BAND_SHARE = 1 / 2.56  # of the rate: upper limit of the band that analysers show
_PRETRIGGER_OF_BLOCK = 0.05  # of a block


@dataclass(frozen=True)
class HitScatter:
    """How hits of one series differ from one another.

    Args:
        peak: largest relative deviation of the peak force; uniform.
        width: largest relative deviation of the pulse's duration; uniform.
        angle: standard deviation of the aim about each axis [rad].
        place: standard deviation of the place along each axis [m].
        double_share: share of the hits that bounce and hit a second time.
        bad_share: share of further hits among all that are bad in any way (``bad_hits``).
    """

    peak: float = 0.15
    width: float = 0.15
    angle: float = 0.01
    place: float = 0.001
    double_share: float = 0.0
    bad_share: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, value in vars(self).items():
            if not 0 <= value <= 1:
                raise UsageError(f"scatter of hits: {name} is {value:g}, expected 0 to 1")
        if max(self.peak, self.width, self.bad_share) >= 1:
            raise UsageError("scatter of hits: peak, width and bad hits must stay below 1")


@dataclass(frozen=True)
class Noise:
    """Densities of the noise of the channels, white and one-sided.

    Args:
        motion: of accelerometers [m/s^2/sqrt(Hz)].
        force: of the force channel [N/sqrt(Hz)].
    """

    motion: float = 5e-5
    force: float = 5e-4

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, value in vars(self).items():
            if not 0 <= value < 1e6:
                raise UsageError(f"noise of the {name} channel is {value:g}: give 0 or more")


@dataclass(frozen=True)
class RecordedFile:
    """One file of a virtual test: channels and hits that are recorded together.

    Args:
        file: name of the file.
        level_n: mean peak force [N].
        outputs: channels.
        references: points and directions that the hammer hits, one after the other.
        hits: number of hits along each reference.
        setup: name of the roving set-up; None for none.
        hammer: name of the hammer; None for the one of all tests.
    """

    file: str
    level_n: float
    outputs: tuple[Dof, ...]
    references: tuple[Dof, ...]
    hits: int = 10
    setup: str | None = None
    hammer: str | None = None

    def __post_init__(self) -> None:
        """Check numbers and labels."""
        if not (0 < self.level_n < 1e9):
            raise UsageError(f"level {self.level_n:g} N: give the hammer's peak force, above 0")
        if not 1 <= self.hits <= 1000:
            raise UsageError(f"{self.hits} hits per direction: give 1 to 1000")
        if not (self.outputs and self.references):
            raise UsageError(f"{self.file}: a test needs an accelerometer and a hammer point")
        for dofs, what in ((self.outputs, "channel"), (self.references, "reference")):
            positive = [dof.positive for dof in dofs]
            twice = [dof for dof in positive if positive.count(dof) > 1]
            if twice:
                raise UsageError(f"{self.file}: {what} {twice[0]} is there twice: state it once")


@dataclass(frozen=True)
class HammerTestPlan:
    """Plan of a virtual hammer test.

    Args:
        files: one for each level and set-up.
        rate_hz: samples per second [Hz].
        block_s: length of the record of one hit [s].
        pulse_s: mean duration of the half-sine pulse [s]; 0 for 14 dB less force at rate / 2.56.
        scatter: of the hits.
        noise: of the channels.
    """

    files: tuple[RecordedFile, ...]
    rate_hz: float = 512.0
    block_s: float = 4.0
    pulse_s: float = 0.0
    scatter: HitScatter = field(default_factory=HitScatter)
    noise: Noise = field(default_factory=Noise)

    def __post_init__(self) -> None:
        """Check the recorder and the pulse."""
        if not _MIN_RATE_HZ <= self.rate_hz <= _MAX_RATE_HZ:
            raise UsageError(
                f"rate {self.rate_hz:g} Hz: give {_MIN_RATE_HZ:g} to {_MAX_RATE_HZ:g} samples per "
                "second"
            )
        if not 64 <= self.block_s * self.rate_hz <= _MAX_BLOCK_SAMPLES:
            raise UsageError(
                f"a block of {self.block_s:g} s at {self.rate_hz:g} Hz has "
                f"{self.block_s * self.rate_hz:.4g} samples: give 64 to {_MAX_BLOCK_SAMPLES}"
            )
        for file in self.files:
            hits = file.hits * len(file.references)
            size = 8 * self.samples * hits * (1 + len(file.outputs))
            if size > _MAX_FILE_BYTES:
                raise UsageError(
                    f"{file.file} would hold {size / 1e9:.3g} GB of records: give fewer hits, "
                    "channels or samples"
                )
        if not 0 <= self.pulse_s < self.block_s / 4:
            raise UsageError(
                f"a pulse of {self.pulse_s:g} s does not fit a block of {self.block_s:g} s"
            )

    @property
    def samples(self) -> int:
        """Number of samples of a block."""
        return round(self.block_s * self.rate_hz)

    @property
    def pretrigger_s(self) -> float:
        """Time from the start of a record to the hit [s]."""
        return _PRETRIGGER_OF_BLOCK * self.block_s

    @property
    def mean_pulse_s(self) -> float:
        """Mean duration of the pulses [s]."""
        return self.pulse_s or _PULSE_TIMES_BAND / (BAND_SHARE * self.rate_hz)
