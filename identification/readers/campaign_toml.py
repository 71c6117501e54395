"""Reader of campaign.toml, which checks every key before any other file is read."""

import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, StrictInt, StrictStr, model_validator

from identification.readers.controller import CampaignLoopTable
from identification.readers.frequency_lines import FrequencyRanges
from identification.readers.instrument_toml import HammerSettings, SensorSettings
from identification.readers.log_toml import LogSettings
from identification.readers.several_inputs import CoherenceKind
from identification.readers.toml_files import FileName, TomlTable, load_toml, read_toml, table_of
from identification.words import (
    DEFAULT_HAMMER,
    Estimator,
    InputError,
    Port,
    Quantity,
    Signal,
    State,
    Tolerance,
    UsageError,
    parse_port,
)
from identification.words.campaign import TOLERANCE_FACTORS
from identification.words.file_access import check_file
from identification.words.ports import FLOOR

MAX_LOSS_FACTOR = 10.0  # rubber has 1; beyond 10 the number is a slip
MAX_LAW_TIME_S = 100.0  # of a delay or relaxation: slower ones are a drift, not dynamics
MAX_BRANCH_RATIO = 1e6  # of a branch to the static stiffness: beyond it the branch is a damper
_MIN_WINDOW_TAU_S = 1e-4  # s: shorter time constants are no exponential windows of hits


class TestSettings(TomlTable):
    """Settings of one ``[[test]]``: a file and its conditions.

    Files of time records have optional keys, in seconds. ``block_s`` is the length of the block
    of a hit, and ``pretrigger_s`` its part before the hit. The force is kept for
    ``force_window_s`` (0: all of it). ``exponential_tau`` is the time constant of the exponential
    window on force and responses (0: none); ``window_tau`` that of a window which the records
    carry already. ``estimator`` is H1 by default; ``reject = false``
    keeps bad hits. Block, pre-trigger and exponential window of one file hold for all files of
    the campaign.

    ``coherence = "multiple"`` says that several inputs acted at once; ``input_spectra`` names the
    array of their cross spectra, which is found under that very name without the key.

    ``columns`` chooses columns of a text file, by heading or number, in the order of the channels.

    ``as_stated = true`` says that unit, quantity and frequency unit are right, however much the
    nominal model differs.

    ``model`` is that of this test alone, such as with a known mass; ``pose`` moves joints [m, rad]
    from where they rest, each with its springs.

    ``state`` says whether the test was made before or after a change of the machine.

    ``log`` is the campaign's ``[log]``, which is one more test.
    """

    __test__ = False

    file: FileName
    averages: int | None = Field(default=None, ge=1, le=1_000_000)
    coherence: CoherenceKind | None = None
    input_spectra: str | None = Field(default=None, min_length=1)
    level: float | None = Field(default=None, gt=0)
    spindle_speed: float = 0.0
    setup: str | None = None
    state: State | None = None
    hammer: str | None = Field(default=None, min_length=1)
    window_tau: float = Field(default=0.0, ge=0)
    channels: str | list[str] | None = None
    references: list[str] | None = None
    columns: list[StrictInt | StrictStr] | None = Field(default=None, min_length=1)
    quantity: Quantity | None = None
    unit: str | None = None
    time_sign: Literal["+", "-"] = "+"
    frequency_unit: Literal["Hz", "rad/s", "rpm", "kHz"] | None = None
    as_stated: bool = False
    model: FileName | None = None
    pose: dict[str, float] = Field(default_factory=dict)
    block_s: float | None = Field(default=None, gt=0)
    pretrigger_s: float | None = Field(default=None, ge=0)
    force_window_s: float | None = Field(default=None, ge=0)
    exponential_tau: float | None = Field(default=None, ge=0)
    estimator: Estimator | None = None
    reject: bool | None = None
    ignore_hz: FrequencyRanges = Field(default_factory=list)
    log: LogSettings | None = None

    @property
    def variant(self) -> str:
        """Name of the machine's variant in the test, such as ``loaded.xml at ty_ty = 0.05``."""
        joints = ", ".join(f"{joint} = {value:g}" for joint, value in sorted(self.pose.items()))
        return " at ".join(filter(None, (self.model, joints)))


class ToleranceSettings(
    table_of(  # type: ignore[misc]
        Tolerance, lambda name: {"ge": int(name in TOLERANCE_FACTORS)}
    )
):
    """Settings of ``[tolerance]``: standard deviations of the real machine about its drawings."""


class MaxwellTable(TomlTable):
    """A branch of ``maxwell``: ``ratio`` to the static stiffness, and ``tau`` [s]."""

    ratio: float = Field(gt=0, le=MAX_BRANCH_RATIO)
    tau: float = Field(gt=0, le=MAX_LAW_TIME_S)


