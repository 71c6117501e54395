"""Effects, places and sizes of a diagnosis in words."""

from types import SimpleNamespace

import pytest

from diagnosis.labels import name_direction
from diagnosis.verdict.schema import CauseRow, Verdict
from diagnosis.verdict.sentences import (
    UNEXPLAINED,
    cause_words,
    place_name,
    place_phrase,
    verdict_sentence,
)
from mbw.diagnose.effect_parameters import number, parameter_lines, parameter_words
from mbw.diagnose.gap_sentences import closed_words, held_out_sentence, unestablished_words
from mbw.diagnose.sentences import (
    cause_parameters,
    confounded_sentences,
    noise_sentences,
    places_sentences,
    serial_correlation_sentences,
    site_words,
    untested_sentences,
)
from mbw.diagnose.tables import _cause
from mbw.page.numbers import format_closed
from tests.gallery.machines import GALLERY


def test_a_cause_that_a_lower_threshold_established_is_named():
    text = (GALLERY / "gantry-diagnosed" / "verdict.json").read_text(encoding="utf-8")
    verdict = Verdict.model_validate_json(text)
    row = verdict.causes[0].model_copy(update={"probability": 0.3})
    doubted = verdict.model_copy(update={"causes": [row]})
    assert verdict_sentence(doubted) == verdict_sentence(verdict)
    rivals = doubted.model_copy(update={"verdict": "unexplained"})
    assert UNEXPLAINED[1:] in verdict_sentence(rivals)


@pytest.mark.parametrize(
    ("effect", "dof", "name", "value", "words"),
    [
        ("appendage", None, "damping", 0.0113, "damping 1.13 %"),
        ("missing_dof", "rx", "damping", 1830.0, "damping 1830 N m s/rad"),
        ("missing_dof", "tx", "stiffness", 5.571e8, "stiffness 5.57e+08 N/m"),
        (
            "sensor_misalignment",
            None,
            "rotation",
            (0.1, 0.0, -0.2),
            "rotation (5.73, 0, -11.5)° as a vector in world axes",
        ),
        ("feedback_delay", "tz", "delay", 0.0010054, "delay 1.01 ms"),
        ("gyroscopic", None, "angular_momentum", 18115.3, "angular momentum 18100 kg m²/s"),
        ("support_loss", None, "fraction", (0.02, 1.0), "fraction (2, 100) %"),
        ("inertance", "tx", "inertance", 13.18, "inertance 13.2 kg"),
        ("inertance", "rz", "inertance", 0.1017, "inertance 0.102 kg m²"),
        ("outside", None, "reach", 13.18, "reach 13.2"),
    ],
)
def test_sizes_have_units_that_engineers_read(effect, dof, name, value, words):
    assert parameter_words(effect, dof, name, value) == words


def test_sizes_have_as_many_digits_as_their_interval_leaves():
    (line,) = parameter_lines("appendage", None, "mass", 31.237, (29.81, 32.9))
    assert (line.name, line.value, line.interval) == ("mass", "31.2 kg", "29.8 … 32.9")
    x, y = parameter_lines("s", None, "offset", (0.1224, 0.0), ((0.1, 0.2), (-0.001, 0.001)))
    assert (x.name, x.value, x.interval) == ("offset 1", "122 mm", "100 … 200")
    assert (y.value, y.interval) == ("0.0 mm", "-1.0 … 1.0")
    (bare,) = parameter_lines("drift", "b", "factor", 0.72618, None)
    assert (bare.value, bare.interval) == ("0.726", "")
    assert number(5.571e8, 1e6) == "5.571e8"
    assert number(1096.0) == "1100"


def test_places_and_directions_are_words():
    assert place_phrase("pair:ty-hexapod") == "between ty and hexapod"
    assert place_phrase("pair:world-hexapod") == "between the ground and hexapod"
    assert place_phrase("pair:x-stage-top") == "between x-stage-top"  # which hyphen joins them?
    assert place_name("pair:ty-hexapod") == "pair ty-hexapod"
    assert place_phrase("hammer:acc11") == "at hammer acc11"
    assert place_name("sensor:acc1+acc2") == "sensors acc1 and acc2"
    assert name_direction("rx") == "about x"
    assert name_direction("tx+ty") == "x and y"
    assert name_direction("acc11:+ty") == "hit at acc11:+ty"
    assert name_direction("b") == "set-up b"
    assert site_words("inerter@joint:ty") == "inerter at joint ty"


