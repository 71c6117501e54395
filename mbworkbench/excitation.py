"""Signals for a machine's drives, designed for what is to be found."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from identification.words import Real, Tolerance, UsageError
from mbworkbench.campaign import MeasuredCampaign
from mbworkbench.labels import AnyPath, as_path, check_band
from mbworkbench.model import MachineModel
from mbworkbench.tables import Shown, Table
from tuning import ParameterConfidence
from tuning.excitation.design import Excitation
from tuning.excitation.limits import DriveLimits
from tuning.excitation.limits_toml import read_limits
from tuning.excitation.prediction import forecast_rows, predict_confidence
from tuning.excitation.request import DEFAULT_SECONDS, ExcitationOptions, build_request
from tuning.excitation.tested_machine import TestedMachine, design_test, open_tested_machine
from tuning.parametrisation.user_specification import UserSpecification


@dataclass(frozen=True, eq=False)
class ExcitationResult(Shown):
    """Signals of drives under their limits, and the intervals that they will give.

    Attributes:
        excitation: power, phases and periods.
        confidence: expected covariance of the parameters.
        remarks: sentences on what was assumed.
    """

    excitation: Excitation
    confidence: ParameterConfidence
    remarks: tuple[str, ...]

    @property
    def drives(self) -> tuple[str, ...]:
        """Labels of the drives."""
        return tuple(map(str, self.excitation.request.drives))

    @property
    def time_s(self) -> Real:
        """Instants of the record [s]; (n_time,)."""
        plan = self.excitation.plan
        count = plan.samples * plan.periods * plan.realisations
        return np.asarray(np.arange(count) / plan.rate_hz)

    @property
    def signals(self) -> Real:
        """Signals of the drives, in their own units; (n_time, n_drive)."""
        return self.excitation.repeat(self.excitation.periods).T

    @property
    def reached(self) -> dict[str, float]:
        """Largest value of each limited signal over its limit, such as ``x_motor force``."""
        pairs = zip(self.excitation.limited, self.excitation.peaks(), strict=True)
        return {f"{each.drive} {each.what}": peak / each.limit for each, peak in pairs}

    def __repr__(self) -> str:
        """Return periods, limits and the number of determined parameters in a few lines."""
        plan, rows = self.excitation.plan, list(forecast_rows(self.confidence))
        determined = sum(determined for *_, determined in rows)
        return "\n".join(
            (
                f"{self.excitation.request.kind} for {', '.join(self.drives)}: "
                f"{len(plan.lines)} lines, {plan.seconds:.4g} s at {plan.rate_hz:.6g} Hz",
                *(f"  {name}: {100 * share:.0f} %" for name, share in self.reached.items()),
                f"  {determined} of {len(rows)} stiffnesses and dampings determined",
                *(f"  {remark}" for remark in self.remarks),
            )
        )

    def table(self) -> Table:
        """Return a table of the stiffnesses and dampings with their expected intervals."""
        rows = [
            (parameter.name, nominal, low, high, parameter.unit, "yes" if determined else "no")
            for parameter, nominal, low, high, determined in forecast_rows(self.confidence)
        ]
        header = ("parameter", "nominal", "95 % from", "to", "unit", "determined")
        return Table("Expected intervals", header, rows)


def excite(  # noqa: PLR0913  # one for each option
    source: MachineModel | MeasuredCampaign | AnyPath,
    limits: Mapping[str, Mapping[str, Any]] | AnyPath,
    *,
    outputs: Sequence[str] = (),
    noise: Mapping[str, float] | None = None,
    resolution: Mapping[str, float] | None = None,
    band: tuple[float, float] | None = None,
    seconds: float = DEFAULT_SECONDS,
    rate_hz: float | None = None,
    kind: str = "multisine",
) -> ExcitationResult:
    """Design signals for a machine's drives: the shortest intervals of all stiffnesses.

    Args:
        source: a model, a campaign with its loops, or the path of one; also a folder of results.
        limits: limits of each drive, such as ``{"x_motor": {"force": 150.0, "stroke": 2e-3}}``, or
            the path of a TOML file with ``[drive.NAME]``.
        outputs: labels of what is recorded; encoders and accelerometers of the model by default.
        noise: white noise of outputs by label, one-sided [unit / sqrt(Hz)].
        resolution: smallest steps of encoders by label [m or rad].
        band: lowest and highest frequency [Hz]; that of the modes if None.
        seconds: length of the record, at most [s].
        rate_hz: samples per second; a usual rate of five times the band if None.
        kind: ``multisine`` or ``sweep``.

    Raises:
        InputError: a file cannot be used.
        UsageError: a label, a limit, band, rate or time that cannot be used.
    """
    tested = _open(source)
    options = ExcitationOptions(
        {},
        tuple(outputs) or tuple(tested.outputs),
        noise or {},
        resolution or {},
        check_band(band),
        seconds,
        rate_hz,
        kind,
        tested.ignored,
    )
    if isinstance(limits, Mapping):
        options = _with_limits(options, limits)
    else:
        options = read_limits(options, as_path(limits), (), tuple(tested.drives))
    request, remarks = build_request(tested.machine, options)
    excitation, tested = design_test(tested, request)
    remarks = (*tested.remarks, *remarks, *excitation.plan.remarks)
    return ExcitationResult(excitation, predict_confidence(excitation), remarks)


def _open(source: MachineModel | MeasuredCampaign | AnyPath) -> TestedMachine:
    """Return the machine that a source means."""
    if isinstance(source, MachineModel):
        machine = source.machine
        return TestedMachine(machine, Path(machine.source), Tolerance(), UserSpecification())
    path = source.source if isinstance(source, MeasuredCampaign) else as_path(source)
    return open_tested_machine(path)


def _with_limits(
    options: ExcitationOptions, limits: Mapping[str, Mapping[str, Any]]
) -> ExcitationOptions:
    """Return options with limits by name."""
    try:
        return replace(options, limits={n: DriveLimits(**values) for n, values in limits.items()})
    except TypeError as error:
        raise UsageError(
            f"limits: {error}: name force, current, motor_constant, stroke, speed or at"
        ) from error
