"""The catalogue: what every effect says of itself, and effects that other packages bring."""

import sys
import tomllib
from pathlib import Path

import pytest

from diagnosis import EFFECTS, PROVEN, catalogue, diagnose, verdict_of
from identification.words import InputError
from tests.helpers.drawn import drawn

EXAMPLE = Path(__file__).parents[2] / "assets" / "inerter_effect"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installs an entry point, as pip would."""

    def install(name, value):
        place = tmp_path / "installed"
        info = place / "some_effect-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-effect\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[mbw.effects]\n{name} = {value}\n")
        monkeypatch.syspath_prepend(str(place))
        monkeypatch.syspath_prepend(str(EXAMPLE))
        catalogue.cache_clear()

    yield install
    catalogue.cache_clear()
    sys.modules.pop("inerter_effect", None)


def test_every_effect_says_what_it_means_and_what_would_confirm_it():
    for effect in (*EFFECTS.values(), *PROVEN.values()):
        for words in (effect.means, effect.confirm):
            said = effect.said(words, "joint:tilt", "ry")
            assert len(said) > 10
            assert "{" not in said
            assert said[0].islower()
            assert not said.endswith(".")


def test_an_effect_of_ones_own_is_named_like_ours(installed, tmp_path):
    # Not below stage1: against the ground an inerter is a mass error.
    session, text = drawn(tmp_path, 72_044, "inerter", ratio=6.0, place="joint:stage2", lines=161)
    answer = tomllib.loads(text)
    stranger = verdict_of(diagnose(session))
    assert "inerter" not in {cause.effect for cause in stranger.causes}
    said = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]["entry-points"]
    installed("inerter", said["mbw.effects"]["inerter"])
    assert set(catalogue()) == {*EFFECTS, "inerter"}
    found = verdict_of(diagnose(session))
    first = found.causes[0]
    assert found.verdict == "explained"
    assert (first.effect, first.location) == ("inerter", answer["location"])
    assert first.parameters["inertance"] == pytest.approx(
        answer["parameters"]["inertance"], rel=0.1
    )
    assert found.gap.after.excess < stranger.gap.retuned.excess
    assert "uncouple the drive" in found.next_experiment


def test_what_is_no_effect_or_takes_a_name_is_refused_by_name(installed):
    installed("inerter", "json:dumps")
    with pytest.raises(InputError, match=r"inerter.*json:dumps is no Effect"):
        catalogue()


@pytest.mark.parametrize("name", ["drift", "sensor_swap"])
def test_a_name_that_is_taken_is_refused(installed, name):
    installed(name, "inerter_effect:EFFECT")
    with pytest.raises(InputError, match=f"{name}.*known already"):
        catalogue()
