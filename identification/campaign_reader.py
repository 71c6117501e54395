"""Reader of a campaign: its files become labelled tests in SI units."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from identification.checks.channels import channel_remarks
from identification.checks.dead_in_tests import leave_out_dead_channels
from identification.checks.files import (
    check_lengths,
    outlying_line_remarks,
    refuse_repeated_tests,
    shifted_axis_remark,
)
from identification.checks.reciprocity import check_reciprocity
from identification.checks.time_direction import refuse_reversed_time
from identification.hits.drive_point import drive_point_signs
from identification.noise.variance import (
    coherence_variance,
    difference_variance,
    implied_coherence,
)
from identification.readers.array_frfs import read_arrays
from identification.readers.campaign_toml import (
    CampaignSettings,
    TestSettings,
    port_key,
    stated_channels,
)
from identification.readers.file_kinds import (
    array_description,
    is_arrays,
    is_universal,
)
from identification.readers.frequency_lines import keep_common_lines, leave_out_lines
from identification.readers.frf_table import FrfTable, check_coherence, set_zero_line
from identification.readers.frf_units import parse_frf_units, refuse_signals_of_known_gain
from identification.readers.instrument_toml import SensorSettings
from identification.readers.several_inputs import CoherenceKind, resolve_several_inputs
from identification.readers.uff_frfs import read_uff
from identification.readers.uff_nodes import site_axes_remarks
from identification.record_tests import tests_from_records
from identification.unknown_gains import leave_out_unknown_gains
from identification.words import (
    Campaign,
    Complex,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    Input,
    InputError,
    Layout,
    Mask,
    Port,
    Real,
    Signal,
    Test,
    Tolerance,
    UnknownGains,
    VarianceSource,
    node_number,
    settle_port,
)
from identification.words.ports import FLOOR

_MIN_LINES_OF_PHASE = 4  # a static test of one to three lines may well be real


def read_campaign(path: Path, settings: CampaignSettings, layout: Layout) -> Campaign:
    """Read all tests of a campaign, from files of FRFs or of time records.

    Args:
        path: path of campaign.toml; the files are relative to its folder.
        layout: bodies and points, corrected by ``correct_layout``.

    Raises:
        InputError: a file cannot be used; the message names the element and a remedy.
    """
    raw, hit_remarks = tests_from_records(path, settings, partial(name_sites, layout))
    tests: list[Test] = []
    files = dict.fromkeys(path.parent / entry.file for entry in settings.test)
    remarks = [*layout.remarks, *hit_remarks, *check_lengths(path, layout)]
    remarks += [
        remark for file in files if is_universal(file) for remark in site_axes_remarks(file, layout)
    ]
    for entry in settings.test:
        if entry.file in raw:
            tests += raw[entry.file]
        else:
            of_file, of_table = _tests_of_file(path, entry, settings, layout)
            tests += of_file
            remarks += of_table
    common, line_remarks = keep_common_lines(tests)
    remarks += line_remarks
    try:
        tolerance = Tolerance(**settings.tolerance.model_dump())
        campaign = Campaign(
            path.resolve().parent.name,
            layout,
            common,
            tolerance,
            unknown_gains=stated_unknown_gains(settings),
            has_two_machines=settings.two_machines,
        )
    except ValueError as error:
        raise InputError(
            f"{path}: {error}: tests of one campaign need one frequency axis and one quantity"
            + ("; block_s sets the axis of time records" if raw else "")
        ) from error
    refuse_repeated_tests(path, campaign)
    refuse_reversed_time(path, campaign, {entry.file: entry.time_sign for entry in settings.test})
    ranges = [
        *settings.ignore_hz,
        *(limits for entry in settings.test for limits in entry.ignore_hz),
    ]
    campaign = leave_out_lines(path, campaign, ranges)
    remarks += campaign.remarks
    campaign, dead_remarks = leave_out_dead_channels(campaign)
    remarks += dead_remarks
    stated = {entry.file: entry.unit for entry in settings.test if entry.unit is not None}
    refuse_signals_of_known_gain(path, campaign, stated)
    comparable = leave_out_unknown_gains(campaign)
    drive_points = () if comparable is None else drive_point_signs(comparable)
    signs = [point.remark for point in drive_points]
    doubt = "a control loop was closed" if settings.loop else ""
    comparables = [] if comparable is None else _split_states(comparable)
    reciprocities = [check_reciprocity(of_state, doubt) for of_state in comparables]
    remarks += [*channel_remarks(campaign), *outlying_line_remarks(campaign)]
    remarks += filter(None, [shifted_axis_remark(campaign)])
    remarks += [sign for sign in signs if sign]
    for reciprocity in filter(None, reciprocities):
        remarks += [text for text in reciprocity.remarks(tolerance) if text not in remarks]
    return replace(campaign, remarks=tuple(remarks))


def _split_states(campaign: Campaign) -> list[Campaign]:
    """Return the tests of each state of the machine; all tests where none states one."""
    if not campaign.has_states:
        return [campaign]
    return [campaign.select_state("before"), campaign.select_state("after")]


def stated_unknown_gains(settings: CampaignSettings) -> UnknownGains:
    """Return the sensors, hammers and drives whose gain campaign.toml calls unknown."""
    return UnknownGains(
        frozenset(
            port_key(site) for site, sensor in settings.sensor.items() if sensor.gain == "unknown"
        ),
        frozenset(
            port_key(name) for name, hammer in settings.hammer.items() if hammer.gain == "unknown"
        ),
    )


def correct_layout(path: Path, settings: CampaignSettings, layout: Layout) -> Layout:
    """Apply the ``[sensor]`` corrections of campaign.toml to a layout.

    The true axes are the drawn axes, turned and then flipped. ``turn`` is a rotation vector [rad]
    in world axes; ``body`` moves the sensor to another body. The corrections do not apply to the
    hammer: at the node of a corrected sensor, a new point ``hit<node>`` keeps the drawn position
    and axes.

    Args:
        layout: layout as drawn.

    Raises:
        InputError: the layout does not have a site or body that a correction names.
    """
    other_channels = stated_channels(settings)
    for site, correction in settings.sensor.items():
        if site not in layout.points:
            has_axes = correction.flip or any(correction.turn) or correction.body
            if port_key(site) in other_channels and not has_axes:
                continue
            raise InputError(
                f"{path}: sensor.{site}: the model has no site {site!r}: name one of its sites"
            )
        if correction.body is not None and correction.body not in layout.bodies:
            raise InputError(
                f"{path}: sensor.{site}: the model has no body {correction.body!r}: name one of "
                "its bodies"
            )
        signs = [-1.0 if axis in correction.flip else 1.0 for axis in "xyz"]
        drawn = layout.axes[layout.points.index(site)]
        axes = Rotation.from_rotvec(correction.turn).as_matrix() @ drawn * signs
        node = node_number(site)
        is_changed = correction.flip or any(correction.turn) or correction.body
        if is_changed and node is not None and layout.hammer_at_node(node) == site:
            layout = layout.with_copied_point(site, f"hit{node}")
        layout = layout.with_point_axes(site, axes, correction.body)
    return layout


def _table(
    path: Path, entry: TestSettings, layout: Layout, coherence: CoherenceKind | None
) -> FrfTable:
    """Read the FRFs of one file at the sites of the layout, in the convention exp(+i w t)."""
    file = path.parent / entry.file
    table = set_zero_line(file.name, _on_sites(file, _read_table(file, entry), layout))
    table = check_coherence(file, table)
    table = resolve_several_inputs(file, table, coherence, entry.averages)
    _refuse_values_without_phase(file, table)
    return replace(table, values=table.values.conj()) if entry.time_sign == "-" else table


def _refuse_values_without_phase(file: Path, table: FrfTable) -> None:
    """Refuse FRFs that are real on every line, such as magnitudes or decibels."""
    values = table.values if table.measured.all() else table.values[:, table.measured]
    if len(values) < _MIN_LINES_OF_PHASE or values.imag.any() or not values.real.any():
        return
    low, high = float(values.real.min()), float(values.real.max())
    raise InputError(
        f"{file}: its FRFs are real on every line ({low:.3g} to {high:.3g}), such as magnitudes or "
        "decibels, and modes need the phase: export complex FRFs"
    )


def _tests_of_file(
    path: Path, entry: TestSettings, settings: CampaignSettings, layout: Layout
) -> tuple[list[Test], tuple[str, ...]]:
    """Return the tests of a file of FRFs, and remarks on it; its table is not kept."""
    table = _table(path, entry, layout, entry.coherence or settings.coherence)
    return _tests_of_table(path.parent / entry.file, entry, settings.sensor, table), table.remarks


def _tests_of_table(
    file: Path, entry: TestSettings, corrections: dict[str, SensorSettings], table: FrfTable
) -> list[Test]:
    """Build one test for each reference, without the channels that are ignored."""
    ignored = {(site, axis) for site, sensor in corrections.items() for axis in sensor.ignore}
    kept = np.array([(d.point, d.direction[-1:]) not in ignored for d in table.responses])
    for column, reference in enumerate(table.references):
        if not (table.measured[:, column] & kept).any():
            raise InputError(
                f"{file}: all channels of reference {reference} are ignored: ignore fewer"
            )
    try:
        return [
            _test(entry, table, reference, table.measured[:, column] & kept)
            for column, reference in enumerate(table.references)
        ]
    except ValueError as error:
        raise InputError(f"{file}: {error}: export it again") from error


def _read_table(file: Path, entry: TestSettings) -> FrfTable:
    """Read the FRFs of one file, with points named as in the file."""
    if is_arrays(file):
        return read_arrays(
            file,
            **array_description(file, entry),
            input_spectra=entry.input_spectra,
            frequency_unit=entry.frequency_unit,
            columns=entry.columns,
        )
    if not is_universal(file):
        raise InputError(
            f"{file} is of an unknown kind: give a .uff, .unv, .mat, .npz, .csv, .txt, .dat "
            "or .lvm file"
        )
    if entry.columns is not None:
        raise InputError(f"{file} is no text file: remove columns from its [[test]]")
    return read_uff(
        file,
        entry.quantity,
        entry.unit,
        entry.frequency_unit,
        channels=entry.channels,
        references=entry.references,
    )


def _on_sites(file: Path, table: FrfTable, layout: Layout) -> FrfTable:
    """Return the table with the sites of the layout instead of node numbers."""
    responses, references = name_sites(layout, file, table.responses, table.references)
    return replace(table, responses=responses, references=references)


def _refuse_point(file: Path, layout: Layout, signal: Signal) -> Signal:
    """Return a signal, unless its name is that of a point or body, whose direction is missing."""
    if signal.name in (*layout.points, *layout.bodies):
        raise InputError(
            f"{file}: {signal.name!r} names a point or body without a direction: write "
            f"{signal.name}:+x"
        )
    return signal


def name_sites(
    layout: Layout, file: Path, responses: tuple[Port, ...], references: tuple[Port, ...]
) -> tuple[tuple[Port, ...], tuple[Port, ...]]:
    """Return responses and references at the sites of the layout instead of node numbers.

    A signal keeps its name, but that of a pair or offset which is a site's name is the site. So
    does the floor as a reference.
    """
    names = (*layout.points, *layout.bodies)

    def name_site(port: Port, find: Callable[[int], str | None]) -> Port:
        """Return the port at the site that the function finds for its node."""
        dof = settle_port(port, names)
        if isinstance(dof, Signal):
            return _refuse_point(file, layout, dof)
        if dof.point == FLOOR and FLOOR not in names and find == layout.hammer_at_node:
            return dof
        named = dof.point if dof.point in names else None
        site = find(int(dof.point)) if dof.point.isdecimal() else named
        if site is None:
            name = f"acc{dof.point}" if dof.point.isdecimal() else dof.point
            raise InputError(
                f"{file}: node {dof.point} has no site on a moving body of the model or layout: "
                f"add a site named {name} to a body that moves, or leave the node out of the file"
            )
        return Dof(site, dof.direction)

    responses = tuple(name_site(dof, layout.sensor_at_node) for dof in responses)
    references = tuple(name_site(dof, layout.hammer_at_node) for dof in references)
    sides: tuple[tuple[Port, ...], ...] = (responses, references)
    for dofs in sides:
        if len({dof.positive for dof in dofs}) < len(dofs):
            doubled = ", ".join(map(str, dofs))
            raise InputError(
                f"{file} holds a point and direction under two names ({doubled}): remove one"
            )
    return responses, references


def _test(entry: TestSettings, table: FrfTable, reference: Input, rows: Mask) -> Test:
    """Build the test of one reference from a column of the table of a file."""
    place = table.references.index(reference)
    cells = (slice(None), rows, slice(place, place + 1))
    outputs = tuple(dof for dof, keep in zip(table.responses, rows, strict=True) if keep)
    frf = Frf(table.freq_hz, table.values[cells], outputs, (reference,), table.quantity)
    values = frf.values
    coherence = None if table.coherence is None else table.coherence[cells]
    coherence = _complete_coherence(values, coherence, entry.averages)
    variance, source = _variance(values, None if table.is_multiple else coherence, entry.averages)
    if table.variance is not None:
        variance, source = table.variance[cells], "stated"
    estimate = FrfEstimate(
        frf=frf,
        variance=variance,
        variance_source=source,
        measured=np.ones((len(outputs), 1), bool),
        coherence=coherence,
        averages=entry.averages,
        window_tau=entry.window_tau,
    )
    condition = Condition(
        entry.file,
        reference,
        entry.level,
        entry.spindle_speed,
        entry.setup,
        entry.hammer,
        entry.variant,
        parse_frf_units(Path(entry.file), table.quantity, entry.unit).drive_unit(reference),
        entry.state,
    )
    return Test(condition, estimate)


def _complete_coherence(
    values: Complex, coherence: Real | None, averages: int | None
) -> Real | None:
    """Fill cells without coherence with the one that third differences along frequency imply.

    Return None if no cell has a coherence, or if cells lack it and
    the number of averages is unknown or 1.
    """
    if coherence is None or not np.isfinite(coherence).any():
        return None
    missing = ~np.isfinite(coherence)
    if not missing.any():
        return coherence
    if averages is None or averages < 2:
        return None
    implied = implied_coherence(values, difference_variance(values), averages)
    return np.asarray(np.where(missing, implied, coherence), float)


def _variance(
    values: Complex, coherence: Real | None, averages: int | None
) -> tuple[Real, VarianceSource]:
    """Return the variance of H1 from coherence if possible, else from third differences."""
    if coherence is not None and averages is not None and averages > 1:
        return coherence_variance(values, coherence, averages), "coherence"
    return difference_variance(values), "differences"
