"""The machine of an excitation: a model, a campaign with its loops, or a folder of results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from identification import correct_layout, read_settings
from identification.campaign_reader import stated_unknown_gains
from identification.readers.campaign_toml import CampaignSettings, model_file, port_key
from identification.readers.toml_files import load_toml
from identification.words import Condition, Dof, Tolerance
from mbmodel import Machine, load_machine, with_loops
from tuning.attached_instruments import attach_instruments
from tuning.campaign_machine import close_loops, with_drawn_laws
from tuning.control_loops.loops_file import known_loops
from tuning.excitation.design import Excitation, design_excitation, predict_tests
from tuning.excitation.request import ExcitationRequest
from tuning.files.plant_folder import plant_file
from tuning.parametrisation.user_specification import UserSpecification
from tuning.session import instrument_priors, user_specification


@dataclass(frozen=True, eq=False)
class TestedMachine:
    """A machine, and what a campaign states of it.

    Args:
        machine: with its loops closed, as in the test.
        source: campaign.toml, or the MJCF.
        tolerance: of the drawings.
        specification: of the parameters.
        springs: tables ``[spring.<name>]`` of campaign.toml.
        drives: motors of the campaign's log.
        outputs: encoders of the campaign's log.
        remarks: sentences on the machine.
        settings: content of campaign.toml, with its instruments; None without a campaign.
    """

    __test__ = False

    machine: Machine
    source: Path
    tolerance: Tolerance
    specification: UserSpecification
    springs: Mapping[str, Any] = field(default_factory=dict)
    drives: Sequence[str] = ()
    outputs: Sequence[str] = ()
    remarks: tuple[str, ...] = ()
    settings: CampaignSettings | None = None

    @property
    def ignored(self) -> list[str]:
        """Labels of the channels that the campaign leaves out."""
        sensors = {} if self.settings is None else self.settings.sensor
        return [str(Dof.of(n, "xyz".index(axis))) for n, t in sensors.items() for axis in t.ignore]


def open_tested_machine(path: Path, key: str | None = None) -> TestedMachine:
    """Load a model, the machine of a campaign, or that of a folder of results.

    The files of a campaign's tests are not read: they need not exist yet.

    Args:
        path: MJCF, campaign, or folder of ``mbw tune`` or ``mbw diagnose``.
        key: keyframe that gives pose and controls; None for that of the campaign.

    Raises:
        InputError: a file that cannot be used.
    """
    if path.suffix != ".toml" and not (path / "campaign.toml").is_file():
        mjcf = plant_file(path)
        machine = load_machine(mjcf, key=key)
        machine = with_loops(machine, known_loops(mjcf, machine))
        return TestedMachine(machine, mjcf, Tolerance(), UserSpecification(), {}, (), (), ())
    source, settings = read_settings(path)
    machine = load_machine(model_file(source, settings), key=key or settings.key)
    machine = replace(machine, layout=correct_layout(source, settings, machine.layout))
    machine = with_drawn_laws(source, settings, machine)
    machine, remarks = close_loops(source, machine, settings)
    springs = load_toml(source).get("spring")
    log = settings.log
    return TestedMachine(
        machine,
        source,
        Tolerance(**dict(settings.tolerance)),
        user_specification(settings, instrument_priors(settings)),
        springs if isinstance(springs, dict) else {},
        () if log is None else tuple(log.motors),
        () if log is None else tuple(log.encoders),
        tuple(remarks),
        settings,
    )


def design_test(
    tested: TestedMachine, request: ExcitationRequest
) -> tuple[Excitation, TestedMachine]:
    """Design the signals of a machine with the instruments that its campaign states.

    Args:
        tested: the machine, with all instruments of its campaign.

    Returns:
        The excitation; the machine with the instruments of this test, and remarks on them.

    Raises:
        InputError: a mass or stinger where this test reads or drives no point of the machine.
        UsageError: a label, a limit, band, rate or time that cannot be used.
    """
    machine, stated, tolerance = tested.machine, tested.specification, tested.tolerance
    if tested.settings is None:
        return design_excitation(machine, request, tolerance, stated), tested
    settings, left_out = _used_instruments(tested.settings, machine, request)
    expected = predict_tests(machine, request, np.array([1.0]), None, tolerance)
    parts, remarks = attach_instruments(tested.source, settings, machine, expected)
    excitation = design_excitation(
        machine,
        request,
        tolerance,
        stated,
        parts=[replace(part, files=None) for part in parts],
        unknown_gains=stated_unknown_gains(settings),
    )
    remarks += [f"[hammer.{name}] drives nothing in this test and is left out" for name in left_out]
    remarks = [*tested.remarks, *remarks, *excitation.campaign.remarks]
    return excitation, replace(tested, settings=settings, remarks=tuple(remarks))


def _used_instruments(
    settings: CampaignSettings, machine: Machine, request: ExcitationRequest
) -> tuple[CampaignSettings, list[str]]:
    """Return the settings with the instruments of a test, and the hammers that it lacks.

    The axes of all sites stay, since drives and loops may act there; a channel that is asked for is
    not ignored.
    """
    read = {port.point for port in request.outputs}
    drives = {Condition("", drive).instrument for drive in request.drives}
    sensors = {
        name: table.model_copy(
            update={"ignore": [], "mass": table.mass if port_key(name) in read else None}
        )
        for name, table in settings.sensor.items()
        if port_key(name) in read or name in machine.layout.points
    }
    hammers = {name: table for name, table in settings.hammer.items() if port_key(name) in drives}
    update = {"sensor": sensors, "hammer": hammers}
    return settings.model_copy(update=update), [n for n in settings.hammer if n not in hammers]
