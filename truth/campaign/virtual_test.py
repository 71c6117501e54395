"""From a nominal station and a seed to a campaign: the content of its files, answer apart."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

from truth.background.draw import Background, draw_background
from truth.campaign.background_sizing import size_background
from truth.campaign.cause import Cause, Draws, draw_effects
from truth.campaign.draw import (
    NO_TOLERANCE,
    Tolerances,
    draw_as_drawn,
    draw_basis,
    draw_drawing,
    draw_hammers,
    draw_mistuned,
    draw_motor,
    draw_rigid,
    draw_true,
)
from truth.campaign.file_formats import (
    MESH_FOLDER,
    MODEL_FOLDER,
    answer_toml,
    array_bytes,
    campaign_toml,
    dirt_toml,
    model_xml,
    uff_bytes,
)
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.measure import hammer_tests
from truth.campaign.protocol import Protocol, Take, occasions, takes
from truth.campaign.survival import SurvivalRefit, refit_of
from truth.campaign.tolerance_answer import name_sites, subtract_drawing
from truth.effects import NONLINEAR, Scene
from truth.errors import TruthError
from truth.machine.settling import carry, settle
from truth.machine.station import Hammer, Real, Station
from truth.random_streams import stream

_TOLERANCE = Tolerances()
_PROTOCOL = Protocol()
_NO_CAUSE = Cause()
_MOST_DIRT = 60.0  # per cent: more is another machine


@dataclass(frozen=True)
class Plan:
    """What is to be made.

    Args:
        seed: of everything that is drawn; who knows it knows the answer.
        cause: what the drawing lacks.
        protocol: how the machine is tested.
        tolerance: how far the true machine may be from its drawing.
        rigid: directions in which the machine, and its drawing, are made rigid.
        dirt: part of the motion that small imperfections leave of a re-tuned machine, in per cent.
        as_drawn: whether the drawing is the nominal machine itself, about which the true one is
            drawn; else a drawing of its own is drawn for every seed. A machine that was read by
            MuJoCo is always tested as drawn.
    """

    seed: int
    cause: Cause = _NO_CAUSE
    protocol: Protocol = _PROTOCOL
    tolerance: Tolerances = _TOLERANCE
    rigid: int = 0
    dirt: float = 0.0
    as_drawn: bool = False

    def __post_init__(self) -> None:
        """Check that the background can be made."""
        if not 0 <= self.dirt <= _MOST_DIRT:
            raise TruthError(f"dirt {self.dirt}: give 0 to {_MOST_DIRT:g} per cent of the motion")


@dataclass(frozen=True, eq=False)
class VirtualCampaign:
    """A campaign and its answer.

    Args:
        files: content by path within the folder.
        answer: the sealed text, salted.
        discarded: draws of effects that could not be made as strong as was wanted.
    """

    files: Mapping[str, bytes]
    answer: bytes
    discarded: int = 0

    @property
    def answer_hash(self) -> str:
        """SHA-256 of the salted answer: published first, it proves the answer later."""
        return hashlib.sha256(self.answer).hexdigest()


@dataclass(frozen=True, eq=False)
class Subject:
    """What a campaign tests, and what its user is given of it.

    Args:
        drawing: the machine as the user's model has it.
        machine: the true machine with its effects and hammers.
        draws: the effects, as they were drawn.
        background: small imperfections beside them.
        files: what is measured.
        scene: where and when effects can be.
    """

    drawing: Station
    machine: TrueMachine
    draws: Draws
    background: Background
    files: tuple[Take, ...]
    scene: Scene


def draw_campaign(nominal: Station, plan: Plan) -> VirtualCampaign:
    """Draw a machine about the nominal station, give it its effects, hit it, and write it down.

    Raises:
        TruthError: effect, place, node or protocol do not fit the station.
    """
    return measure_subject(draw_subject(nominal, plan), plan, nominal.name)


def draw_subject(nominal: Station, plan: Plan) -> Subject:
    """Draw a machine about the nominal station, and give it its effects.

    Raises:
        TruthError: effect, place, node or protocol do not fit the station.
    """
    if not any(nominal.sensors()):
        raise TruthError(
            f"model {nominal.name}: it has no site acc<node>, nothing would be measured"
        )
    drawing, true = draw_machines(nominal, plan)
    files, machine, scene = _set_up_test(drawing, true, plan)
    background = _background(drawing, true, plan)
    draws = _effects(drawing, true, plan, background)
    effects = tuple(drawn.effect for drawn in draws.drawn)
    machine = replace(machine, effects=(*background.effects, *effects))
    return Subject(drawing, machine, draws, background, files, scene)


def measure_subject(subject: Subject, plan: Plan, nominal_name: str) -> VirtualCampaign:
    """Hit a machine that was drawn, and write it down.

    Args:
        subject: of ``draw_subject``.
        plan: the plan that it was drawn by.
        nominal_name: of the nominal station, for the answer.
    """
    drawing, machine, draws = subject.drawing, subject.machine, subject.draws
    files, background, true = subject.files, subject.background, machine.station
    seed = plan.seed
    tests = hammer_tests(machine, plan.protocol, files, seed)
    contents, entry = model_files(drawing)
    contents["campaign.toml"] = campaign_toml(
        model=entry,
        files=files,
        averages=plan.protocol.averages,
        given=plan.tolerance,
        loops=drawing.loops,
    ).encode("utf-8")
    for loop in drawing.loops:
        contents |= loop.files
    for take, test in zip(files, tests, strict=True):
        contents[take.file] = uff_bytes(test) if take.test is None else array_bytes(test)
    salt = stream(seed, "salt").bytes(16).hex()
    whole = machine.prepare(subject.scene.occasions[0])
    answers = tuple(
        name_sites(subtract_drawing(drawn.effect.answer(), drawing, true, whole), drawing)
        for drawn in draws.drawn
    )
    small = tuple(name_sites(effect.answer(), drawing) for effect in background.effects)
    text = answer_toml(answers, draws, plan.cause, plan.protocol, nominal_name, salt)
    answer = (text + dirt_toml(small, plan.dirt, background.scale)).encode("utf-8")
    return VirtualCampaign(MappingProxyType(contents), answer, draws.discarded)


def draw_machines(nominal: Station, plan: Plan) -> tuple[Station, Station]:
    """Return the drawing that the user is given, and the true machine.

    Raises:
        TruthError: the true machine has no stable equilibrium.
    """
    seed, mistuned = plan.seed, plan.cause.mistuned
    at_work = NO_TOLERANCE if mistuned else plan.tolerance
    if plan.as_drawn or nominal.source is not None:
        varied = draw_as_drawn(nominal, seed, mistuned=mistuned)
        return nominal, settle(varied if mistuned else draw_true(varied, at_work, seed))
    basis = draw_rigid(draw_basis(nominal, seed), plan.rigid, seed)
    true = draw_mistuned(basis, seed) if mistuned else draw_true(basis, at_work, seed)
    return draw_drawing(basis, seed), true


def model_files(drawing: Station) -> tuple[dict[str, bytes], str]:
    """Return the files of a drawing and the path of its MJCF: a user's own file stays as it is."""
    if drawing.source is not None:
        files = {f"{MODEL_FOLDER}/{name}": text for name, text in drawing.source.files.items()}
        return files, f"{MODEL_FOLDER}/{drawing.source.entry}"
    meshes = {f"{MESH_FOLDER}/{mesh.file}": mesh.content for mesh in drawing.meshes}
    return {"model.xml": model_xml(drawing).encode("utf-8"), **meshes}, "model.xml"


