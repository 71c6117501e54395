"""A campaign opened together with its machine: the start of every tuning and diagnosis.

Tolerances of single instruments, from ``[sensor.<name>]`` and ``[hammer.<name>]``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from glob import escape
from pathlib import Path

import numpy as np

from identification import read_campaign, read_settings, select_band
from identification.readers.campaign_toml import CampaignSettings, model_file, port_key
from identification.readers.file_kinds import is_universal
from identification.readers.frf_units import parse_frf_units
from identification.unknown_gains import leave_out_unknown_gains
from identification.words import TOLERANCE_BOUND_SIGMA, Campaign, InputError
from identification.words.ports import FLOOR
from mbmodel import Machine, Model, as_drawn, load_machine
from tuning.attached_instruments import attach_instruments
from tuning.campaign_machine import close_loops, refuse_unknown_ports, state_machine
from tuning.checks.data_against_model import compare_with_model
from tuning.checks.export_faults import StatedExport
from tuning.checks.export_finding import ExportFinding, describe_wrong_exports
from tuning.control_loops.stability import growing_pole_of_model
from tuning.parametrisation.parametrisation import Parametrisation
from tuning.parametrisation.user_specification import UserSpecification, parametrise
from tuning.toleranced_model import build_toleranced_model
from tuning.unknown_gains import divide_by_unknown_gains


@dataclass(frozen=True, eq=False)
class Session:
    """A campaign, its model, and the parameters that vary.

    Args:
        source: path of campaign.toml.
        model: nominal model with the corrections of campaign.toml, all that can vary as Parts.
        campaign: tests, restricted to the lines of the band.
        parametrisation: coordinates of the parameters that vary.
    """

    source: Path
    model: Model
    campaign: Campaign
    parametrisation: Parametrisation

    @property
    def known_force_tolerance(self) -> float | None:
        """Largest relative tolerance of the known gains of forces that vary; None without any.

        It is that of the campaign, of ``[hammer.*]`` or of ``[tuning]``; 0 where none varies.
        """
        instruments = {test.condition.instrument for test in self.campaign.tests}
        known = instruments - {*self.campaign.unknown_gains.hammers, FLOOR}
        if not known:
            return None
        varies, gains = self.parametrisation, {f"hammer({name}).gain" for name in known}
        return max(
            (
                float(scale)
                for parameter, scale, k in zip(
                    varies.parameters, varies.scale, varies.coordinate_of, strict=True
                )
                if parameter.name in gains and k >= 0 and varies.is_tolerance[k]
            ),
            default=0.0,
        )


def open_session(
    path: Path,
    band: tuple[float, float] | None = None,
    machine: Machine | None = None,
    tests: Campaign | None = None,
) -> Session:
    """Read a campaign folder and the model that it names, to tune it.

    Args:
        path: the folder, or its campaign.toml.
        band: lowest and highest frequency [Hz]; None for the lines with coherence.
        machine: another machine than the one that campaign.toml names, or None.
        tests: the tests of the campaign, if they were read before, on all lines.

    Raises:
        InputError: an input cannot be used; the message names file, element and remedy.
    """
    session = _begin_session(*open_campaign(path, band, machine, tests))
    campaign = _refuse_wrong_exports(session.source, session.model, session.campaign)
    return replace(session, campaign=campaign)


def change_machine(session: Session, machine: Machine) -> Session:
    """Return a session with another machine of the same points and bodies, its tests as they are.

    Args:
        session: a campaign that is open.
        machine: as its MJCF describes it; it gets what campaign.toml states of it.

    Raises:
        InputError: the machine cannot be tuned.
    """
    machine, _ = prepare_machine(session.source, read_settings(session.source)[1], machine)
    changed = _begin_session(session.source, machine, session.campaign)
    return replace(changed, campaign=session.campaign)


def _begin_session(source: Path, machine: Machine, campaign: Campaign) -> Session:
    """Return a session of tests and a machine that belong together."""
    if not as_drawn(machine).parameters:
        raise InputError(
            f"{machine.source}: no joint or tendon has stiffness or damping to tune: "
            "add them to the model"
        )
    model = build_toleranced_model(machine, campaign)
    attached, remarks = attach_instruments(source, read_settings(source)[1], machine, campaign)
    model = Model(machine, (*model.parts, *attached))
    campaign = replace(campaign, remarks=(*campaign.remarks, *remarks))
    try:
        parametrisation = parametrise(model, campaign.tolerance, _read_specification(source))
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    return Session(source, model, campaign, parametrisation)


def find_wrong_exports(source: Path, model: Model, campaign: Campaign) -> list[ExportFinding]:
    """Return what tells of a wrong unit, quantity or frequency unit of a file or column.

    A nominal model that is unstable with its loops has no steady answer to compare with.

    Args:
        source: path of campaign.toml.
        model: nominal model.
        campaign: tests in the band.
    """
    stated = {
        entry.file: StatedExport(
            campaign.tests[0].estimate.frf.quantity,
            entry.unit,
            parse_frf_units(
                source.parent / entry.file, campaign.tests[0].estimate.frf.quantity, entry.unit
            ).scalar,
            entry.frequency_unit,
            has_labels=is_universal(Path(entry.file)),
            columns={} if entry.log is None else {**entry.log.motors, **entry.log.encoders},
        )
        for entry in read_settings(source)[1].test
    }
    comparable = leave_out_unknown_gains(campaign)
    if model.loops and growing_pole_of_model(model, model.drawn) is not None:
        return []
    return [] if comparable is None else compare_with_model(model, comparable, stated)


def _refuse_wrong_exports(source: Path, model: Model, campaign: Campaign) -> Campaign:
    """Return the campaign with remarks on files that differ from the nominal model as a whole.

    Raises:
        InputError: a wrong unit, quantity or frequency unit is certain, and campaign.toml does not
            say ``as_stated``.
    """
    findings = find_wrong_exports(source, model, campaign)
    trusted = {entry.file for entry in read_settings(source)[1].test if entry.as_stated}
    for finding in findings:
        if finding.is_certain and finding.file not in trusted:
            raise InputError(
                f"{source}: {finding.sentence}; if file and campaign.toml are right, set "
                "as_stated = true there"
            )
    return replace(campaign, remarks=(*campaign.remarks, *describe_wrong_exports(findings)))


def _read_specification(path: Path) -> UserSpecification:
    """Read what a user specifies under ``[tuning]`` of campaign.toml, and for instruments."""
    settings = read_settings(path)[1]
    return user_specification(settings, instrument_priors(settings))


def user_specification(
    settings: CampaignSettings, priors: Mapping[str, float] | None = None
) -> UserSpecification:
    """Return what a user specifies under ``[tuning]``.

    Args:
        priors: priors that the same file states elsewhere, by the parameter's name.
    """
    tuning = settings.tuning
    return UserSpecification(
        free=tuning.free,
        fix=tuning.fix,
        prior={**(priors or {}), **tuning.prior},
        bounds={name: (low, high) for name, (low, high) in tuning.bounds.items()},
        ties=tuning.tie,
    )


def open_campaign(
    path: Path,
    band: tuple[float, float] | None = None,
    machine: Machine | None = None,
    tests: Campaign | None = None,
) -> tuple[Path, Machine, Campaign]:
    """Read a campaign folder and the machine that it names.

    Args:
        path, band [Hz], machine, tests: as for ``open_session``.

    Returns:
        Path of campaign.toml, the machine with the corrections and control loops stated there, the
        tests with the lines of the band only.

    Raises:
        InputError: an input cannot be used; the message names file, element and remedy.
    """
    source, settings = read_settings(path)
    if machine is None:
        machine = load_machine(model_file(source, settings), key=settings.key)
    machine, loop_remarks = prepare_machine(source, settings, machine)
    campaign = tests or read_campaign(source, settings, machine.layout)
    refuse_unknown_ports(source, machine, campaign)
    chosen = select_band(campaign, band, source)
    if not any(np.abs(test.estimate.frf.values).any() for test in chosen.tests):
        raise InputError(f"{source}: all FRFs are zero in the band: check the export")
    of_machine = (f"{machine.source.name}: {remark}" for remark in machine.remarks)
    of_tests = (
        f"{entry.file} was measured with {entry.variant}"
        for entry in settings.test
        if entry.variant
    )
    chosen = replace(chosen, remarks=(*chosen.remarks, *of_machine, *loop_remarks, *of_tests))
    ranges = delay_ranges(settings, chosen)
    return source, machine, divide_by_unknown_gains(machine, chosen, ranges)


def prepare_machine(
    source: Path, settings: CampaignSettings, machine: Machine
) -> tuple[Machine, list[str]]:
    """Return a machine with all that campaign.toml states of it, and remarks on its loops.

    Args:
        source, settings: as ``read_settings`` returns them.
        machine: machine of the MJCF alone.
    """
    return close_loops(source, state_machine(source, settings, machine), settings)


def instrument_priors(settings: CampaignSettings) -> dict[str, float]:
    """Return the standard deviation of each gain and delay that campaign.toml states by itself.

    Returns:
        Relative standard deviations of gains and those of delays [s], by patterns of parameters.
    """
    priors: dict[str, float] = {}
    for name, sensor in settings.sensor.items():
        place = escape(port_key(name))
        for kind, deviation in (("gain", sensor.gain_tolerance), ("delay", sensor.delay_tolerance)):
            if deviation is not None:
                priors[f"{place}.{kind}*"] = deviation
    for name, hammer in settings.hammer.items():
        place = escape(port_key(name))
        for kind, deviation in (("gain", hammer.gain_tolerance), ("delay", hammer.delay_tolerance)):
            if deviation is not None:
                priors[f"hammer({place}).{kind}"] = deviation
    return priors


def delay_ranges(settings: CampaignSettings, campaign: Campaign) -> dict[str, float]:
    """Return the largest delay of each drive and channel that its tolerance allows [s].

    Returns:
        Delays by location, such as ``hammer:drive`` or ``sensor:encoder``.
    """
    tolerance, deviations = campaign.tolerance, dict[str, float]()
    for test in campaign.tests:
        deviations[f"hammer:{test.condition.instrument}"] = tolerance.hammer_delay
        for dof in test.estimate.frf.outputs:
            deviations[f"sensor:{dof.point}"] = tolerance.sensor_delay
    for kind, tables in (("sensor", settings.sensor), ("hammer", settings.hammer)):
        for name, table in tables.items():
            if table.delay_tolerance is not None:
                deviations[f"{kind}:{port_key(name)}"] = table.delay_tolerance
    return {place: TOLERANCE_BOUND_SIGMA * deviation for place, deviation in deviations.items()}
