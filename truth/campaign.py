"""From a nominal station and a seed to a campaign: the content of its files, answer included."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from truth.draw import Tolerance, draw_basis, draw_drawing, draw_hammers, draw_true, stream
from truth.dynamics import accelerance, assemble
from truth.effects import CATALOGUE, Effect
from truth.errors import TruthError
from truth.measure import Measurement, hammer_test, lines_hz
from truth.station import Hammer, Station
from truth.texts import MESH_FOLDER, answer_toml, campaign_toml, model_xml
from truth.uff import uff_bytes

_TOLERANCE = Tolerance()


@dataclass(frozen=True)
class Plan:
    """What is to be made.

    Args:
        seed: of everything that is drawn; who knows it knows the answer.
        effect: a name of the catalogue.
        body: where the effect sits; drawn if not given.
        averages: hits per direction.
        level: mean peak force [N].
        node: measuring point where the hammer hits.
        tolerance: how far the true machine may be from its drawing.
    """

    seed: int
    effect: str = "none"
    body: str | None = None
    averages: int = 10
    level: float = 200.0
    node: int = 11
    tolerance: Tolerance = _TOLERANCE


@dataclass(frozen=True, eq=False)
class Campaign:
    """The files of a campaign: their content by path within its folder."""

    files: Mapping[str, bytes]

    @property
    def answer_hash(self) -> str:
        """SHA-256 of the salted answer: published first, it proves the answer later."""
        return hashlib.sha256(self.files["answer.toml"]).hexdigest()


def draw_campaign(nominal: Station, plan: Plan) -> Campaign:
    """Draw a machine about the nominal station, give it the effect, hit it, and write it down.

    Raises:
        TruthError: effect, body, node or plan do not fit the station.
    """
    if plan.effect not in CATALOGUE:
        raise TruthError(f"effect {plan.effect!r} is unknown; choose from {', '.join(CATALOGUE)}")
    basis = draw_basis(nominal, plan.seed)
    drawing = draw_drawing(basis, plan.seed)
    true = draw_true(basis, plan.tolerance, plan.seed)
    hammers = draw_hammers(drawing, plan.node, plan.tolerance, plan.seed)
    random = stream(plan.seed, f"effect.{plan.effect}")
    effect = CATALOGUE[plan.effect](random, true, plan.body)
    measured = measure(true, effect, hammers, plan)
    file = f"impact_{plan.level:g}N.uff"
    texts = {
        "model.xml": model_xml(drawing),
        "campaign.toml": campaign_toml(
            model="model.xml",
            file=file,
            level=plan.level,
            averages=plan.averages,
            given=plan.tolerance,
        ),
        "answer.toml": answer_toml(effect.answer(), stream(plan.seed, "salt").bytes(16).hex()),
    }
    contents = {name: text.encode("utf-8") for name, text in texts.items()}
    contents |= {f"{MESH_FOLDER}/{mesh.file}": mesh.content for mesh in drawing.meshes}
    return Campaign(MappingProxyType({**contents, file: uff_bytes(measured)}))


def measure(true: Station, effect: Effect, hammers: tuple[Hammer, ...], plan: Plan) -> Measurement:
    """Test the true machine with its effect; the rows go by node, then direction."""
    if not any(true.sensors()):
        raise TruthError(f"model {true.name}: it has no site acc<node>, nothing would be measured")
    freq_hz = lines_hz()
    exact = accelerance(true, effect.add(assemble(true), true), hammers, freq_hz)
    points = [(sensor.node, axis) for _, sensor in true.sensors() for axis in (1, 2, 3)]
    order = sorted(range(len(points)), key=points.__getitem__)
    frf, coherence = hammer_test(
        exact[:, order], freq_hz, averages=plan.averages, level=plan.level, seed=plan.seed
    )
    return Measurement(
        freq_hz,
        frf,
        coherence,
        responses=tuple(points[row] for row in order),
        references=tuple((hammer.node, axis) for axis, hammer in enumerate(hammers, start=1)),
    )
