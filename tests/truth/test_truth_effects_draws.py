"""What every effect owes: a place or none, an answer as agreed, a size that can go to nothing."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from effect_rigs import FREQ, OCCASIONS, chain, frf_of, random_of, rig_of, scene_of

from truth.effects import CATALOGUE, Effect, Scene
from truth.effects.outside import OUTSIDE
from truth.errors import TruthError
from truth.machine.rig import Occasion, dynamic_stiffness
from truth.machine.station import GROUND, Joint, Sensor, StageBody, Station

DRAWS = {**CATALOGUE, **OUTSIDE}
ONE = r"[tr][xyz]"
SENSOR = r"sensor:acc\d+"
# As agreed in the formats: location, dof, parameters.
NAMES = {
    "mass_error": (r"body:\w+", "", {"mass", "position"}),
    "appendage": (r"body:\w+", r"t[xyz]", {"mass", "frequency", "damping"}),
    "flexible_body": (r"body:\w+", "", {"frequency", "damping"}),
    "gyroscopic": (r"body:\w+", "", {"angular_momentum"}),
    "joint_coupling": (r"joint:\w+", "", {"offset"}),
    "missing_dof": (r"joint:\w+", ONE, {"stiffness", "damping"}),
    "structural_damping": (r"joint:\w+", "", {"loss_factor"}),
    "viscoelastic": (r"joint:\w+", rf"({ONE})?", {"ratio", "tau"}),
    "inertance": (r"joint:\w+", ONE, {"inertance"}),
    "feedback_delay": (r"joint:\w+", ONE, {"delay"}),
    "support_loss": (r"joint:\w+", "", {"fraction"}),
    "parallel_path": (r"pair:\w+-\w+", "", {"stiffness", "damping"}),
    "sensor_gain": (SENSOR, r"t[xyz]", {"gain"}),
    "sensor_polarity": (SENSOR, r"t[xyz]", set()),
    "sensor_misalignment": (SENSOR, "", {"rotation"}),
    "sensor_position": (SENSOR, "", {"offset"}),
    "sensor_swap": (SENSOR + r"(\+acc\d+)?", r"(t[xyz]\+t[xyz])?", set()),
    "sensor_delay": (SENSOR, "", {"delay"}),
    "mount_resonance": (SENSOR, "", {"frequency", "damping"}),
    "hammer_misalignment": (r"hammer:(acc|hit)\d+", r"t[xyz]", {"rotation"}),
    "hammer_gain": (r"hammer:(acc|hit)\d+", "", {"gain"}),
    "hammer_delay": (r"hammer:(acc|hit)\d+", "", {"delay"}),
    "hammer_position": (r"hammer:(acc|hit)\d+", "", {"offset"}),
    "drift": (r"joint:\w+", r"acc\d+:\+t[xyz]|\w", {"factor"}),
    "fractional_damper": (r"joint:\w+", ONE, {"coefficient", "order"}),
    "changing_stiffness": (r"joint:\w+", ONE, {"factor"}),
    "crosstalk": (r"joint:\w+", ONE, {"coupling"}),
}
SIZED = sorted(set(NAMES) - {"sensor_polarity", "sensor_swap"})
VECTORS = {"position": 3, "offset": 3, "rotation": 3, "fraction": 4}
SENSORS = {name for name in NAMES if name.startswith(("sensor", "mount", "hammer"))}
HAMMERS = {name for name in NAMES if name.startswith("hammer")}
UNSYMMETRIC = {"gyroscopic", "crosstalk"}
ACTIVE = {"feedback_delay", "crosstalk"}


def bare() -> Station:
    """A block on one spring, with one sensor: the least that can be hit."""
    com = np.array([0.1, 0.0, 0.2])
    spring = Joint("block_tz", "slide", np.eye(3)[2], com, 1e6, 100.0)
    stage = StageBody(
        "block", GROUND, 10.0, com, np.diag([1.0, 1.1, 1.2]), (spring,), (Sensor(1, com),)
    )
    return Station("bare", (stage,))


def drifting(station: Station, joint: str = "slide") -> Station:
    """A machine without springs: every joint free."""
    stages = tuple(
        replace(
            stage,
            joints=tuple(
                replace(one, stiffness=0.0, damping=0.0)
                for one in stage.joints
                if one.kind == joint
            ),
        )
        for stage in station.stages
    )
    return replace(station, stages=stages)


@cache
def machine(name: str) -> Station:
    """A machine that has a place for the effect."""
    return chain(hinges=name == "missing_dof")


@cache
def scene(name: str) -> Scene:
    """A test of that machine."""
    return scene_of(machine(name))


def drawn(name: str, seed: int = 3, place: str | None = None) -> Effect:
    effect = DRAWS[name](random_of(seed), scene(name), place)
    assert effect is not None
    return effect


LATER = tuple(replace(one, time=1.0) for one in OCCASIONS)


@cache
def unchanged(name: str) -> np.ndarray:
    return frf_of(machine(name), occasions=LATER)


def change(name: str, effect: Effect) -> float:
    """How much an effect changes the FRFs of its machine, relative."""
    before = unchanged(name)
    after = frf_of(machine(name), effect, occasions=LATER)
    return float(np.linalg.norm(after - before) / np.linalg.norm(before))


@cache
def locations(name: str, count: int = 60) -> set[str]:
    return {drawn(name, seed).answer().location for seed in range(count)}


def test_the_catalogue_has_every_agreed_name():
    nonlinear = {"friction", "backlash", "hardening"}
    assert set(CATALOGUE) - nonlinear == {"none", *NAMES} - set(OUTSIDE)
    assert not set(CATALOGUE) & set(OUTSIDE)


@pytest.mark.parametrize("name", NAMES)
def test_an_answer_has_the_agreed_names(name):
    location, dof, parameters = NAMES[name]
    for seed in range(12):
        answer = drawn(name, seed).answer()
        assert answer.effect == ("unexplained" if name in OUTSIDE else name)
        assert re.fullmatch(location, answer.location)
        assert re.fullmatch(dof, answer.dof)
        assert set(answer.parameters) == parameters
        for key, value in answer.parameters.items():
            if key in VECTORS or name == "parallel_path":  # its matrices have three values
                assert isinstance(value, tuple)
                assert [type(part) for part in value] == [float] * VECTORS.get(key, 3)
            else:
                assert type(value) is float


@pytest.mark.parametrize("name", NAMES)
def test_the_effect_is_felt_on_its_machine(name):
    assert 1e-4 < change(name, drawn(name)) < 10


@pytest.mark.parametrize("name", SIZED)
def test_an_effect_grows_with_its_size_and_vanishes_with_it(name):
    effect = drawn(name)
    grown = [change(name, effect.sized(part * effect.size)) for part in (1e-5, 1e-4, 1e-3, 1e-2)]
    assert np.all(np.diff(grown) > 0)
    assert grown[0] < 1e-2 * change(name, effect)
    assert grown[0] < 0.2 * grown[1]


@pytest.mark.parametrize("name", SIZED)
def test_the_drawn_size_is_believable_and_can_be_changed_alone(name):
    for seed in range(12):
        effect = drawn(name, seed)
        low, high = effect.limits
        assert 0 < low < effect.size < high < np.inf
        other = effect.sized(low)
        assert other.size == low
        assert other.sized(effect.size) == effect
        assert (other.answer().location, other.answer().dof) == (
            effect.answer().location,
            effect.answer().dof,
        )


@pytest.mark.parametrize("name", SIZED)
@pytest.mark.parametrize("size", [0.0, -1.0, np.inf, np.nan])
def test_a_size_that_no_machine_has_is_refused(name, size):
    with pytest.raises(TruthError, match="make no sense"):
        drawn(name).sized(size)


@pytest.mark.parametrize("name", sorted(set(NAMES) - set(SIZED)))
def test_what_is_there_or_not_has_no_size(name):
    effect = drawn(name)
    assert effect.size is None
    assert effect.limits is None
    with pytest.raises(TruthError, match="there or not"):
        effect.sized(1.0)


@pytest.mark.parametrize("name", NAMES)
def test_an_effect_goes_to_more_than_one_place_and_where_it_is_sent(name):
    found = locations(name)
    alone = {"missing_dof", "parallel_path", *HAMMERS}
    assert len(found) > 1 or name in alone
    for place in found:
        assert drawn(name, place=place).answer().location == place


@pytest.mark.parametrize("name", NAMES)
def test_naming_the_place_leaves_the_other_draws_alone(name):
    for seed in range(12):
        free = drawn(name, seed).answer()
        assert drawn(name, seed, free.location).answer() == free


@pytest.mark.parametrize("name", ["viscoelastic", "appendage", "mount_resonance", "flexible_body"])
def test_a_place_of_its_own_choice_gets_the_same_shape(name):
    free = drawn(name, 5).answer()
    for place in locations(name) - {free.location}:
        other = drawn(name, 5, place).answer()
        shape = set(free.parameters) - {"mass"}
        assert {key: other.parameters[key] for key in shape} == {
            key: free.parameters[key] for key in shape
        }


@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_place_is_refused_by_name(name):
    with pytest.raises(TruthError, match="lid"):
        drawn(name, place="body:lid")


@pytest.mark.parametrize("name", NAMES)
def test_the_draw_follows_from_its_random_numbers(name):
    assert drawn(name, 7) == drawn(name, 7)
    assert (
        len({drawn(name, seed).answer().location + str(drawn(name, seed)) for seed in range(9)}) > 3
    )


@pytest.mark.parametrize("name", sorted(set(NAMES) - SENSORS))
def test_a_machine_with_the_effect_is_reciprocal_but_for_what_feeds_energy_across(name):
    rig = rig_of(machine(name), [drawn(name)], occasion=replace(OCCASIONS[0], time=1.0))
    Z = dynamic_stiffness(rig, FREQ)[0]
    uneven = np.abs(Z - Z.transpose(0, 2, 1)).max() / np.abs(Z).max()
    if name in UNSYMMETRIC:
        assert uneven > 1e-4
    else:
        assert uneven < 1e-12


@pytest.mark.parametrize("name", sorted(set(NAMES) - SENSORS - ACTIVE))
@pytest.mark.parametrize("seed", range(4))
def test_a_machine_with_the_effect_has_mass_holds_and_loses_energy(name, seed):
    # The force's part that follows the speed, (Z - Z*) / 2i, loses energy in every motion.
    effect = drawn(name, seed)
    for one in (effect, effect if effect.limits is None else effect.sized(effect.limits[1])):
        rig = rig_of(machine(name), [one])
        equations = rig.equations
        for matrix in (equations.mass, equations.stiffness):
            assert np.linalg.eigvalsh(matrix)[0] > -1e-10 * np.abs(matrix).max()
        Z = dynamic_stiffness(rig, FREQ)[0]
        loss = (Z - Z.conj().transpose(0, 2, 1)) / 2j
        assert np.linalg.eigvalsh(loss).min() > -1e-10 * np.abs(Z).max()


@pytest.mark.parametrize("name", NAMES)
def test_the_nominal_station_has_a_place_for_all_but_a_missing_direction(name, nominal):
    for seed in range(3):
        effect = DRAWS[name](random_of(seed), scene_of(nominal, 11), None)
        assert (effect is None) == (name == "missing_dof")
        if effect is not None:
            occasions = scene_of(nominal, 11).occasions
            frf = frf_of(nominal, effect, occasions=occasions, freq_hz=FREQ[::40])
            assert np.isfinite(frf).all()
            assert np.abs(frf).max() > 0


SMALL: dict[str, Callable[[], Station]] = {
    "bare": bare,
    "free slides": lambda: drifting(chain()),
    "free hinges": lambda: drifting(chain(), "hinge"),
    "hinges": lambda: chain(hinges=True),
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("which", SMALL)
def test_a_small_machine_takes_the_effect_or_has_no_place_for_it(name, which):
    station = SMALL[which]()
    for seed in range(6):
        effect = DRAWS[name](random_of(seed), scene_of(station), None)
        if effect is not None:
            assert np.isfinite(frf_of(station, effect, freq_hz=FREQ[::40])).all()


@pytest.mark.parametrize(
    ("which", "missing"),
    [
        (
            "bare",
            {
                "inertance",
                "flexible_body",
                "gyroscopic",
                "joint_coupling",
                "support_loss",
                "parallel_path",
                "crosstalk",
            },
        ),
        (
            "free slides",
            {
                "gyroscopic",
                "joint_coupling",
                "missing_dof",
                "structural_damping",
                "viscoelastic",
                "feedback_delay",
                "support_loss",
                "parallel_path",
                "drift",
                "fractional_damper",
                "changing_stiffness",
                "crosstalk",
            },
        ),
    ],
)
def test_it_has_no_place_for_exactly_these(which, missing):
    scene = scene_of(SMALL[which]())
    found = {name for name in NAMES if DRAWS[name](random_of(1), scene, None) is None}
    assert found == missing


def test_a_campaign_without_a_hit_has_no_hammer_and_no_drift():
    scene = Scene(chain(), ())
    for name in HAMMERS:
        assert DRAWS[name](random_of(1), scene, None) is None
    assert DRAWS["drift"](random_of(1), scene, None) is None


def test_only_what_depends_on_the_occasion_says_so():
    occasions = [
        Occasion(level, 1, axis, setup, time)
        for level in (40.0, 200.0)
        for axis in range(3)
        for setup in "ab"
        for time in (0.0, 0.5, 1.0)
    ]
    for name in NAMES:
        kinds = {drawn(name).when(one) for one in occasions}
        assert (len(kinds) > 1) == (name in {"drift", "changing_stiffness"})
