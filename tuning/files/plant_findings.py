"""Gains and lags of drives and encoders by a tuning or diagnosis, which no MJCF holds."""

import math
from collections.abc import Collection
from pathlib import Path

from pydantic import BaseModel

from identification.readers.result_files import read_result_json
from tuning.files.plant_folder import result_file
from tuning.files.schema import ChannelGainRow

_MIN_LAG_S = 1e-5  # half of the default tolerance
_MIN_MOVE_M, _MIN_TURN_RAD = 1e-5, 1e-4  # of a sensor from the drawing: less is not said


class _FoundParameter(BaseModel):
    """Keys of a parameter of tuned.json that are needed here."""

    name: str
    tuned: float


class PlantFindings(BaseModel):
    """Instruments and band by tuned.json or verdict.json, which the MJCF does not hold.

    Args:
        file: name of the JSON file; empty for the MJCF of a user, of which nothing is said.
        channel_gains: gains and lags of drives and encoders.
        band: of the test [Hz].
        parameters: tuned values.
    """

    file: str = ""
    channel_gains: list[ChannelGainRow] = []
    band: tuple[float, float] | None = None
    parameters: list[_FoundParameter] = []

    @classmethod
    def beside(cls, mjcf: Path) -> "PlantFindings":
        """Return the findings of the tuning or diagnosis that wrote an MJCF.

        Raises:
            InputError: a damaged file.
        """
        file = result_file(mjcf)
        if file is None:
            return cls()
        return read_result_json(file, cls, "mbw tune").model_copy(update={"file": file.name})

    def lag_remarks(self, motors: Collection[str]) -> list[str]:
        """Return a sentence on each drive and encoder whose gain or lag the model does not hold.

        Args:
            motors: names of the machine's motors, which may be drives.
        """
        sentences = []
        for row in self.channel_gains:
            kind, _, name = row.location.partition(":")
            is_drive = kind == "hammer" and name in motors
            if kind == "hammer" and not is_drive:
                continue
            lag = row.delay if row.delay is not None and abs(row.delay) >= _MIN_LAG_S else 0.0
            has_gain = is_drive and not (row.interval and row.interval[0] <= 1 <= row.interval[1])
            if not (has_gain or lag):
                continue
            facts = [f"has the gain {row.gain:.3g}"] if has_gain else []
            advice = (
                [f"multiply its controller in budget.toml by {row.gain:.3g}"] if has_gain else []
            )
            if lag:
                facts.append(f"is {1e3 * abs(lag):.3g} ms {'late' if lag > 0 else 'early'}")
                advice += _lag_advice(name, lag, is_drive=is_drive)
            sentences.append(
                f"by {self.file}, {name} {' and '.join(facts)}, which the model and this result do "
                f"not hold: {', '.join(advice)}"
            )
        return sentences

    def untested_band_remark(self, band: tuple[float, float]) -> str:
        """Return a sentence on a band [Hz] beyond that of the test; empty within it."""
        tested = self.band
        if tested is None or (tested[0] <= band[0] and band[1] <= tested[1]):
            return ""
        return (
            f"the test covered {tested[0]:.4g} to {tested[1]:.4g} Hz: outside that band no "
            "interval bounds the modes that the model lacks"
        )

    def moved_sensor_remark(self, points: Collection[str]) -> str:
        """Return a sentence on sensors that the tuning found elsewhere than drawn; empty without.

        Args:
            points: points of the ports of a result.
        """
        tuned = {row.name: row.tuned for row in self.parameters}
        moves = []
        for point in dict.fromkeys(points):
            move, turn = (
                math.hypot(*(tuned.get(f"{point}.{kind}_{axis}", 0.0) for axis in "xyz"))
                for kind in ("position", "rotation")
            )
            if move >= _MIN_MOVE_M or turn >= _MIN_TURN_RAD:
                moves.append(f"{point} ({1e3 * move:.2g} mm, {math.degrees(turn):.2g} degrees)")
        if not moves:
            return ""
        return (
            f"ports at sensors are where the tuning found the sensors, off the drawing: "
            f"{', '.join(moves)}; for a drawn point name a site that is no sensor, or BODY@x,y,z"
        )


def _lag_advice(name: str, lag_s: float, *, is_drive: bool) -> list[str]:
    """Return how a lag is stated."""
    if lag_s < 0:
        return ["shorten the delay of its loop in budget.toml by as much"]
    advice = [f"add delay = {lag_s:.4g} to its loop in budget.toml"]
    if is_drive:
        advice.append(f"and for a state space give --input-delay {name}={lag_s:.4g}")
    return advice
