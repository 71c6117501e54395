"""Draw campaigns with their keys by seed; needs ``truth``, the extra ``[draw]``.

Six strata: an *exact* machine that lacks one effect; a *dirty* one with small imperfections beside
it, which leave 5 % of the motion; *several* effects; a wrong *force* channel; *levels*, three of
them, with laws of joints; *real* changes of a measured tower, made exactly in its measured matrix.
Every fifth machine of ``exact``, ``dirty``, ``levels`` and ``real`` lacks nothing. Virtual machines
are random trees of three stages with 9 to 12 sensors.
"""

import json
import shutil
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from gapbench.run import STRATA
from truth import Cause, Plan, Protocol, Wanted, read_station, write_campaign
from truth.campaign.changed_tower import (
    ASSET,
    change_tower,
    draw_change,
    read_tower,
    write_tower,
)
from truth.campaign.draw import REAL_INSTRUMENTS, draw_hammers
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.survival import SurvivalRefit, refit_of
from truth.campaign.virtual_test import Subject, draw_subject, measure_subject
from truth.effects import Effect
from truth.effects.effect import stated_number
from truth.effects.other_packages import known_effects
from truth.errors import NoPlaceError, TruthError
from truth.grade.answer import TrueCause, answer_from
from truth.grade.baselines import list_places
from truth.grade.verdict import CATALOGUE, canonical
from truth.machine.random_tree import draw_tree
from truth.machine.station import GROUND, Real, Station
from truth.random_streams import stream

SINGLE = (
    "appendage",
    "flexible_body",
    "gyroscopic",
    "inertance",
    "joint_coupling",
    "mass_error",
    "missing_dof",
    "parallel_path",
    "sensor_delay",
    "sensor_gain",
    "sensor_misalignment",
    "sensor_position",
    "structural_damping",
    "support_loss",
    "viscoelastic",
)
LAWS = ("friction", "backlash", "hardening")
FORCE_FAULTS = (
    ("hammer_gain", "gain", (0.7, 0.8, 1.25, 1.4)),
    ("hammer_delay", "delay", (-5e-4, -2e-4, 2e-4, 5e-4)),
)
TOWER_CHANGES = ("mass", "gain", "link", "appendage", "leg", "delay", "hit_gain")
LEVELS_N = (40.0, 200.0, 1000.0)
LINES, RESOLUTION_HZ = 201, 0.75
NOTHING_EVERY = 5  # every n-th machine lacks nothing
DIRT_PERCENT = 5.0
RIGID = 2  # directions of every machine without a joint, for one of them may be what is missing
_RATIOS = (2.0, 4.0, 8.0)  # survival ratios
_MACHINE_TRIES = 20  # machines, until one has a place for its effects
_ALIKE_SINE = (1 - 0.95**2) ** 0.5  # of a cosine of 0.95 between what a refit leaves of effects
_SMALL_PART = 0.01  # of an effect, whose change of the FRFs is linear in its size then
_ALIKE_DRAWS = 12  # of an effect at a place: more than a point mass has moments


def draw_set(folder: Path, seed: int, count: int, strata: Sequence[str] = STRATA) -> None:
    """Draw campaigns of each stratum, and write them with ``keys.json``.

    Args:
        folder: where the set is written; ``.zip`` packs it.
        seed: seed of all draws.
        count: number of cases of each stratum.
        strata: some of ``STRATA``.

    Raises:
        FileExistsError: there is something already.
    """
    if folder.exists():
        raise FileExistsError(f"{folder} is there already; name another folder")
    place = folder.with_suffix("") if folder.suffix == ".zip" else folder
    place.mkdir(parents=True)
    cases = {}
    for number, (stratum, turn) in enumerate((s, k) for k in range(count) for s in strata):
        name = f"case{number + 1:03d}"  # tells nothing
        draw = _draw_tower if stratum == "real" else _draw_virtual
        cases[name] = {"stratum": stratum, **draw(place / name, stratum, seed, turn)}
    effects = {name: kind.kind for name, kind in sorted(CATALOGUE.items())}
    keys = {"format": 1, "seed": seed, "effects": effects, "cases": cases}
    (place / "keys.json").write_text(json.dumps(keys, indent=1) + "\n", encoding="utf-8")
    if place != folder:
        shutil.make_archive(str(place), "zip", place)
        shutil.rmtree(place)


