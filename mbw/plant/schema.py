"""Rows of an error budget in the JSON file of ``mbw predict``."""

from typing import Annotated

from pydantic import BaseModel, Field

Number = Annotated[float, Field(allow_inf_nan=False)]


class ShareOfErrorRow(BaseModel):
    """Share of a source, joint or pair of sources in the mean square of an error."""

    name: str
    share: Number


class ShareOfPoleRow(BaseModel):
    """Share of a mode: its natural frequency [Hz], damping ratio and share.

    A real pole has the frequency ``|s| / (2 pi)`` and the damping ratio 1.
    """

    frequency: Number
    damping: Number
    share: Number


class TouchRow(BaseModel):
    """Change of the rms [m or rad] for 10 % more of a stiffness or damping."""

    parameter: str
    change: Number


class ErrorRow(BaseModel):
    """Budget of one error.

    Args:
        signal: outputs with their signs.
        unit: in which page and terminal show it.
        rms: root mean square [m or rad].
        low, high: ends of its 95 % interval; null without a posterior.
        deviation: standard deviation of its logarithm; null without a posterior.
        before: rms of the other machine; null without one.
        sources: shares, without cross terms.
        cross_terms: shares of pairs of correlated sources.
        modes: shares of modes and controllers, the largest first.
        modes_rest: share of no mode: of the floor's motion itself, and of approximated laws.
        joints: shares of joint coordinates and of the floor, the largest first.
        touches: springs and dampers, the strongest first.
        freq_hz, cumulative: rms [m or rad] of all that lies above each frequency.
    """

    name: str
    signal: str
    unit: str
    rms: Number
    low: Number | None
    high: Number | None
    deviation: Number | None
    before: Number | None
    sources: list[ShareOfErrorRow]
    cross_terms: list[ShareOfErrorRow]
    modes: list[ShareOfPoleRow]
    modes_rest: Number
    joints: list[ShareOfErrorRow]
    touches: list[TouchRow]
    freq_hz: list[Number]
    cumulative: list[Number]


class PoleRow(BaseModel):
    """Pole with all loops closed: natural frequency [Hz], damping ratio, pole [rad/s]."""

    frequency: Number
    damping: Number
    real: Number
    imaginary: Number


class BudgetRow(BaseModel):
    """Error budget.

    Args:
        file: budget.toml.
        before: MJCF of the other machine; null without one.
        band: lowest and highest frequency [Hz].
        loops: names of the loops that are closed.
        lines: number of frequency lines of the integral.
        remarks: sentences.
        errors: budget of each error.
        poles: of the machine with its loops, up to twice the band.
    """

    file: str
    before: str | None
    band: tuple[Number, Number]
    loops: list[str]
    lines: int
    remarks: list[str]
    errors: list[ErrorRow]
    poles: list[PoleRow]