class SpringSettings(TomlTable):
    """Settings of one ``[spring.<name>]``: laws of a joint, joint direction or tendon, as drawn.

    ``loss_factor`` is eta of k (1 + i eta), and each of ``maxwell`` is a spring and a damper in
    series, in parallel with the spring.
    """

    loss_factor: float = Field(default=0.0, ge=0, le=MAX_LOSS_FACTOR)
    maxwell: list[MaxwellTable] = Field(default_factory=list)


class TuningSettings(TomlTable):
    """Settings of ``[tuning]``: which parameters vary, by name or pattern (``*``, ``?``).

    Parameters in ``free`` have no prior, those in ``fix`` stay as drawn. ``prior`` gives the
    standard deviation about the drawing (relative for sizes, else in SI units), ``bounds`` the
    lowest and highest value in SI units. Parameters of one group in ``tie`` share one factor on
    their drawn values.
    """

    free: list[str] = Field(default_factory=list)
    fix: list[str] = Field(default_factory=list)
    prior: dict[str, Annotated[float, Field(gt=0)]] = Field(default_factory=dict)
    bounds: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(
        default_factory=dict
    )
    tie: list[Annotated[list[str], Field(min_length=1)]] = Field(default_factory=list)


class CampaignSettings(TomlTable):
    """Content of campaign.toml; ``ignore_hz`` leaves out lines, here or in one ``[[test]]``.

    ``coherence`` here holds for all tests that do not state theirs. ``two_machines`` says that the
    states before and after are two machines of one drawing.
    """

    model: FileName | None = None
    key: str | None = None
    layout: FileName | None = None
    log: LogSettings | None = None
    test: list[TestSettings] = Field(min_length=1)
    sensor: dict[str, SensorSettings] = Field(default_factory=dict)
    hammer: dict[str, HammerSettings] = Field(default_factory=dict)
    loop: dict[str, CampaignLoopTable] = Field(default_factory=dict)
    spring: dict[str, SpringSettings] = Field(default_factory=dict)
    ignore_hz: FrequencyRanges = Field(default_factory=list)
    coherence: CoherenceKind | None = None
    two_machines: bool = False
    tolerance: ToleranceSettings = ToleranceSettings()
    tuning: TuningSettings = TuningSettings()

    @model_validator(mode="before")
    @classmethod
    def add_log(cls, content: Any) -> Any:
        """Return the content with its ``[log]`` as one more test."""
        log = content.get("log") if isinstance(content, dict) else None
        if not isinstance(log, dict) or not isinstance(content.get("test", []), list):
            return content
        names = {"channels": log.get("encoders"), "references": log.get("motors")}
        test: dict[str, Any] = {
            key: list(value) for key, value in names.items() if isinstance(value, dict)
        }
        test |= {
            key: log[key] for key in ("file", "unit", "level", "block_s", "as_stated") if key in log
        }
        test |= {"quantity": log.get("quantity", "receptance"), "log": log}
        return {**content, "test": [*content.get("test", []), test]}


def read_settings(folder: Path) -> tuple[Path, CampaignSettings]:
    """Read and check the campaign.toml of a folder, given the folder or the file.

    Returns:
        The path of campaign.toml, and its content.

    Raises:
        InputError: the file is missing, its syntax is wrong (with the line), or a key is unknown
            or has a wrong value.
    """
    path = find_campaign_file(folder)
    content = load_toml(path)
    if "impact" in content:
        raise InputError(
            f"{path} is a campaign of impacts without measured force, which mbw match reads: "
            "for FRFs write [[test]] blocks with files of force and response"
        )
    _refuse_wrong_brackets(path, content)
    settings = read_toml(path, CampaignSettings)
    _refuse_unnamed_hammers(path, settings)
    _refuse_incomplete_states(path, settings)
    files = [os.path.realpath(path.parent / test.file) for test in settings.test]
    for test, file in zip(settings.test, files, strict=True):
        if files.count(file) > 1:
            raise InputError(f"{path}: {test.file} appears in two [[test]] blocks: remove one")
        for key in ("window_tau", "exponential_tau"):
            if 0 < (getattr(test, key) or 0.0) < _MIN_WINDOW_TAU_S:
                raise InputError(
                    f"{path}: {key} = {getattr(test, key):g} s is too short for an exponential "
                    "window: give the time constant in seconds"
                )
    if (settings.model is None) == (settings.layout is None):
        raise InputError(
            f"{path} must name either a model or a layout: add one, or remove one of both"
        )
    if settings.layout is not None:
        _refuse_what_needs_a_model(path, settings)
    return path, settings