def _draw_virtual(folder: Path, stratum: str, seed: int, turn: int) -> dict[str, object]:
    """Draw a case on a random tree, write its campaign, and return its key."""
    for attempt in range(_MACHINE_TRIES):
        random = stream(seed, f"gapbench.{stratum}.{turn}.{attempt}")
        machine = int(random.integers(2**62))
        station = draw_tree(machine, 3)
        levels = LEVELS_N if stratum == "levels" else (LEVELS_N[1],)
        protocol = Protocol((station.first_aim(),), levels, 10, 1, LINES, RESOLUTION_HZ)
        wanted = _choose_effects(random, stratum, (seed, turn, attempt), station, machine)
        dirt = DIRT_PERCENT if stratum == "dirty" else 0.0
        plan = Plan(machine, Cause(wanted), protocol, REAL_INSTRUMENTS, rigid=RIGID, dirt=dirt)
        try:
            subject = draw_subject(station, plan)
        except NoPlaceError:
            continue
        ratios = [drawn.ratio for drawn in subject.draws.drawn if drawn.ratio is not None]
        if ratios and min(ratios) < min(_RATIOS) / 2**0.5:
            continue  # a refit hides it: nobody could see it
        campaign = measure_subject(subject, plan, station.name)
        write_campaign(campaign, folder, sealed=True)
        truth = answer_from(tomllib.loads(campaign.answer.decode("utf-8")), "answer")
        alike = _alike_places(subject, plan)
        places = places_of(subject.drawing, protocol.nodes)
        causes = [
            {**_key(cause, subject.drawing, places), "alike": alike.get(cause.location, [])}
            for cause in truth.causes
        ]
        for cause in causes:
            if cause["effect"] in ("hammer_gain", "hammer_delay"):  # there is one force channel
                cause["places"] = [*places["hammer"], "hammer:default"]
        return {"causes": causes, "background": sorted(map(list, set(truth.background)))}
    raise TruthError(f"{stratum} {turn}: {_MACHINE_TRIES} machines have no place for its effects")


def _draw_tower(folder: Path, stratum: str, seed: int, turn: int) -> dict[str, object]:
    """Change the measured tower, write the tests before and after, and return the key."""
    random = stream(seed, f"gapbench.{stratum}.{turn}")
    order = stream(seed, f"gapbench.{stratum}").permutation(len(TOWER_CHANGES))
    kind = TOWER_CHANGES[order[turn % len(order)]]
    changes = draw_change("nothing" if _lacks_nothing(turn) else kind, random)
    freq_hz, before = read_tower()
    after = change_tower(freq_hz, before, changes, random)
    write_tower(folder, Path("model.xml"), freq_hz, after, before)
    for name in ("model.xml", "LICENSE"):
        shutil.copy(ASSET / name, folder)
    station = read_station(ASSET / "model.xml")
    places = places_of(station, (1, 2, 3))
    causes = []
    for change in changes:
        sizes = {name: (value,) for name, value in change.sizes.items()}
        if change.effect == "stiffness":  # of a leg: its change [N/m]
            sizes["factor"] = (change.sizes["stiffness"],)
        cause = TrueCause(change.effect, change.location, parameters=sizes)
        causes.append({**_key(cause, station, places), "alike": []})
        if change.effect == "stiffness":
            causes[-1]["neutral"] = 0.0
    return {"causes": causes, "background": []}


def _lacks_nothing(turn: int) -> bool:
    return turn % NOTHING_EVERY == NOTHING_EVERY - 1


def _choose_effects(
    random: np.random.Generator,
    stratum: str,
    case: tuple[int, int, int],
    station: Station,
    machine: int,
) -> tuple[Wanted, ...]:
    """Return what a machine lacks; effects come in an order that the seed says.

    Args:
        random: random numbers of the machine.
        stratum: one of ``STRATA``.
        case: seed of the set, number of the case in its stratum, and of the attempt.
        station: nominal machine.
        machine: seed of the machine.
    """
    seed, turn, attempt = case
    if stratum == "force":
        name, parameter, values = FORCE_FAULTS[turn % len(FORCE_FAULTS)]
        value = float(random.choice(values))
        (hammer, *_) = draw_hammers(station, station.first_aim(), REAL_INSTRUMENTS, machine)
        # What the channel is off by tolerance counts too: both together are the value.
        alone = value / hammer.gain if parameter == "gain" else value - hammer.delay
        return (Wanted(name, parameter=(parameter, alone)),)
    if stratum != "several" and _lacks_nothing(turn):
        return ()
    among = LAWS if stratum == "levels" else SINGLE
    count = 2 + turn % 2 if stratum == "several" else 1
    order = stream(seed, f"gapbench.{stratum}").permutation(len(among))
    first = (3 if stratum == "several" else 1) * turn + 7 * attempt
    names = [among[k] for k in np.take(order, range(first, first + count), mode="wrap")]
    ratio = 4.0 if count > 1 else float(random.choice(_RATIOS))
    return tuple(Wanted(name, None, ratio, 3, None, 8) for name in names)


