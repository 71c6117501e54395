"""The machine of an excitation: a model, a campaign with its loops, or a folder of results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from identification import correct_layout, read_settings
from identification.readers.toml_files import load_toml
from identification.words import InputError, Tolerance
from mbmodel import Machine, load_machine, with_loops
from tuning.campaign_machine import close_loops, with_drawn_laws
from tuning.control_loops.loops_file import known_loops
from tuning.files.plant_folder import plant_file
from tuning.parametrisation.user_specification import UserSpecification
from tuning.session import user_specification


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
    if settings.model is None:
        raise InputError(f'{source} names no model, only a layout: add model = "model.xml"')
    machine = load_machine(source.parent / settings.model, key=key or settings.key)
    machine = replace(machine, layout=correct_layout(source, settings, machine.layout))
    machine = with_drawn_laws(source, settings, machine)
    machine, remarks = close_loops(source, machine, settings)
    springs = load_toml(source).get("spring")
    log = settings.log
    return TestedMachine(
        machine,
        source,
        Tolerance(**dict(settings.tolerance)),
        user_specification(settings),
        springs if isinstance(springs, dict) else {},
        () if log is None else tuple(log.motors),
        () if log is None else tuple(log.encoders),
        tuple(remarks),
    )