def _refuse_what_needs_a_model(path: Path, settings: CampaignSettings) -> None:
    """Raise InputError for what a campaign with a layout states of a model.

    Args:
        settings: content that names a layout.
    """
    if any(test.variant for test in settings.test):
        raise InputError(
            f"{path}: a [[test]] has a model or pose of its own, which a layout does not have: "
            "name a model, or remove them"
        )
    for key, named, what in (
        ("loop", settings.loop, "acts on ports of a model"),
        ("spring", settings.spring, "is a spring of a model"),
    ):
        if named:
            raise InputError(
                f"{path}: {key}.{next(iter(named))} {what}, which a layout does not have: name a "
                "model, or remove it"
            )
    if settings.key is not None:
        raise InputError(
            f"{path}: key = {settings.key!r} names a keyframe, which a layout does not have: "
            "remove it, or name a model"
        )


def _refuse_wrong_brackets(path: Path, content: dict[str, Any]) -> None:
    """Raise InputError for ``[test]`` instead of ``[[test]]``, and for a nameless ``[hammer]``."""
    if isinstance(content.get("test"), dict):
        raise InputError(
            f"{path}: [test] is one table, but tests form a list: write [[test]], in two brackets"
        )
    hammers = content.get("hammer")
    if isinstance(hammers, dict) and not all(isinstance(v, dict) for v in hammers.values()):
        raise InputError(
            f"{path}: keys stand under [hammer], which needs a name: write [hammer.<name>], or "
            f"[hammer.{DEFAULT_HAMMER}] for the tests that name none"
        )


def _refuse_incomplete_states(path: Path, settings: CampaignSettings) -> None:
    """Raise InputError unless no test states a state, or all do and both are there."""
    states = {test.state for test in settings.test}
    stated = states - {None}
    if settings.two_machines and not stated:
        raise InputError(
            f'{path}: two_machines is stated and no test has a state: add state = "before" to the '
            'tests of one machine and state = "after" to those of the other, or remove it'
        )
    if stated and None in states:
        file = next(test.file for test in settings.test if test.state is None)
        raise InputError(
            f"{path}: the [[test]] of {file} has no state beside tests with one: add "
            'state = "before" or "after"'
        )
    if len(stated) == 1:
        (there,) = stated
        lacking = "after" if there == "before" else "before"
        raise InputError(
            f'{path}: tests have the state "{there}" but none has "{lacking}": add tests of the '
            f'state "{lacking}", or remove state from all [[test]] blocks'
        )


def _refuse_unnamed_hammers(path: Path, settings: CampaignSettings) -> None:
    """Raise InputError for a ``[hammer.<name>]`` that no test uses."""
    named = {test.hammer or DEFAULT_HAMMER for test in settings.test}
    motors = {
        port.point
        for test in settings.test
        if test.hammer is None
        for text in test.references or []
        if isinstance(port := _try_port(text), Signal) or (port and port.point == FLOOR)
    }
    for name in settings.hammer:
        if port_key(name) not in named | motors:
            names = ", ".join(sorted(named | motors))
            raise InputError(
                f"{path}: hammer.{name}: no test has this hammer (there are {names}): name one of "
                f'them, or add hammer = "{name}" to its [[test]]'
            )


def port_key(name: str) -> str:
    """Return the name by which gain and delay of a channel or drive go.

    Args:
        name: of a site, hammer or signal, as campaign.toml writes it.
    """
    port = _try_port(name)
    return port.point if isinstance(port, Signal) else name


def stated_channels(settings: CampaignSettings) -> set[str]:
    """Return the names by which gains of the channels go that campaign.toml lists by label."""
    texts = (
        text
        for test in settings.test
        for text in (test.channels if isinstance(test.channels, list) else [])
    )
    return {port.point for port in map(_try_port, texts) if port is not None}


def _try_port(text: str) -> Port | None:
    """Return the port of a text, or None for another text."""
    try:
        return parse_port(text)
    except UsageError:
        return None


def model_file(source: Path, settings: CampaignSettings) -> Path:
    """Return the path of the model that a campaign names.

    Args:
        source: path of campaign.toml.

    Raises:
        InputError: it names a layout alone.
    """
    if settings.model is None:
        raise InputError(f'{source} names no model, only a layout: add model = "model.xml"')
    return source.parent / settings.model


def find_campaign_file(folder: Path) -> Path:
    """Return the path of the campaign.toml of a folder, given the folder or the file.

    Raises:
        InputError: the file is missing, or another file stands for the folder.
    """
    if folder.suffix != ".toml" and folder.is_file():
        raise InputError(f"{folder} is a file: a campaign is a folder with a campaign.toml")
    path = folder if folder.suffix == ".toml" else folder / "campaign.toml"
    check_file(path, "a campaign is a folder with a campaign.toml")
    return path
