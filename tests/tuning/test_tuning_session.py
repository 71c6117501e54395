"""A campaign opened to be tuned: which Parts it has, and what ``[tuning]`` asks of them."""

import numpy as np
import pytest
from campaign_folder import CAMPAIGN, write_folder

from identification.words import InputError
from mbmodel import write_model
from tuning import build_toleranced_model, open_session

INSTRUMENTS = """[tolerance]
sensor_delay = 2e-5
sensor_cross = 0.014
hammer_gain = 0.02
hammer_delay = 2e-5
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("session") / "campaign", lines=40)


@pytest.fixture
def opened(written):
    """The session of the campaign with more lines in its campaign.toml."""

    def of(more=""):
        (written / "campaign.toml").write_text(CAMPAIGN + more, encoding="utf-8")
        return open_session(written)

    return of


def names_of(model):
    return [parameter.name for parameter in model.parameters]


def test_all_that_a_drawing_limits_is_a_part(model, campaign, whole):
    result = set(names_of(build_toleranced_model(model.machine, campaign)))
    rest = {name for name in names_of(whole) if not name.startswith("hammer(")}
    hits = {name for name in result if name.startswith("hammer(")}
    assert result - hits == rest
    forces = {f"hammer(acc3:t{axis})" for axis in "xyz"}
    assert {name.split(".")[0] for name in hits} == {*forces, "hammer(default)"}


def test_sensors_that_no_test_reads_are_left_out_and_so_are_points_never_hit(whole, mixed):
    assert names_of(build_toleranced_model(whole.machine, mixed)) == names_of(whole)
    third = type(mixed)("one", mixed.layout, mixed.tests[2:3])
    result = names_of(build_toleranced_model(whole.machine, third))
    points = {name.split(".")[0] for name in result}
    assert {point for point in points if point.startswith("acc")} == {"acc1", "acc3", "acc4"}
    assert {point for point in points if "(" in point} == {"hammer(acc3:ty)", "hammer(default)"}


def test_without_wishes_all_vary_but_what_is_known_exactly(opened):
    session = opened(INSTRUMENTS)
    fixed = {
        parameter.name
        for parameter, free in zip(
            session.model.parameters, session.parametrisation.free, strict=True
        )
        if not free
    }
    # The drawn bodies have no products of inertia: 5 % of nothing is nothing.
    assert fixed == {
        f"{stage}.{what}"
        for stage in ("base", "head")
        for what in (
            *(f"joint_rotation_{axis}" for axis in "xyz"),
            *(f"inertia_{axes}" for axes in ("xy", "xz", "yz")),
        )
    }


def test_the_tolerances_are_those_of_the_campaign(opened):
    session = opened("[tolerance]\nmass = 0.07\nsensor_gain = 0.0\n")
    place = names_of(session.model).index("head.mass")
    assert session.parametrisation.scale[place] == 0.07
    assert not any(".gain_" in name for name in session.parametrisation.names)


def test_every_instrument_has_a_tolerance_for_its_gain_and_delay(opened):
    names = opened(INSTRUMENTS.replace("hammer_delay = 2e-5", "hammer_delay = 0")).parametrisation
    assert "hammer(default).gain" in names.names
    assert "hammer(default).delay" not in names.names
    assert {"acc1.delay_x", "acc1.cross_yz"} <= set(names.names)
    scale = dict(zip(names.names, names.scales, strict=True))
    assert (scale["acc1.delay_x"], scale["hammer(default).gain"]) == (2e-5, 0.02)
    with_none = opened("[tolerance]\n" + "".join(f"{key} = 0\n" for key in (
        "sensor_delay", "sensor_cross", "hammer_gain", "hammer_delay"
    )))  # fmt: skip
    kinds = {p.known for p, free in zip(
        with_none.model.parameters, with_none.parametrisation.free, strict=True
    ) if free}  # fmt: skip
    assert not kinds & {"sensor_delay", "sensor_cross", "hammer_gain", "hammer_delay"}


def test_the_calibration_is_that_of_the_hammer_that_states_its_own(opened):
    assert opened("").known_force_tolerance == 0.02
    assert opened("[hammer.default]\ngain_tolerance = 0.2\n").known_force_tolerance == 0.2
    assert opened("[tolerance]\nhammer_gain = 0.0\n").known_force_tolerance == 0.0
    own = opened("[tolerance]\nhammer_gain = 0.0\n[hammer.default]\ngain_tolerance = 0.1\n")
    assert own.known_force_tolerance == 0.1


def test_wishes_reach_what_varies(opened):
    session = opened(
        """
        [tuning]
        free = ["acc4.rotation_?"]
        fix = ["*.damping"]
        tie = [["base_t?.stiffness"]]
        [tuning.prior]
        "head.mass" = 0.2
        [tuning.bounds]
        "head_tx.stiffness" = [4e6, 9e6]
        """
    )
    made, names = session.parametrisation, names_of(session.model)
    member = dict(zip(names, made.coordinate_of, strict=True))
    assert not made.is_tolerance[[member[f"acc4.rotation_{axis}"] for axis in "xyz"]].any()
    assert all(member[name] == -1 for name in names if name.endswith(".damping"))
    assert member["base_tx.stiffness"] == member["base_tz.stiffness"]
    assert made.scale[names.index("head.mass")] == 0.2
    assert np.exp(made.upper[member["head_tx.stiffness"]]) == pytest.approx(9 / 8)


def test_a_wish_that_cannot_be_is_refused_with_its_file(opened, written):
    with pytest.raises(InputError, match=r"fits no parameter: did you mean head\.mass") as caught:
        opened('[tuning]\nfree = ["haed.mass"]\n')
    assert str(written / "campaign.toml") in str(caught.value)


def test_a_tuned_mjcf_leaves_the_axes_of_corrected_sensors_as_drawn(tmp_path):
    folder = write_folder(tmp_path / "campaign")
    file = folder / "campaign.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text + '\n[sensor.acc6]\nflip = ["x"]\nturn = [0.0, 0.0, 0.1]\n')
    model = open_session(folder).model
    names, theta = [parameter.name for parameter in model.parameters], model.drawn.copy()
    for axis in "xyz":
        theta[names.index(f"acc6.position_{axis}")] = 1e-3
    written = write_model(model, theta, tmp_path / "tuned.xml")
    assert written.difference == ""
