"""Values of the options of ``mbw simulate``, and conflicts between options that were given."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from identification.words import UsageError
from mbw.simulate.played_signal import DEFAULT_QUANTITY, PlayOptions

_ZERO_IN_EXACT_TESTS = {
    "--noise": "no noise",
    "--force-noise": "no noise",
    "--aim-scatter": "a steady aim",
    "--place-scatter": "hits at one place",
}


@dataclass(frozen=True)
class TestOptions:
    """Values of the options of a virtual hammer test; None and empty for the defaults.

    Args:
        hammer: hammer points or directions.
        like: campaign whose test is imitated.
        levels: mean peak forces [N].
        hits: hits along each direction.
        setups: number of roving set-ups; None for 1.
        rate_hz: samples per second.
        block_s: length of a record [s].
        pulse_s: duration of the pulse [s].
        double_share: share of the hits that bounce.
        bad_share: share of further hits that are bad in any way.
        pause_s: pause between hits that are written one by one [s]; None for whole files.
        exact: whether nothing is noisy or off.
        outputs: channels.
        noise: density of the noise of accelerometers [m/s^2/sqrt(Hz)].
        force_noise: density of the noise of the force channel [N/sqrt(Hz)].
        peak_scatter: largest relative deviation of the peak force.
        pulse_scatter: largest relative deviation of the pulse's duration.
        aim_scatter: standard deviation of the aim about each axis [rad].
        place_scatter: standard deviation of the place along each axis [m].
    """

    __test__ = False

    hammer: Sequence[str]
    like: Path | None
    levels: Sequence[float]
    hits: int | None
    setups: int | None
    rate_hz: float | None
    block_s: float | None
    pulse_s: float | None
    double_share: float
    bad_share: float
    pause_s: float | None
    exact: bool
    outputs: Sequence[str]
    noise: float | None
    force_noise: float | None
    peak_scatter: float | None
    pulse_scatter: float | None
    aim_scatter: float | None
    place_scatter: float | None


def refuse_conflicts(test: TestOptions, played: PlayOptions, nominal: Path | None) -> None:
    """Refuse options that a hammer test or a played signal would ignore.

    Args:
        test: options of a hammer test.
        played: options of a played signal.
        nominal: model that the campaign names; None for the simulated one.

    Raises:
        UsageError: an option does not apply; the sentence says why.
    """
    if played.is_asked:
        for name in _list_given(_test_values(test, nominal)):
            raise UsageError(f"{name} belongs to a hammer test, but a signal is played: drop one")
        _refuse_beside_file(played)
        _refuse_beside_kind(played)
        return
    for name in _list_given(_signal_values(played)):
        raise UsageError(
            f"{name} belongs to a played signal, and without --signal and --input this is a hammer "
            "test: add one of them, or drop it"
        )
    if test.like is not None:
        _refuse_beside_like(test)
    if test.exact:
        values = _scatter_values(test)
        for name, meaning in _ZERO_IN_EXACT_TESTS.items():
            if values[name]:
                raise UsageError(f"{name} contradicts --exact, which means {meaning}: drop one")


def _refuse_beside_file(played: PlayOptions) -> None:
    """Refuse options of a signal that is made beside a file that holds the signal."""
    if played.signals is None:
        return
    reasons = {
        "--signal": (played.kind, "the file holds the signal"),
        "--psd": (played.psd, "the file holds the signal"),
        "--limits": (played.limits, "the file holds the signal"),
        "--at": (played.at, "the header of its columns names the inputs"),
        "--amplitude": (played.amplitude, "its columns hold the values"),
        "--duration": (played.duration_s, "its first column holds the time"),
        "--band": (played.band, "its columns hold the values"),
        "--rate": (played.rate_hz, "its first column holds the time"),
    }
    for name, (value, reason) in reasons.items():
        if value is not None:
            raise UsageError(f"{name} does not apply to --input {played.signals}: {reason}")


def _refuse_beside_kind(played: PlayOptions) -> None:
    """Refuse options that the kind of signal does not have."""
    if played.kind in ("step", "move") and played.band is not None:
        raise UsageError(f"--band does not apply to a {played.kind}, which has no band: drop it")
    if played.kind != "move" and played.limits is not None:
        raise UsageError("--limits belongs to --signal move: give both, or drop it")
    if played.kind in ("step", "move", "chirp") and played.psd is not None:
        raise UsageError(f"--psd does not apply to a {played.kind}: give --signal psd, or drop it")
    if played.psd is not None and played.signals is None:
        for name, value in (("--amplitude", played.amplitude), ("--band", played.band)):
            if value is not None:
                raise UsageError(
                    f"{name} does not apply to --psd {played.psd}: the table states both frequency "
                    "and density"
                )


def _refuse_beside_like(test: TestOptions) -> None:
    """Refuse options that a campaign to be imitated states."""
    reasons = {
        "--hammer": (test.hammer, "its hammer points"),
        "--output": (test.outputs, "its channels"),
        "--setups": (test.setups, "its set-ups"),
    }
    for name, (value, what) in reasons.items():
        if value:
            raise UsageError(
                f"{name} does not apply to --like {test.like}, which takes {what}: drop one"
            )


def _test_values(test: TestOptions, nominal: Path | None) -> Mapping[str, object]:
    """Return the options of a hammer test alone, by name."""
    return {
        "--hammer": test.hammer,
        "--like": test.like,
        "--level": test.levels,
        "--hits": test.hits,
        "--setups": test.setups,
        "--block": test.block_s,
        "--pulse": test.pulse_s,
        "--exact": test.exact,
        "--nominal": nominal,
        "--double-hits": test.double_share or None,
        "--bad-hits": test.bad_share or None,
        "--live": test.pause_s,
        **_scatter_values(test),
    }


def _scatter_values(test: TestOptions) -> Mapping[str, object]:
    """Return the options of noise and scatter, by name."""
    return {
        "--noise": test.noise,
        "--force-noise": test.force_noise,
        "--peak-scatter": test.peak_scatter,
        "--pulse-scatter": test.pulse_scatter,
        "--aim-scatter": test.aim_scatter,
        "--place-scatter": test.place_scatter,
    }


def _signal_values(played: PlayOptions) -> Mapping[str, object]:
    """Return the options of a played signal alone, by name."""
    return {
        "--animate": played.animate,
        "--amplitude": played.amplitude,
        "--duration": played.duration_s,
        "--band": played.band,
        "--limits": played.limits,
        "--window": played.window,
        "--quantity": None if played.quantity == DEFAULT_QUANTITY else played.quantity,
    }


def _list_given(values: Mapping[str, object]) -> list[str]:
    """Return the names of the options that the user has given."""
    return [
        name
        for name, value in values.items()
        if value is not None and value is not False and value != []
    ]
