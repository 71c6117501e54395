"""campaign.toml in: checked key by key before anything else is read."""

import tomllib
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from identification.words import Estimator, InputError, Quantity

_FULL_TURN = 6.3  # rad
_SHORTEST_WINDOW = 1e-4  # s
Checked = TypeVar("Checked", bound=BaseModel)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class TestSettings(_Strict):
    """One ``[[test]]``: a file and what was special about it.

    For files of time records, all optional, in seconds: ``block_s`` is the length of a hit's
    block, ``pretrigger_s`` the part of it before the hit, ``force_window_s`` how long the force is
    kept (0: all of it), ``exponential_tau`` the time constant of the exponential window on force
    and responses (0: none); ``estimator`` is H1 unless stated; ``reject = false`` keeps bad hits.
    Block, pre-trigger and exponential window of one file hold for all files of the campaign.
    """

    __test__ = False

    file: str = Field(min_length=1)
    averages: int | None = Field(default=None, ge=1, le=1_000_000)
    level: float | None = Field(default=None, gt=0)
    spindle_speed: float = 0.0
    setup: str | None = None
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
    """One ``[sensor.<site>]``: corrections without touching the MJCF."""

    flip: list[Literal["x", "y", "z"]] = []
    turn: list[Annotated[float, Field(ge=-_FULL_TURN, le=_FULL_TURN)]] = Field(
        default=[0.0, 0.0, 0.0], min_length=3, max_length=3
    )
    ignore: list[Literal["x", "y", "z"]] = []
    body: str | None = None


class ToleranceSettings(_Strict):
    """``[tolerance]``: one standard deviation of what the drawings say."""

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
    """``[tuning]``: which parameters vary, by name or pattern (``*``, ``?``).

    ``free`` are tuned outright, ``fix`` stay as drawn, ``prior`` gives one standard deviation about
    the drawing (relative of sizes, else in SI), ``bounds`` the lowest and highest value in SI,
    ``tie`` groups that share one factor on their drawn values.
    """

    free: list[str] = []
    fix: list[str] = []
    prior: dict[str, Annotated[float, Field(gt=0)]] = {}
    bounds: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = {}
    tie: list[Annotated[list[str], Field(min_length=1)]] = []


class CampaignSettings(_Strict):
    """The whole of campaign.toml."""

    model: str | None = Field(default=None, min_length=1)
    layout: str | None = None
    test: list[TestSettings] = Field(min_length=1)
    sensor: dict[str, SensorSettings] = {}
    tolerance: ToleranceSettings = ToleranceSettings()
    tuning: TuningSettings = TuningSettings()


def read_settings(folder: Path) -> tuple[Path, CampaignSettings]:
    """Read the campaign.toml of a folder (or the file itself).

    Returns:
        The path of campaign.toml, and its content.

    Raises:
        InputError: missing file, TOML syntax (with the line), unknown or wrong keys.
    """
    path = campaign_file(folder)
    if "impact" in plain_toml(path):
        raise InputError(
            f"{path} is a campaign of impacts whose force nobody measured: mbw match reads it; "
            "FRFs need [[test]] blocks with files of both"
        )
    settings = read_toml(path, CampaignSettings)
    files = [(path.parent / test.file).resolve() for test in settings.test]
    for test, file in zip(settings.test, files, strict=True):
        if files.count(file) > 1:
            raise InputError(f"{path}: {test.file} stands in two [[test]] blocks: remove one")
        for key in ("window_tau", "exponential_tau"):
            if 0 < (getattr(test, key) or 0.0) < _SHORTEST_WINDOW:
                raise InputError(
                    f"{path}: {key} = {getattr(test, key):g} s is no exponential window: give "
                    "seconds"
                )
    if (settings.model is None) == (settings.layout is None):
        raise InputError(f"{path}: name a model, or a layout in its stead")
    return path, settings


def campaign_file(folder: Path) -> Path:
    """The campaign.toml of a folder, or the file itself.

    Raises:
        InputError: it is not there.
    """
    path = folder if folder.suffix == ".toml" else folder / "campaign.toml"
    if not path.is_file():
        raise InputError(f"{path} does not exist: a campaign is a folder with a campaign.toml")
    return path


def read_toml(path: Path, model: type[Checked]) -> Checked:
    """A TOML file, checked key by key.

    Raises:
        InputError: no UTF-8, TOML syntax (with the line), unknown or wrong keys.
    """
    try:
        return model.model_validate(plain_toml(path))
    except ValidationError as error:
        raise InputError(f"{path}: {_first_fault(error)}") from error


def plain_toml(path: Path) -> dict[str, object]:
    """A TOML file as it is.

    Raises:
        InputError: no UTF-8, TOML syntax (with the line).
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text: save it as such") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: TOML syntax: {error}; mend that line") from error


def _first_fault(error: ValidationError) -> str:
    """The first thing that is wrong with a TOML file, in words."""
    fault = error.errors()[0]
    where = ".".join(str(step + 1) if isinstance(step, int) else step for step in fault["loc"])
    if fault["type"] == "extra_forbidden":
        return f"unknown key {where}: mend its spelling or remove it"
    if fault["type"] == "missing":
        return f"key {where} is missing: add it"
    return f"{where} = {fault['input']!r}: {fault['msg']}"
