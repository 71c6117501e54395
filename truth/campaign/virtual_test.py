"""From a nominal station and a seed to a campaign: the content of its files, answer apart."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

from truth.campaign.cause import Cause, Draws, draw_effects
from truth.campaign.draw import (
    NO_TOLERANCE,
    Tolerance,
    draw_basis,
    draw_drawing,
    draw_hammers,
    draw_mistuned,
    draw_rigid,
    draw_true,
    stream,
)
from truth.campaign.file_formats import MESH_FOLDER, answer_toml, campaign_toml, model_xml
from truth.campaign.measure import hammer_tests
from truth.campaign.protocol import Protocol, Take, occasions, takes
from truth.campaign.survival import Refit, refit_of
from truth.campaign.tolerance_answer import stated
from truth.campaign.uff import uff_bytes
from truth.effects import Scene
from truth.errors import TruthError
from truth.machine.machine_on_test import Machine
from truth.machine.station import Hammer, Station

_TOLERANCE = Tolerance()
_PROTOCOL = Protocol()
_NOTHING = Cause()


@dataclass(frozen=True)
class Plan:
    """What is to be made.

    Args:
        seed: of everything that is drawn; who knows it knows the answer.
        cause: what the drawing lacks.
        protocol: how the machine is tested.
        tolerance: how far the true machine may be from its drawing.
        rigid: directions in which the machine, and its drawing, are made rigid.
        sized_by: the test whose refit the sizes of effects are chosen for; this one if None. The
            same seed then has the same machine and effects whatever else is measured.
    """

    seed: int
    cause: Cause = _NOTHING
    protocol: Protocol = _PROTOCOL
    tolerance: Tolerance = _TOLERANCE
    rigid: int = 0
    sized_by: Protocol | None = None


@dataclass(frozen=True, eq=False)
class Campaign:
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


def draw_campaign(nominal: Station, plan: Plan) -> Campaign:
    """Draw a machine about the nominal station, give it its effects, hit it, and write it down.

    Raises:
        TruthError: effect, place, node or protocol do not fit the station.
    """
    seed = plan.seed
    if not any(nominal.sensors()):
        raise TruthError(
            f"model {nominal.name}: it has no site acc<node>, nothing would be measured"
        )
    basis = draw_rigid(draw_basis(nominal, seed), plan.rigid, seed)
    drawing = draw_drawing(basis, seed)
    at_work = NO_TOLERANCE if plan.cause.mistuned else plan.tolerance
    true = draw_mistuned(basis, seed) if plan.cause.mistuned else draw_true(basis, at_work, seed)
    files, machine, scene = _tested(drawing, true, plan)
    draws = _effects(drawing, true, replace(plan, protocol=plan.sized_by or plan.protocol))
    machine = replace(machine, effects=tuple(one.effect for one in draws.drawn))
    tests = hammer_tests(machine, plan.protocol, files, seed)
    contents = {
        "model.xml": model_xml(drawing).encode("utf-8"),
        "campaign.toml": campaign_toml(
            model="model.xml", files=files, averages=plan.protocol.averages, given=plan.tolerance
        ).encode("utf-8"),
    }
    contents |= {f"{MESH_FOLDER}/{mesh.file}": mesh.content for mesh in drawing.meshes}
    contents |= {take.file: uff_bytes(test) for take, test in zip(files, tests, strict=True)}
    salt = stream(seed, "salt").bytes(16).hex()
    whole = machine.prepared(scene.occasions[0])
    answers = tuple(stated(one.effect.answer(), drawing, true, whole) for one in draws.drawn)
    answer = answer_toml(answers, draws, plan.cause, plan.protocol, nominal.name, salt).encode(
        "utf-8"
    )
    return Campaign(MappingProxyType(contents), answer, draws.discarded)


def _effects(drawing: Station, true: Station, plan: Plan) -> Draws:
    """The effects, as strong as the refit of a plan's test leaves them."""
    files, machine, scene = _tested(drawing, true, plan)
    refit = partial(_refit, machine, plan, files)
    return draw_effects(machine, scene, plan.cause, refit, plan.seed)


def _tested(drawing: Station, true: Station, plan: Plan) -> tuple[tuple[Take, ...], Machine, Scene]:
    """The files of a plan's test, the machine with its hammers, and when it is hit."""
    at_work = NO_TOLERANCE if plan.cause.mistuned else plan.tolerance
    files = takes(plan.protocol, drawing, plan.seed)
    machine = Machine(true, _hammers(drawing, plan.protocol, at_work, plan.seed))
    return files, machine, Scene(true, occasions(plan.protocol, files))


def _refit(machine: Machine, plan: Plan, files: tuple[Take, ...]) -> Refit:
    """A refit of the files of the middle level."""
    level = sorted(plan.protocol.levels)[len(plan.protocol.levels) // 2]
    own = tuple(take for take in files if take.level == level)
    return refit_of(machine, plan.protocol, own, plan.tolerance)


def _hammers(
    drawing: Station, protocol: Protocol, tolerance: Tolerance, seed: int
) -> tuple[Hammer, ...]:
    first, *others = protocol.nodes
    hammers = draw_hammers(drawing, first, tolerance, seed)
    for node in others:
        hammers += draw_hammers(drawing, node, tolerance, seed, f"tolerance.hammer.{node}")
    return hammers