def _alike_places(subject: Subject, plan: Plan) -> dict[str, list[str]]:
    """Return, by the place of each effect, other places that the test cannot tell from it.

    The effect is drawn there several times. What a linearised refit leaves of the true one, over
    the noise, has a cosine of at least 0.95 with what it leaves of some of these together, each
    with a size of its own.
    """
    machine = replace(subject.machine, effects=())
    level = sorted(plan.protocol.levels)[len(plan.protocol.levels) // 2]
    takes = tuple(take for take in subject.files if take.level == level)
    places = places_of(subject.drawing, plan.protocol.nodes)
    alike: dict[str, list[str]] = {}
    linear = [
        drawn.effect
        for drawn in subject.draws.drawn
        if drawn.ratio is not None and drawn.effect.answer().effect not in LAWS
    ]
    if not linear:
        return alike
    refit = refit_of(machine, plan.protocol, takes, plan.tolerance)
    for effect in linear:
        answer = effect.answer()
        true = _residual(refit, machine, effect)
        for place in places[CATALOGUE[answer.effect].kind]:
            draws = []
            for number in range(_ALIKE_DRAWS if place != answer.location else 0):
                random = stream(plan.seed, f"alike.{place}.{number}")
                try:
                    candidate = known_effects()[answer.effect](random, subject.scene, place)
                except TruthError:
                    break
                if candidate is not None:
                    draws.append(_residual(refit, machine, candidate))
            if draws and nnls(np.transpose(draws), true)[1] <= _ALIKE_SINE:
                alike.setdefault(answer.location, []).append(place)
    return alike


def _residual(refit: SurvivalRefit, machine: TrueMachine, effect: Effect) -> Real:
    """Return what a linearised refit leaves of a small effect, over the noise and of length 1."""
    effect = effect if effect.size is None else effect.sized(_SMALL_PART * effect.size)
    change = refit.change(replace(machine, effects=(*machine.effects, effect)))
    whitened = refit.whiten(change - refit.fit_change(change))
    return np.asarray(whitened / max(float(np.linalg.norm(whitened)), 1e-300))


def places_of(station: Station, nodes: Sequence[int]) -> dict[str, list[str]]:
    """Return the places of ``list_places``, with links to the ground."""
    places = list_places(station, nodes)
    places["pair"] += [f"pair:world-{s.name}" for s in station.stages if s.parent != GROUND]
    return places


def _bodies_at(place: str, station: Station) -> set[object]:
    """Return bodies that a place touches; of a body the joints: neighbours share one of them."""
    kind, _, name = place.partition(":")
    parents = {
        stage.name: "world" if stage.parent == GROUND else station.stages[stage.parent].name
        for stage in station.stages
    }
    if kind == "body":
        return {edge for edge in parents.items() if name in edge}
    if kind == "joint":
        return {name, parents[name]}
    if kind == "pair":
        return set(name.split("-"))
    on = {f"acc{sensor.node}": station.stages[i].name for i, sensor in station.sensors()}
    return {on.get(site, site) for site in name.split("+")}


def _key(cause: TrueCause, station: Station, places: dict[str, list[str]]) -> dict[str, object]:
    """Return what the grader is told of a cause."""
    entry = CATALOGUE[cause.effect]
    here, size = _bodies_at(cause.location, station), cause.parameters.get(entry.size)
    same = sorted({cause.location, canonical(cause.location)})
    beside = [p for p in places[entry.kind] if p not in same and here & _bodies_at(p, station)]
    near = sorted({*beside, *map(canonical, beside)})
    return {
        "effect": cause.effect,
        "places": same,
        "near": near,
        "size": size and stated_number(entry.size, size if len(size) > 1 else size[0]),
        "neutral": entry.neutral,
        "ratio": cause.ratio,
    }
