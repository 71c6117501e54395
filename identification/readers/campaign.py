"""A campaign in: files, units, nodes and corrections become labelled tests."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from identification.checks.channels import channel_remarks
from identification.hits.campaign import raw_tests
from identification.hits.drive_point import drive_point_signs
from identification.noise.variance import coherence_variance, difference_variance
from identification.readers.array_frfs import read_arrays
from identification.readers.campaign_toml import CampaignSettings, SensorSettings, TestSettings
from identification.readers.file_kinds import is_arrays, is_universal, refuse_stated, stated
from identification.readers.frf_table import FrfTable
from identification.readers.uff_frfs import read_uff
from identification.words import (
    Campaign,
    Complex,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    InputError,
    Layout,
    Mask,
    Real,
    Test,
    Tolerance,
    VarianceSource,
    node_of,
)

_PERFECT = 1 - 1e-9  # coherence that noise never leaves


def read_campaign(path: Path, settings: CampaignSettings, layout: Layout) -> Campaign:
    """Read all tests of a campaign, of FRFs or of time records.

    Args:
        path: of campaign.toml, to which its files are relative.
        settings: its content.
        layout: bodies and points, corrected by ``correct_layout``.

    Raises:
        InputError: a file that cannot be used, with the element and a remedy.
    """
    raw, said = raw_tests(path, settings, partial(_sites, layout))
    tests: list[Test] = []
    remarks = list(said)
    for entry in settings.test:
        if entry.file in raw:
            tests += raw[entry.file]
        else:
            table = _table(path, entry, layout)
            remarks += table.remarks
            tests += _tests_of_table(path.parent / entry.file, entry, settings.sensor, table)
    try:
        tolerance = Tolerance(**settings.tolerance.model_dump())
        campaign = Campaign(path.resolve().parent.name, layout, tuple(tests), tolerance)
    except ValueError as error:
        raise InputError(
            f"{path}: {error}: tests of one campaign share axis and quantity"
            + ("; that of time records is set by block_s" if raw else "")
        ) from error
    signs = [point.remark for point in drive_point_signs(campaign)]
    remarks += [*channel_remarks(campaign), *(sign for sign in signs if sign)]
    return replace(campaign, remarks=tuple(remarks))


def correct_layout(path: Path, settings: CampaignSettings, layout: Layout) -> Layout:
    """Apply the ``[sensor]`` corrections: true axes = drawn axes turned, then flipped.

    ``turn`` is a rotation vector [rad] in world axes; ``body`` moves the sensor to another body.
    The hammer is not corrected: where it hits at the node of a corrected sensor, a point
    ``hit<node>`` keeps the drawn place and axes.

    Raises:
        InputError: a site or body that the model does not have.
    """
    for site, correction in settings.sensor.items():
        if site not in layout.points:
            raise InputError(
                f"{path}: sensor.{site}: the model has no site {site!r}: name one of its sites"
            )
        if correction.body is not None and correction.body not in layout.bodies:
            raise InputError(
                f"{path}: sensor.{site}: the model has no body {correction.body!r}: mend it"
            )
        signs = [-1.0 if axis in correction.flip else 1.0 for axis in "xyz"]
        drawn = layout.axes[layout.points.index(site)]
        turned = Rotation.from_rotvec(correction.turn).as_matrix() @ drawn * signs
        node = node_of(site)
        moved = correction.flip or any(correction.turn) or correction.body
        if moved and node is not None and layout.hammer(node) == site:
            layout = layout.with_copy(site, f"hit{node}")
        layout = layout.turned(site, turned, correction.body)
    return layout


def _table(path: Path, entry: TestSettings, layout: Layout) -> FrfTable:
    file = path.parent / entry.file
    table = _of_several_hits(file, _on_sites(file, _read_table(file, entry), layout))
    return replace(table, values=table.values.conj()) if entry.time_sign == "-" else table


def _of_several_hits(file: Path, table: FrfTable) -> FrfTable:
    """Without a coherence that is one everywhere, as of a single hit: it tells no noise."""
    if table.coherence is None:
        return table
    known = table.coherence[:, table.measured]
    if not np.isfinite(known).any() or np.nanmin(known) < _PERFECT:
        return table
    remark = (
        f"{file.name}: its coherence is 1 on every line, as of a single hit, and tells nothing: "
        "the noise is estimated from third differences along frequency; export it over all hits"
    )
    return replace(table, coherence=None, remarks=(*table.remarks, remark))


def _tests_of_table(
    file: Path, entry: TestSettings, corrections: dict[str, SensorSettings], table: FrfTable
) -> list[Test]:
    ignored = {(site, axis) for site, wanted in corrections.items() for axis in wanted.ignore}
    kept = np.array([(d.point, d.direction[-1]) not in ignored for d in table.responses])
    for column, reference in enumerate(table.references):
        if not (table.measured[:, column] & kept).any():
            raise InputError(f"{file}: no channel is left for reference {reference}: ignore fewer")
    try:
        return [
            _test(entry, table, reference, table.measured[:, column] & kept)
            for column, reference in enumerate(table.references)
        ]
    except ValueError as error:
        raise InputError(f"{file}: {error}: export it again") from error


def _read_table(file: Path, entry: TestSettings) -> FrfTable:
    if is_arrays(file):
        return read_arrays(file, **stated(file, entry))
    if not is_universal(file):
        raise InputError(f"{file}: unknown kind of file: give .uff, .unv, .mat or .npz")
    refuse_stated(file, entry)
    return read_uff(file, entry.quantity)


def _on_sites(file: Path, table: FrfTable, layout: Layout) -> FrfTable:
    """Name the sites of the model instead of node numbers."""
    responses, references = _sites(layout, file, table.responses, table.references)
    return replace(table, responses=responses, references=references)


def _sites(
    layout: Layout, file: Path, responses: tuple[Dof, ...], references: tuple[Dof, ...]
) -> tuple[tuple[Dof, ...], tuple[Dof, ...]]:
    def located(dof: Dof, find: Callable[[int], str | None]) -> Dof:
        named = dof.point if dof.point in layout.points else None
        site = find(int(dof.point)) if dof.point.isdecimal() else named
        if site is None:
            raise InputError(
                f"{file}: node {dof.point} has no site on a moving body of the model or layout: "
                f"add a site named acc{dof.point}, or leave the node out of the file"
            )
        return Dof(site, dof.direction)

    responses = tuple(located(dof, layout.sensor) for dof in responses)
    references = tuple(located(dof, layout.hammer) for dof in references)
    for dofs in (responses, references):
        if len({dof.positive for dof in dofs}) < len(dofs):
            names = ", ".join(map(str, dofs))
            raise InputError(f"{file}: one point and direction has two names in it ({names})")
    return responses, references


def _test(entry: TestSettings, table: FrfTable, reference: Dof, rows: Mask) -> Test:
    """One column of a file's table."""
    column = [table.references.index(reference)]
    outputs = tuple(dof for dof, keep in zip(table.responses, rows, strict=True) if keep)
    values = table.values[:, rows][:, :, column]
    coherence = None if table.coherence is None else table.coherence[:, rows][:, :, column]
    coherence = _filled(values, coherence, entry.averages)
    variance, source = _variance(values, coherence, entry.averages)
    estimate = FrfEstimate(
        frf=Frf(table.freq_hz, values, outputs, (reference,), table.quantity),
        variance=variance,
        variance_source=source,
        measured=np.ones((len(outputs), 1), bool),
        coherence=coherence,
        averages=entry.averages,
        window_tau=entry.window_tau,
    )
    condition = Condition(entry.file, reference, entry.level, entry.spindle_speed, entry.setup)
    return Test(condition, estimate)


def _filled(values: Complex, coherence: Real | None, averages: int | None) -> Real | None:
    """Coherence, in cells that have none that which third differences along frequency imply.

    None where no cell has it, or where the number of averages is not known.
    """
    if coherence is None or not np.isfinite(coherence).any():
        return None
    missing = ~np.isfinite(coherence)
    if not missing.any():
        return coherence
    if averages is None or averages < 2:
        return None
    ratio = (averages - 1) * difference_variance(values) / np.maximum(np.abs(values) ** 2, 1e-300)
    return np.asarray(np.where(missing, 1 / (1 + ratio), coherence), float)


def _variance(
    values: Complex, coherence: Real | None, averages: int | None
) -> tuple[Real, VarianceSource]:
    if coherence is not None and averages is not None and averages > 1:
        return coherence_variance(values, coherence, averages), "coherence"
    return difference_variance(values), "differences"
