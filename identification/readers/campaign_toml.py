"""Reader of campaign.toml, which checks every key before any other file is read."""

import tomllib
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from identification.words import Estimator, InputError, Quantity

_MAX_TURN_RAD = 6.3  # just above a full turn: larger values are degrees by mistake
_MIN_WINDOW_TAU_S = 1e-4  # s: shorter time constants are no exponential windows of hits
TomlModel = TypeVar("TomlModel", bound=BaseModel)


class _Strict(BaseModel):
    """Model that refuses unknown keys, NaN, infinity and values of another type."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class TestSettings(_Strict):
    """Settings of one ``[[test]]``: a file and its conditions.

    Files of time records have optional keys, in seconds. ``block_s`` is the length of the block
    of a hit, and ``pretrigger_s`` its part before the hit. The force is kept for
    ``force_window_s`` (0: all of it). ``exponential_tau`` is the time constant of the exponential
    window on force and responses (0: none); ``window_tau`` that of a window which the records
    carry already. ``estimator`` is H1 by default; ``reject = false``
    keeps bad hits. Block, pre-trigger and exponential window of one file hold for all files of
    the campaign.
    """

    __test__ = False

    file: str = Field(min_length=1)
    averages: int | None = Field(default=None, ge=1, le=1_000_000)
    level: float | None = Field(default=None, gt=0)
    spindle_speed: float = 0.0
    setup: str | None = None
    hammer: str | None = Field(default=None, min_length=1)
    window_tau: float = Field(default=0.0, ge=0)
    channels: str | list[str] | None = None
    references: list[str] | None = None
    quantity: Quantity | None = None
    unit: str | None = None
    time_sign: Literal["+", "-"] = "+"
    block_s: float | None = Field(default=None, gt=0)
    pretrigger_s: float | None = Field(default=None, ge=0)
    force_window_s: float | None = Field(default=None, ge=0)
    exponential_tau: float | None = Field(default=None, ge=0)
    estimator: Estimator | None = None
    reject: bool | None = None


class SensorSettings(_Strict):
    """Settings of one ``[sensor.<site>]``: corrections that leave the MJCF as it is."""

    flip: list[Literal["x", "y", "z"]] = []
    turn: list[Annotated[float, Field(ge=-_MAX_TURN_RAD, le=_MAX_TURN_RAD)]] = Field(
        default=[0.0, 0.0, 0.0], min_length=3, max_length=3
    )
    ignore: list[Literal["x", "y", "z"]] = []
    body: str | None = None


class ToleranceSettings(_Strict):
    """Settings of ``[tolerance]``: standard deviations of the real machine about its drawings."""

    mass: float = Field(default=0.02, ge=0)
    inertia: float = Field(default=0.05, ge=0)
    com: float = Field(default=0.003, ge=0)
    joint_position: float = Field(default=0.003, ge=0)
    sensor_gain: float = Field(default=0.01, ge=0)
    sensor_angle: float = Field(default=0.01745, ge=0)
    sensor_position: float = Field(default=0.0015, ge=0)
    hammer_angle: float = Field(default=0.01745, ge=0)
    hammer_position: float = Field(default=0.003, ge=0)


class TuningSettings(_Strict):
    """Settings of ``[tuning]``: which parameters vary, by name or pattern (``*``, ``?``).

    Parameters in ``free`` have no prior, those in ``fix`` stay as drawn. ``prior`` gives the
    standard deviation about the drawing (relative for sizes, else in SI units), ``bounds`` the
    lowest and highest value in SI units. Parameters of one group in ``tie`` share one factor on
    their drawn values.
    """

    free: list[str] = []
    fix: list[str] = []
    prior: dict[str, Annotated[float, Field(gt=0)]] = {}
    bounds: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = {}
    tie: list[Annotated[list[str], Field(min_length=1)]] = []


class CampaignSettings(_Strict):
    """Content of campaign.toml."""

    model: str | None = Field(default=None, min_length=1)
    layout: str | None = None
    test: list[TestSettings] = Field(min_length=1)
    sensor: dict[str, SensorSettings] = {}
    tolerance: ToleranceSettings = ToleranceSettings()
    tuning: TuningSettings = TuningSettings()


def read_settings(folder: Path) -> tuple[Path, CampaignSettings]:
    """Read and check the campaign.toml of a folder, given the folder or the file.

    Returns:
        The path of campaign.toml, and its content.

    Raises:
        InputError: the file is missing, its syntax is wrong (with the line), or a key is unknown
            or has a wrong value.
    """
    path = find_campaign_file(folder)
    if "impact" in load_toml(path):
        raise InputError(
            f"{path} is a campaign of impacts without measured force, which mbw match reads: "
            "for FRFs write [[test]] blocks with files of force and response"
        )
    settings = read_toml(path, CampaignSettings)
    files = [(path.parent / test.file).resolve() for test in settings.test]
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
    return path, settings


def find_campaign_file(folder: Path) -> Path:
    """Return the path of the campaign.toml of a folder, given the folder or the file.

    Raises:
        InputError: the file is missing.
    """
    path = folder if folder.suffix == ".toml" else folder / "campaign.toml"
    if not path.is_file():
        raise InputError(f"{path} does not exist: a campaign is a folder with a campaign.toml")
    return path


def read_toml(path: Path, model: type[TomlModel]) -> TomlModel:
    """Read a TOML file and check every key against a model.

    Raises:
        InputError: the file is not UTF-8, its syntax is wrong (with the line), or a key is unknown
            or has a wrong value.
    """
    try:
        return model.model_validate(load_toml(path))
    except ValidationError as error:
        raise InputError(f"{path}: {_describe_first_error(error)}") from error


def load_toml(path: Path) -> dict[str, object]:
    """Read a TOML file without checking its keys.

    Raises:
        InputError: the file is not UTF-8, or its syntax is wrong (with the line).
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text: save it with this encoding") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: TOML syntax: {error}; correct that line") from error


def _describe_first_error(error: ValidationError) -> str:
    """Return a sentence on the first error of a TOML file."""
    fault = error.errors()[0]
    where = ".".join(str(step + 1) if isinstance(step, int) else step for step in fault["loc"])
    if fault["type"] == "extra_forbidden":
        return f"unknown key {where}: correct its spelling or remove it"
    if fault["type"] == "missing":
        return f"key {where} is missing: add it"
    return f"{where} = {fault['input']!r}: {fault['msg']}"
