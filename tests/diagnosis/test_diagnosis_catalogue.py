"""The catalogue: what every effect says of itself, and effects that other packages bring."""

import sys
import tomllib
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from diagnosis import (
    EFFECTS,
    PROVEN,
    Scene,
    build_verdict,
    diagnose,
    hash_inputs,
    load_catalogue,
)
from diagnosis.effects import Effect, check_others
from diagnosis.effects.plugins import GROUP, load_effect
from diagnosis.input_hash import _hash_files
from diagnosis.settings import SETTINGS
from identification.words import InputError
from mbmodel import release_rigid_directions
from tests.helpers.drawn import drawn
from tuning import build_toleranced_model

NAME = "fractional_damper"
EXAMPLE = Path(__file__).parents[2] / "assets" / f"{NAME}_effect"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installs an entry point, as pip would; of the example, changed, if changes are given."""

    def install(name, value="fractional_damper_effect:EFFECT", changes=(), folder="installed"):
        place = tmp_path / folder
        info = place / "some_effect-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-effect\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[mbw.effects]\n{name} = {value}\n")
        text = (EXAMPLE / "fractional_damper_effect.py").read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (place / "fractional_damper_effect.py").write_text(text)
        monkeypatch.syspath_prepend(str(place))
        load_catalogue.cache_clear()

    yield install
    load_catalogue.cache_clear()
    sys.modules.pop("fractional_damper_effect", None)


DOUBLED = """def _doubled(*given):
    part = AddedPart.linear(*given)
    return AddedPart(*given[:2], lambda theta: part.finite(2 * theta), part.derivatives)