def row(interval):
    return CauseRow(
        effect="mass_error", location="body:ty", dof=None, probability=0.9, excess_after=1.0,
        parameters={"mass": 0.02, "position": (4.0, -9.0, 0.5)}, interval=interval,
    )  # fmt: skip


def test_a_mass_that_may_be_zero_has_no_known_position():
    said = cause_parameters(row({"mass": (-0.31, 0.35)}))
    assert said == "mass 0.02 kg (95 %: -0.31 … 0.35), position not known"
    page = _cause(row({"mass": (-0.31, 0.35)}), "a mass", {})
    assert "not known" in page
    assert "-0.31 … 0.35" in page
    assert "4000" not in page


def test_a_link_whose_damping_may_be_zero_has_a_stiffness():
    link = CauseRow(
        effect="parallel_path", location="pair:a-b", dof=None, probability=1.0, excess_after=1.0,
        parameters={"stiffness": 1.8e5, "damping": 18.3}, interval={"damping": (-51.3, 102.4)},
    )  # fmt: skip
    said = cause_parameters(link)
    assert said == "stiffness 1.8e+05 N/m, damping 18.3 N s/m (95 %: -51 … 102)"
    page = _cause(link, "a link", {})
    assert "1.8e+05 N/m" in page
    assert "not known" not in page


def test_held_out_gaps_far_above_those_of_the_fit_are_explained():
    def gap(excess):
        return SimpleNamespace(retuned=SimpleNamespace(excess=excess))

    null = SimpleNamespace(null=SimpleNamespace(chi_square=2.7**2))
    said = held_out_sentence(gap(10.8), null)
    assert "Fitted to all lines, the re-tuned model leaves 2.7 times the noise" in said
    assert held_out_sentence(gap(3.9), null) is None
    assert held_out_sentence(gap(None), null) is None


@pytest.mark.parametrize("interval", [{}, {"mass": (0.01, 0.03)}])
def test_a_mass_above_zero_has_a_position(interval):
    said = cause_parameters(row(interval))
    frame = "from the body's centre of mass as drawn, in world axes"
    assert said == f"mass 0.02 kg, position (4000, -9000, 500) mm {frame}"
    assert "4000" in _cause(row(interval), "a mass", {})


def test_no_more_than_all_of_a_gap_is_closed_at_either_end():
    said = "100.0% of the gap beyond noise is closed"
    assert closed_words(1.002, (1.001, 1.003)) == f"{said} (95 %: 100.0% to 100.0%)"
    assert closed_words(1.0, (0.92, 1.003)) == f"{said} (95 %: 92.0% to 100.0%)"
    assert closed_words(1.0, None) == said
    assert closed_words(1.92, (-3.21, 2.4)) == (
        "about all of the gap beyond noise is closed (95 %: none to 100.0%)"
    )


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (1.92, "about all"),
        (-3.21, "none"),
        (0.874, "87.4 %"),
        (1.0002, "100 %"),  # of rounding
        (1.0, "100 %"),
        (0.0, "0 %"),
    ],
)
def test_a_share_beyond_0_to_100_per_cent_is_said_in_words(share, text):
    assert format_closed(share) == text


def test_a_cause_with_which_the_gap_grows_is_not_established_for_that():
    assert unestablished_words(-0.4) == "which grows with it, so it is not established"
    assert unestablished_words(0.1).startswith("less than 20 %")
    assert "size holds no effect" in unestablished_words(0.9, has_size=False)


def test_what_levels_could_show_is_untested_for_one_reason_or_another():
    verdict = SimpleNamespace(not_testable=["friction", "hardening", "drift"])
    once, drift = untested_sentences(verdict, 1)
    assert once == (
        "Not tested, so not excluded: friction and a spring that hardens; they need hits of "
        "several levels, each stated in campaign.toml."
    )
    several, same = untested_sentences(verdict, 3)
    assert "hardens; they need the level of every test in campaign.toml" in several
    assert drift == same


