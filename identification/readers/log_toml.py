"""Tables of campaign.toml for the record of a controller or drive: ``[log]``."""

from typing import Literal

from pydantic import Field, StrictInt, StrictStr, model_validator

from identification.readers.controller import ControllerSource
from identification.readers.toml_files import FileName, TomlTable
from identification.words import Quantity


class LogControllerTable(TomlTable):
    """Settings of ``[log.controllers.MOTOR]``: the feedback in the command of a motor.

    The command is -K(s) exp(-s tau) of the encoder, plus what the controller was asked for.
    """

    encoder: str
    controller: ControllerSource
    delay: float = Field(default=0.0, ge=0, le=1.0)


class LogSettings(TomlTable):
    """Settings of ``[log]``: what the columns of a controller's record are.

    ``motors`` and ``encoders`` map inputs and outputs to columns of a text file, by heading or
    number, or to variables of a .mat or .npz file. ``references`` are columns that are independent
    of the noise: references of controllers, or injected disturbances. Where none was recorded,
    ``controllers`` state the feedback of each motor's command instead. ``time_unit`` is that of the
    times, where no heading says it. ``period`` is the time after which the signal repeats [s],
    which is found if it is not stated. ``hold`` says that motors are commands, which act until the
    next sample. ``as_stated`` says that units are right, however much the model differs.
    ``realisations`` says that so many signals of equal length follow one another, as several motors
    at once need.
    """

    file: FileName
    motors: dict[str, StrictInt | StrictStr] = Field(min_length=1)
    encoders: dict[str, StrictInt | StrictStr] = Field(min_length=1)
    references: list[StrictInt | StrictStr] = Field(default_factory=list)
    controllers: dict[str, LogControllerTable] = Field(default_factory=dict)
    quantity: Quantity = "receptance"
    unit: str | None = None
    level: float | None = Field(default=None, gt=0)
    block_s: float | None = Field(default=None, gt=0)
    period: float | None = Field(default=None, gt=0)
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    hold: bool = False
    as_stated: bool = False
    realisations: int = Field(default=1, ge=1)

    @model_validator(mode="after")
    def check_controllers(self) -> "LogSettings":
        """Refuse controllers of unknown motors or encoders, and beside recorded references."""
        if self.period is not None and self.block_s is not None:
            raise ValueError("block_s is for a signal that does not repeat: remove it or period")
        for name, column in self.encoders.items():
            if column in self.references:
                raise ValueError(
                    f"references name the column {column!r} of encoder {name}, which holds the "
                    "noise that references must not: name a reference or an injected disturbance"
                )
        for motor, table in self.controllers.items():
            for name, kind in ((motor, "motors"), (table.encoder, "encoders")):
                if name not in getattr(self, kind):
                    raise ValueError(
                        f"controllers.{motor}: {name} is none of the {kind} "
                        f"({', '.join(getattr(self, kind))}): correct its name"
                    )
        if self.controllers and self.references:
            raise ValueError(
                "references that were recorded need no controllers: remove one of both keys"
            )
        return self