"""


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return drawn(tmp_path_factory.mktemp("few"), 72_001, lines=41)[0]


def test_every_effect_says_what_it_means_and_what_would_confirm_it():
    for effect in (*EFFECTS.values(), *PROVEN.values()):
        for words in (effect.means, effect.confirm):
            said = effect.describe(words, "joint:tilt", "ry")
            assert len(said) > 10
            assert "{" not in said
            assert said[0].islower()
            assert not said.endswith(".")


@pytest.mark.parametrize("name", sorted({*EFFECTS, *PROVEN}))
def test_what_confirms_an_effect_says_where(name):
    effect = {**EFFECTS, **PROVEN}[name]
    assert "acc1 and acc2" in effect.describe(effect.confirm, "sensor:acc1+acc2", None)
    assert "tilt" in effect.describe(effect.confirm, "joint:tilt", "ry")
    for words in (effect.means, effect.confirm):  # a rotation is about an axis
        assert "along ry" not in effect.describe(words, "joint:tilt", "ry")


@pytest.mark.parametrize(
    ("effect", "place", "dof", "said"),
    [
        ("sensor_polarity", "sensor:acc1", "tz", "turn the sign of acc1 along z back, or"),
        ("sensor_swap", "sensor:acc1", "tx+ty", "knock at acc1 along each axis in turn and"),
        ("sensor_swap", "sensor:acc1+acc2", None, "knock at acc1 and acc2 along each axis"),
        ("hammer_misalignment", "hammer:acc4", "tx", "hit acc4 along x again, guided"),
        ("missing_dof", "joint:ty", "rz", "the joint of ty: about z, or its own axis"),
        ("drift", "joint:ty", "acc1:+tx", "repeat the hit at acc1:+tx directly before"),
        ("drift", "joint:ty", "b", "repeat the set-up b directly before"),
        ("dead_channel", "sensor:acc1", None, "look at cable and plug of acc1, and"),
    ],
)
def test_places_and_directions_stand_in_what_confirms(effect, place, dof, said):
    known = {**EFFECTS, **PROVEN}[effect]
    assert said in known.describe(known.confirm, place, dof)


def test_a_support_that_carries_little_is_not_said_to_carry_nothing():
    said = EFFECTS["support_loss"].describe(EFFECTS["support_loss"].means, "joint:granite", None)
    assert said == "a support of the joint of granite carries less than its share"


def test_an_effect_of_ones_own_is_named_like_ours(installed, tmp_path):
    session, text = drawn(
        tmp_path, 72_044, "fractional_damper", ratio=6.0, place="joint:stage2", lines=161
    )
    answer = tomllib.loads(text)
    said = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]["entry-points"]
    installed(NAME, said["mbw.effects"][NAME])
    assert set(load_catalogue()) == {*EFFECTS, NAME}
    found = build_verdict(diagnose(session))
    first = found.causes[0]
    assert found.verdict in ("explained", "partly")
    assert (first.effect, first.location) == (NAME, answer["location"])
    assert first.parameters["order"] == pytest.approx(answer["parameters"]["order"], abs=0.1)
    assert found.gap.after.excess < found.gap.retuned.excess
    assert NAME in found.next_experiment  # a branch with one time constant is its rival


def test_what_is_no_effect_or_takes_a_name_is_refused_by_name(installed):
    installed(NAME, "json:dumps")
    with pytest.raises(InputError, match=r"fractional_damper.*json:dumps is no Effect"):
        load_catalogue()


@pytest.mark.parametrize("name", ["drift", "sensor_swap"])
def test_a_name_that_is_taken_is_refused(installed, name):
    installed(name, "fractional_damper_effect:EFFECT")
    with pytest.raises(InputError, match=f"{name}.*known already"):
        load_catalogue()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("EFFECT = Effect(", "EFFECT = 1 / 0 + Effect(", "loading.*ZeroDivisionError"),
        ("EFFECT = Effect(", "OTHER = Effect(", "loading.*no attribute 'EFFECT'"),
        ("of {place} {", "of {body} {", "confirm.*KeyError: 'body'"),
        ('noun="a fractional damper"', "noun=None", "noun is None"),
    ],
)
def test_what_cannot_be_loaded_or_does_not_speak_is_refused_by_name(installed, old, new, said):
    installed(NAME, changes=[(old, new)])
    with pytest.raises(InputError, match=f"^entry point {NAME} of mbw.effects: .*{said}"):
        load_catalogue()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("    machine = scene", "    raise OSError('no table')\n    machine = scene", "no table"),
        ("def propose", "def propose(_): return None\n\n\ndef _unused", "propose, which.*NoneType"),
        ("    propose,", "    lambda _: [1.0],", "it proposes 1.0: yield Hypothesis"),
        (
            '"fractional_damper",',
            '"flywheel",',
            "flywheel@joint.* is called 'flywheel': call both alike",
        ),
        (f'{" " * 16}f"joint:{{axle.stage}}",\n{" " * 16}axle', '"here", axle', "it is at 'here'"),
        ("parts=(part,),", "", "it frees nothing"),
        ("parts=(part,)", "release=('no.such',)", "it names no.such"),
        ("parts=(part,)", "parts=(part, part)", "fractional0.3 is named twice"),
        ('f"{axle.joint}.fractional{order:g}"', '"damper"', "damper is named twice"),
        ("Parameter(name, 0.0", "Parameter(name, 3.0", "is drawn as 3"),
        ("core[0, 0] = unit", "core[0, 0] = np.nan", "a slope .*nan"),
        ('("joint", frame', '("joint", frame[:2]', r"a slope the frames are \(2, 1\)"),
        ("frame, core,", "frame, core[0],", r"the core is \(3, 1, 1\), expected \(1, 3, 1, 1\)"),
        ('Change("joint"', 'Change("spring"', "the slot is 'spring'"),
        ("partial(power, order, omega)", "lambda s: s[:2]", "a slope the shape gives"),
        ("AddedPart.linear(", "_doubled(", "slopes are not those of its change"),
        ("unit * found[own]", "float('nan')", "state.*'coefficient' is nan"),
        ("unit * found[own]", "'big'", "state.*big"),
        ("unit * found[own]", "found['none']", "state.*KeyError: 'none'"),
    ],
)
def test_a_hypothesis_that_cannot_be_fitted_is_refused_before_anything_is(
    installed, session, old, new, said
):
    installed(NAME, changes=[(old, new), ("def propose", f"{DOUBLED}def propose")])
    with pytest.raises(InputError, match=f"^entry point {NAME} of mbw.effects[:,] .*{said}"):
        check_others(session)


def test_a_parameter_with_a_name_that_is_taken_is_refused(installed, session):
    installed(NAME, changes=[(".fractional{order:g}", ".{'stiffness' if order == 0.3 else order}")])
    with pytest.raises(InputError, match="stiffness has a name of the model: give it another"):
        check_others(session)


def test_ours_pass_the_checks_of_others_and_do_not_pay_for_them(session, monkeypatch):
    machine, held = release_rigid_directions(
        session.model.machine, float(session.campaign.freq_hz.max())
    )
    model = build_toleranced_model(machine, session.campaign)
    scene = Scene(replace(session, model=model), model.drawn, held)
    for name in EFFECTS:
        point = EntryPoint(name, f"diagnosis.effects.{name}:EFFECT", GROUP)
        assert len(load_effect(point)(scene)) == len(list(EFFECTS[name](scene)))
    monkeypatch.setattr(Effect, "__call__", None)  # nobody is asked
    check_others(session)


def test_a_statement_that_fails_at_fitted_values_is_left_out_and_said_once(
    installed, session, caplog
):
    installed(
        "fractional_damper", changes=[("unit * found[own]", "unit * found[own] / (found[own] < 2)")]
    )
    hypothesis = next(iter(load_catalogue()[NAME](Scene(session, session.model.drawn))))
    (name,) = hypothesis.coordinates
    assert hypothesis.state({name: 1.0})["coefficient"] > 0
    assert hypothesis.state({name: 3.0}) == hypothesis.state({name: 4.0}) == {}
    (record,) = caplog.records
    assert f"entry point {NAME} of mbw.effects, {NAME}@joint:" in record.getMessage()
    assert "ZeroDivisionError" in record.getMessage()


FAILING = """def _failing(*given):
    part = AddedPart.linear(*given)

    def far(theta):
        return part.finite(theta) if abs(theta).max() < 1 else 1 / 0

    return AddedPart(*given[:2], far, part.derivatives, written=lambda _: 1 / 0)