def test_parameters_that_a_user_fixes_are_stated_as_untested():
    (said,) = untested_sentences(SimpleNamespace(not_testable=["sensor_gain"]), 1)
    assert said == (
        "Not tested, so not excluded: a wrong gain; [tuning] or [tolerance] in campaign.toml fixes "
        "some of these at their nominal values."
    )


def test_confounded_causes_are_listed_with_the_preference_of_the_data():
    def said(*shares, twins=(("ty", "rz"),)):
        rows = [
            row({}).model_copy(update={"location": f"body:{at}", "probability": share})
            for at, share in zip(("ty", "rz", "top"), shares, strict=False)
        ]
        named = [tuple(f"mass_error@body:{name}" for name in pair) for pair in twins]
        return confounded_sentences(SimpleNamespace(causes=rows, twins=named))

    mass = "mass beyond tolerance on body"
    end = "(confounded causes)."
    assert said(0.6, 0.3) == [f"These data hardly distinguish {mass} ty and {mass} rz {end}"]
    (told,) = said(0.96, 0.02)
    assert told.startswith(f"M{mass[1:]} ty and {mass} rz have similar signatures")
    assert told.endswith("these data prefer the first, 96 % to 2 %.")
    assert said(0.03, 0.002)[0].startswith("These data hardly distinguish")
    # Pairs that share one are a set, the likeliest first.
    chain = (("rz", "top"), ("ty", "rz"))
    assert said(0.2, 0.3, 0.4, twins=chain) == [
        f"These data hardly distinguish {mass} top, {mass} rz and {mass} ty {end}"
    ]
    assert said() == [f"These data hardly distinguish {mass} rz and {mass} ty {end}"]


def test_a_cause_with_several_places_names_all_and_no_twins_among_them():
    here = row({}).model_copy(update={"places": ["body:ty", "body:rz"]})
    other = row({}).model_copy(update={"location": "body:top", "places": ["body:top"]})
    assert cause_words(here) == "mass beyond tolerance on body ty or on body rz"
    assert cause_words(other) == "mass beyond tolerance on body top"
    sites = [f"mass_error@body:{name}" for name in ("ty", "rz", "top")]
    verdict = SimpleNamespace(causes=[here, other], twins=[(sites[0], sites[1])])
    assert confounded_sentences(verdict) == []
    (said,) = places_sentences(verdict)
    assert said.startswith("Mass beyond tolerance on body ty or on body rz: this test cannot tell")
    verdict.twins.append((sites[0], sites[2]))
    assert len(confounded_sentences(verdict)) == 1
    assert "body ty or body rz" in _cause(here, "a mass", {})


def test_the_serial_correlation_is_stated_without_and_with_the_effect():
    after = [SimpleNamespace(gap=0.0025), SimpleNamespace(gap=-0.001)]
    seen = SimpleNamespace(null=SimpleNamespace(serial=0.09, gap=0.09), sets=after[:1])
    (said,) = serial_correlation_sentences(seen)
    assert "0.3 times the noise without any effect and 0.05 times with the best" in said
    seen.sets = after
    assert "and 0 times with the best" in serial_correlation_sentences(seen)[0]
    seen.null.serial = None
    assert serial_correlation_sentences(seen) == []


@pytest.mark.parametrize(
    ("variance", "serial", "said"),
    [
        ("coherence", 0.0, []),
        ("differences", 0.0, ["the files hold no coherence"]),
        ("coherence", None, ["the noise of neighbouring frequency lines"]),
        ("differences", None, ["the files hold no coherence", "the noise of neighbouring"]),
    ],
)
def test_limits_of_the_noise_estimate_are_stated(variance, serial, said):
    found = noise_sentences(SimpleNamespace(variance=variance, null=SimpleNamespace(serial=serial)))
    assert [text.startswith(opening) for text, opening in zip(found, said, strict=True)] == [
        True
    ] * len(said)