def _background(drawing: Station, true: Station, plan: Plan) -> Background:
    """Return the small imperfections, scaled to the wanted part of the motion; none without."""
    if plan.dirt == 0:
        return Background()
    files, machine, _ = _set_up_test(drawing, true, plan)
    linear = not any(wanted.effect in NONLINEAR for wanted in plan.cause.wanted)
    drawn = draw_background(true, plan.protocol.freq_hz[-1], plan.seed, has_losses=linear)
    return size_background(drawn, _refit(machine, plan, files, None), plan.dirt / 100)


def _effects(drawing: Station, true: Station, plan: Plan, background: Background) -> Draws:
    """Return the effects, as strong as the refit of a plan's test leaves them."""
    files, machine, scene = _set_up_test(drawing, true, plan)
    refit = partial(_refit, machine, plan, files, background.left)
    return draw_effects(machine, scene, plan.cause, refit, plan.seed)


def _set_up_test(
    drawing: Station, true: Station, plan: Plan
) -> tuple[tuple[Take, ...], TrueMachine, Scene]:
    """The files of a plan's test, the machine with its hammers, and when it is hit."""
    at_work = NO_TOLERANCE if plan.cause.mistuned else plan.tolerance
    files = takes(plan.protocol, drawing, plan.seed)
    hammers = []
    for hammer in hammers_of(drawing, plan.protocol, at_work, plan.seed):
        if hammer.along:
            hammers.append(hammer)
            continue
        place = carry(hammer.position, hammer.direction, hammer.stage, drawing, true)
        hammers.append(replace(hammer, position=place[0], direction=place[1]))
    scene = Scene(true, occasions(plan.protocol, files), plan.protocol.pace)
    return files, TrueMachine(true, tuple(hammers)), scene


def _refit(
    machine: TrueMachine, plan: Plan, files: tuple[Take, ...], background: Real | None
) -> SurvivalRefit:
    """Return a refit of the files of the middle level, with what a background leaves beside it."""
    level = sorted(plan.protocol.levels)[len(plan.protocol.levels) // 2]
    level_takes = tuple(take for take in files if take.test or take.level == level)
    return refit_of(machine, plan.protocol, level_takes, plan.tolerance, background)


def hammers_of(
    drawing: Station, protocol: Protocol, tolerance: Tolerances, seed: int
) -> tuple[Hammer, ...]:
    """Return the hits and motors of a test, each off by its tolerances.

    Args:
        drawing: the nominal machine.
        tolerance: of places, directions and force channels.
        seed: of the machine.
    """
    hammers: tuple[Hammer, ...] = ()
    for node in protocol.nodes:
        purpose = f"tolerance.hammer.{node}" if hammers else "tolerance.hammer"
        if node < 0:
            hammers += (draw_motor(drawing.motors[-1 - node], node, tolerance, seed),)
        else:
            instrument = protocol.measured.instrument(node) if protocol.measured else ""
            hammers += draw_hammers(drawing, node, tolerance, seed, purpose, instrument)
    return hammers
