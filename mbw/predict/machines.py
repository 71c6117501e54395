"""Machine of a prediction, alone and with what is put on it.

Texts of ``--mount``, ``--at`` and ``--add-mass``: what is put on a machine, and where.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from identification import read_settings
from identification.words import InputError, Loop, UsageError, read_number
from identification.words.file_access import real_path, temporary_folder
from mbmodel import (
    COMBINED_NAME,
    STAGE_COPY_NAME,
    Combined,
    Machine,
    Model,
    MountedStage,
    Offset,
    PointMass,
    body_parts,
    combine,
    joint_parts,
    load_machine,
    with_loops,
)
from mbw.option_texts import parse_spin_rates
from mbw.output_folder import source_of
from mbw.predict.spring_laws import SpringLaw, model_with_laws
from tuning.campaign_machine import with_drawn_laws
from tuning.control_loops.loops_file import choose_loops, known_loops, loops_sentence
from tuning.control_loops.stability import instability_sentence, unstable_variants
from tuning.files.plant_findings import PlantFindings
from tuning.files.result import TUNED_JSON, TUNED_MJCF
from tuning.plant.variant_model import VariantModel, read_variant_model

# A mass or a distance beyond these is a slip of a unit: no precision machine weighs or reaches so
# much.
_MAX_ADDED_MASS_KG = 1e6
_MAX_OFFSET_M = 1e3


@dataclass(frozen=True)
class Additions:
    """A mounted stage and point masses that a machine gets.

    Args:
        stage: the mounted stage; None for none.
        masses: point masses.
    """

    stage: MountedStage | None
    masses: tuple[PointMass, ...]

    def __bool__(self) -> bool:
        """Return whether anything is added."""
        return self.stage is not None or bool(self.masses)

    def __str__(self) -> str:
        """Return what is put on the machine in words."""
        words = [] if self.stage is None else [f"{self.stage.path.name} on {self.stage.body}"]
        words += [f"{mass.mass_kg:g} kg on {mass.body}" for mass in self.masses]
        return ", ".join(words)


def parse_additions(mount: Path | None, place: str | None, masses: Sequence[str]) -> Additions:
    """Return the additions that the options name.

    Args:
        mount: MJCF of the stage; None for none.
        place: text ``BODY:SITE`` or ``BODY:x,y,z``; None for none.
        masses: texts ``BODY=KG@x,y,z``.

    Raises:
        UsageError: an option that is incomplete or written otherwise.
        InputError: a number without sense.
    """
    if (mount is None) != (place is None):
        missing = "--at BODY:PLACE" if place is None else "--mount STAGE.xml"
        raise UsageError(f"--mount and --at go together: add {missing}")
    stage = None
    if mount is not None and place is not None:
        body, colon, spot = place.rpartition(":")
        if not (colon and body and spot):
            raise UsageError(
                f"--at {place!r}: write BODY:SITE or BODY:x,y,z (in m from the body's centre of "
                "mass), such as hexapod:0,0,0.05"
            )
        stage = MountedStage(mount, body, _offset(f"--at {place}", spot) if "," in spot else spot)
    return Additions(stage, tuple(_parse_mass(text) for text in masses))


def _parse_mass(text: str) -> PointMass:
    """Return the point mass of a text ``BODY=KG@x,y,z``."""
    body, equals, rest = text.partition("=")
    number, at, spot = rest.partition("@")
    mass = read_number(number)
    if not (equals and at and body and spot and math.isfinite(mass)):
        raise UsageError(
            f"--add-mass {text!r}: write BODY=KG@x,y,z (in m from the body's centre of mass), such "
            "as hexapod=12.5@0,0,0.1"
        )
    if not 0 < mass <= _MAX_ADDED_MASS_KG:
        raise InputError(
            f"--add-mass {text}: give a mass above 0 and up to {_MAX_ADDED_MASS_KG:g} kg"
        )
    return PointMass(body, mass, _offset(f"--add-mass {text}", spot))


def _offset(option: str, text: str) -> Offset:
    """Return the three numbers of a text ``x,y,z``.

    Args:
        option: option with its value, for messages.
        text: the numbers [m].
    """
    numbers = tuple(map(read_number, text.split(",")))
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise UsageError(f"{option}: {text!r} is no place: write three numbers x,y,z in m")
    if not all(abs(value) <= _MAX_OFFSET_M for value in numbers):
        raise InputError(f"{option}: give x,y,z in m, up to {_MAX_OFFSET_M:g} m")
    return numbers


@dataclass(frozen=True)
class MachineRequest:
    """A machine, its state, and what is put on it.

    Args:
        path: MJCF of the machine.
        spin: texts ``JOINT=RATE`` of hinges that spin at a constant rate [rad/s].
        key: name of the keyframe that gives pose and controls; None for ``home`` if there is one.
        additions: what is put on it.
        laws: of its springs beyond those of the MJCF.
        loops_source: campaign.toml, or the MJCF beside which the loops of the test stand; None for
            the MJCF.
        closed: names or patterns of the loops of the test that are closed; all others are open.
    """

    path: Path
    spin: tuple[str, ...]
    key: str | None
    additions: Additions
    laws: tuple[SpringLaw, ...] = ()
    loops_source: Path | None = None
    closed: tuple[str, ...] = ()

    def close(self, machine: Machine) -> Machine:
        """Return a machine with the chosen loops of the test closed, and a remark on all of them.

        Raises:
            UsageError: a name that fits no loop, or a port that the machine does not have.
            InputError: the file of the loops is damaged.
        """
        machine = self._with_drawn_laws(machine)
        loops = known_loops(self.loops_source or self.path, machine)
        closed = choose_loops(loops, self.closed)
        sentence = loops_sentence(loops, closed)
        remarks = (
            *machine.remarks,
            *PlantFindings.beside(self.path).lag_remarks(machine.motors),
            *([sentence] if sentence else []),
            *self._unstable_variants(closed),
        )
        return replace(with_loops(machine, closed), remarks=remarks)

    def _with_drawn_laws(self, machine: Machine) -> Machine:
        """Return a machine with the laws of springs that the campaign.toml states, if there is one.

        Raises:
            InputError: a spring that the machine does not have.
        """
        if self.loops_source is None or self.loops_source.suffix != ".toml":
            return machine
        return with_drawn_laws(*read_settings(self.loops_source), machine)

    def read_variants(self) -> VariantModel | None:
        """Return the machines of the tests that had models or poses of their own.

        Returns:
            None without any, or for another machine than that of a campaign or its tuning.

        Raises:
            InputError: a file of the campaign cannot be used.
        """
        if self.additions or self.laws or self.spin:
            return None
        if self.loops_source is not None and self.loops_source.suffix == ".toml":
            return read_variant_model(self.loops_source)
        folder = self.path.parent
        if self.path.name != TUNED_MJCF or not (folder / TUNED_JSON).is_file():
            return None
        campaign = source_of(folder, TUNED_MJCF)
        is_there = campaign is not None and campaign.suffix == ".toml" and campaign.is_file()
        return read_variant_model(campaign, folder) if campaign is not None and is_there else None

    def _unstable_variants(self, closed: tuple[Loop, ...]) -> list[str]:
        """Return a sentence on each variant that is unstable with the closed loops."""
        variants = self.read_variants() if closed else None
        if variants is None:
            return []
        names = ", ".join(loop.name for loop in closed)
        poles = unstable_variants(variants.with_loops(closed), variants.theta)
        return [
            instability_sentence("the machine", names, variant, pole)
            for variant, pole in poles.items()
        ]

    def refuse_overwriting(self, folder: Path) -> None:
        """Refuse a folder in which the combined machine would replace a file that it is made of.

        Raises:
            InputError: the folder holds such a file.
        """
        stage = self.additions.stage
        sources = {real_path(path) for path in (self.path, *([stage.path] if stage else []))}
        for name in (COMBINED_NAME, STAGE_COPY_NAME):
            if self.additions and real_path(folder / name) in sources:
                raise InputError(
                    f"{folder / name} would replace a file that is read: name another folder with "
                    "--out"
                )


@dataclass(frozen=True, eq=False)
class Machines:
    """Nominal models of a machine.

    Args:
        base: the machine alone.
        model: the machine whose modes and FRFs are predicted: with what is put on it.
        combined: the combination; None if nothing is put on the machine.
        rates: of the hinges that turn steadily [rad/s], by name.
    """

    base: Model
    model: Model
    combined: Combined | None
    rates: Mapping[str, float]

    @property
    def whole(self) -> Model:
        """Model with everything of the machine that a fit can vary as Parts."""
        model, machine = self.model, self.model.machine
        return Model(machine, (*model.parts, *body_parts(machine), *joint_parts(machine)))

    def write_combined(self, folder: Path, home: Path) -> None:
        """Write the combined MJCF, if there is one, into a folder that will move to another."""
        if self.combined is not None:
            self.combined.file.write(folder, home)


@contextmanager
def load_machines(request: MachineRequest) -> Iterator[Machines]:
    """Load a machine alone and with what is put on it; its MJCF exists as long as the context.

    Raises:
        UsageError: a spin that the machine does not have.
        InputError: a file that cannot be read, linearised or combined.
    """
    rates = parse_spin_rates(request.spin)
    if not request.additions:
        machine = request.close(load_machine(request.path, rates, request.key))
        model = model_with_laws(machine, request.laws, is_partial=False)
        yield Machines(model, model, None, rates)
        return
    machine = load_machine(request.path, None, request.key)
    if spun := {joint: rate for joint, rate in rates.items() if joint in machine.coordinates}:
        machine = load_machine(request.path, spun, request.key)
    with temporary_folder() as folder:
        combined = combine(
            machine,
            folder,
            request.additions.stage,
            request.additions.masses,
            rates=rates,
            key=request.key,
        )
        base = model_with_laws(request.close(machine), request.laws, is_partial=True)
        whole = request.close(combined.machine)
        model = model_with_laws(whole, request.laws, is_partial=False)
        yield Machines(base, model, combined, rates)