"""


def test_a_part_that_fails_far_from_where_it_was_checked_says_whose_it_is(installed, session):
    changes = [("AddedPart.linear(", "_failing("), ("def propose", f"{FAILING}def propose")]
    installed(NAME, changes=changes)
    hypothesis = next(iter(load_catalogue()[NAME](Scene(session, session.model.drawn))))
    (part,) = hypothesis.parts
    near, far = np.array([0.5]), np.array([2.0])
    assert part.finite(near)[0].core.any()
    whose = rf"^entry point {NAME} of mbw.effects, {NAME}@joint:.*: finite, .*ZeroDivisionError"
    with pytest.raises(InputError, match=whose):
        part.finite(far)
    (said,) = part.write(near)
    assert "written fails with ZeroDivisionError" in str(said)


def test_the_hash_of_a_diagnosis_knows_an_effect_by_its_physics(installed, session, tmp_path):
    plain = hash_inputs(session)
    seen = set()
    for number, changes in enumerate(
        ((), (("_UNIT = 0.1", "_UNIT = 0.2"),), (("# times the", "#"),))
    ):
        sys.modules.pop("fractional_damper_effect", None)
        _hash_files.cache_clear()
        installed(NAME, changes=changes, folder=f"installed{number}")
        seen.add(hash_inputs(session))
        assert hash_inputs(session) in seen  # the same for the same code
    assert len({plain, *seen}) == 4


def test_the_hash_of_a_diagnosis_knows_numbers_that_an_effect_reads_elsewhere(
    installed, session, monkeypatch
):
    read = [
        ("_UNIT = 0.1", "import os\n_UNIT = 1.0"),
        ("unit = _UNIT *", "unit = float(os.environ['DAMPER']) *"),
    ]
    installed(NAME, changes=read)
    monkeypatch.setenv("DAMPER", "0.01")
    first = hash_inputs(session)
    monkeypatch.setenv("DAMPER", "0.02")
    assert hash_inputs(session) != first


def test_the_hash_of_a_diagnosis_knows_its_settings(session):
    assert hash_inputs(session, replace(SETTINGS, max_causes=1)) != hash_inputs(session)
