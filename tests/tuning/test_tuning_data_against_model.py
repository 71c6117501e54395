"""Measurement against the nominal model before any fit: wrong exports are named."""

import re
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from campaign_folder import write_folder
from scipy.io import loadmat, savemat

from identification.readers.frf_units import parse_frf_units
from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    InputError,
    Test,
)
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    body_parts,
    load_machine,
    spring_parts,
)
from mbw.assets import asset_path
from truth.campaign.draw import draw_drawing
from truth.campaign.file_formats import model_xml
from truth.machine.random_tree import draw_tree
from tuning import open_session
from tuning.checks.data_against_model import (
    _closest_faults,
    _CurveAgreement,
    compare_with_model,
)
from tuning.checks.export_faults import StatedExport, list_faults

FREQ = np.arange(2.0, 242.0, 1.0)
HEALTHY = range(6)
FILE = "impact.uff"


@pytest.fixture(scope="session")
def random_case(tmp_path_factory):
    """Return a function of a seed: the nominal model of a random machine, and its test."""
    folder = tmp_path_factory.mktemp("trees")

    @cache
    def build(seed):
        tree = draw_drawing(draw_tree(seed, 3 + seed % 3), seed)
        path = folder / f"{seed}.xml"
        path.write_text(model_xml(tree), encoding="utf-8")
        machine = load_machine(path)
        model = Model(machine, (*spring_parts(machine), *body_parts(machine)))
        random = np.random.default_rng(seed)
        factors = [_draw_error(random, parameter.name) for parameter in model.parameters]
        return model, _hammer_test(model, model.drawn * factors, tree.first_aim(), random)

    return build


def _draw_error(random, name):
    """Factor of the real machine on the drawing: stiffness up to 3, damping 5, mass 20 %."""
    if name.endswith("stiffness"):
        return 3.0 ** random.uniform(-1, 1)
    if name.endswith("damping"):
        return 5.0 ** random.uniform(-1, 1)
    return random.uniform(0.8, 1.2) if name.endswith("mass") else 1.0


def _hammer_test(model, theta, node, random):
    """Hits along three axes with noise of 2 % of each channel's rms."""
    points = [name for name in model.machine.layout.points if name.startswith("acc")]
    outputs = tuple(Dof.of(name, axis) for name in points for axis in range(3))
    tests = []
    for axis in range(3):
        reference = Dof.of(model.machine.layout.hammer_at_node(node), axis)
        values = Evaluator(model, FrfRequest(FREQ, outputs, (reference,))).at(theta).values
        sigma = 0.02 * np.sqrt((np.abs(values) ** 2).mean(axis=0)) * np.ones_like(values.real)
        error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
        frf = Frf(FREQ, values + error[0] + 1j * error[1], outputs, (reference,), "accelerance")
        measured = np.ones(values.shape[1:], bool)
        estimate = FrfEstimate(frf, sigma**2, "differences", measured)
        tests.append(Test(Condition(FILE, reference), estimate))
    return Campaign("virtual", model.machine.layout, tuple(tests))


def as_exported(campaign, factor=1.0, order=0, axis=1.0):
    """The campaign as a file with other units, another quantity or another axis would be read."""
    change = factor * (2j * np.pi * campaign.freq_hz[:, None, None]) ** order

    def export(test):
        frf = test.estimate.frf
        frf = replace(frf, values=frf.values * change, freq_hz=frf.freq_hz * axis)
        variance = test.estimate.variance * np.abs(change) ** 2
        return replace(test, estimate=replace(test.estimate, frf=frf, variance=variance))

    return replace(campaign, tests=tuple(export(test) for test in campaign.tests))


def compare(model, campaign, **stated):
    return compare_with_model(model, campaign, {FILE: StatedExport("accelerance", **stated)})


@pytest.mark.parametrize("seed", HEALTHY)
def test_a_right_file_is_not_questioned_in_any_band(random_case, seed):
    model, campaign = random_case(seed)
    for lines in (slice(None), slice(0, 60), slice(60, 120), slice(120, None)):
        assert compare(model, campaign.select_lines(lines)) == []


UNITS = {"g/N": 9.80665, "mm/s^2/N": 1e-3, "m/s^2/lbf": 1 / 4.44822, "in/s^2/N": 0.0254,
         "m/s^2/kN": 1e-3, "in/s^2/lbf": 0.0254 / 4.44822}  # fmt: skip


@pytest.mark.parametrize(("unit", "si"), UNITS.items())
@pytest.mark.parametrize("seed", [0, 5])
def test_a_wrong_unit_is_named_with_its_key(random_case, seed, unit, si):
    model, campaign = random_case(seed)
    (finding,) = compare(model, as_exported(campaign, 1 / si))
    assert finding.is_certain
    assert f'unit = "{unit}"' in finding.sentence
    assert finding.factor == pytest.approx(1 / si, rel=0.4)
    assert FILE in finding.sentence


def test_a_stated_unit_that_the_file_does_not_have_is_named(random_case):
    model, campaign = random_case(2)
    read = as_exported(campaign, 9.80665)
    (finding,) = compare(model, read, unit="g/N", factor=9.80665)
    assert "values in m/s^2/N were read as g/N" in finding.sentence
    (finding,) = compare(model, read, has_labels=True)
    assert "values in m/s^2/N were labelled g/N" in finding.sentence


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("factor", "order", "keys"),
    [
        (1.0, -1, 'quantity = "mobility"'),
        (1.0, -2, 'quantity = "receptance"'),
        (1e3, -2, 'quantity = "receptance" and unit = "mm/N"'),
    ],
)
def test_another_quantity_is_named_by_its_slope(random_case, seed, factor, order, keys):
    model, campaign = random_case(seed)
    (finding,) = compare(model, as_exported(campaign, factor, order))
    assert finding.is_certain
    assert f"set {keys}" in finding.sentence  # first, if several are likely


@pytest.mark.parametrize(("unit", "axis"), [("rad/s", 2 * np.pi), ("kHz", 1e-3)])
@pytest.mark.parametrize("seed", [0, 1])
def test_another_frequency_unit_is_named(random_case, seed, unit, axis):
    model, campaign = random_case(seed)
    (finding,) = compare(model, as_exported(campaign, axis=axis))
    assert f'set frequency_unit = "{unit}" in' in finding.sentence


@pytest.fixture(scope="session")
def scaled_case(random_case, tmp_path_factory):
    """Return a function: a random machine's test, and its model with scaled masses."""
    folder = tmp_path_factory.mktemp("scaled")

    def build(seed, *, mass):
        _, campaign = random_case(seed)
        tree = draw_drawing(draw_tree(seed, 3 + seed % 3), seed)
        text = model_xml(tree)
        for key in ("mass", "diaginertia", "fullinertia"):
            text = re.sub(rf'\b{key}="([^"]*)"', partial(_scale, key, mass), text)
        path = folder / f"{seed}_{mass:g}.xml"
        path.write_text(text, encoding="utf-8")
        machine = load_machine(path)
        return Model(machine, (*spring_parts(machine), *body_parts(machine))), campaign

    return build


def _scale(key, factor, match):
    numbers = " ".join(f"{factor * float(number):.12g}" for number in match[1].split())
    return f'{key}="{numbers}"'


@pytest.mark.parametrize("seed", [0, 1])
def test_masses_in_grams_are_named(scaled_case, seed):
    # A unit 1000 times larger has the same level above the modes, and may be named too.
    model, campaign = scaled_case(seed, mass=1e3)
    (finding,) = compare(model, campaign)
    assert finding.is_certain
    assert "divide masses and inertias of the model by 1000" in finding.sentence


@pytest.mark.parametrize("reference", [1.0, 1e-6])
@pytest.mark.parametrize("seed", [0, 6])
def test_decibels_with_a_phase_are_named_as_such(random_case, seed, reference):
    model, campaign = random_case(seed)

    def convert(test):
        values = test.estimate.frf.values
        decibels = 20 * np.log10(np.abs(values) / reference) * np.exp(1j * np.angle(values))
        frf = replace(test.estimate.frf, values=decibels)
        variance = np.full(values.shape, 1e-6)
        return replace(test, estimate=replace(test.estimate, frf=frf, variance=variance))

    read = replace(campaign, tests=tuple(convert(test) for test in campaign.tests))
    (finding,) = compare(model, read)
    assert finding.is_certain
    assert "decibels were read as linear values: export linear complex FRFs" in finding.sentence


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("seed", [0, 3])
def test_a_factor_of_two_is_a_remark(random_case, seed, factor):
    model, campaign = random_case(seed)
    (finding,) = compare(model, as_exported(campaign, factor))
    assert not finding.is_certain
    assert finding.factor == pytest.approx(factor, rel=0.25)


def test_a_rare_frequency_unit_is_named_only_where_nothing_else_explains_the_file():
    agreement = _CurveAgreement(0.2, 0.9, 0.0, 2.0)
    faults = {fault.remedy: fault for fault in list_faults(StatedExport("accelerance"))}
    unit, rare = faults['unit = "g/N"'], faults['frequency_unit = "rpm"']
    better = replace(agreement, loss=0.1)
    rows = _closest_faults([(unit, agreement), (rare, better)])
    assert [fault for fault, _ in rows] == [unit]
    assert [fault for fault, _ in _closest_faults([(rare, better)])] == [rare]


def test_a_factor_that_is_remarked_in_any_case_names_the_unit_that_explains_it():
    # Values in g read as m/s^2: a shift of the curves takes the loss just below that of a refusal.
    session = open_session(asset_path("two_bodies"))
    in_g = as_exported(session.campaign, 1 / 9.80665)
    stated = StatedExport("accelerance", "m/s^2/N")
    (finding,) = compare_with_model(session.model, in_g, {"impact_200N.uff": stated})
    assert not finding.is_certain
    assert 'set unit = "g/N"' in finding.sentence


def test_an_unexplained_factor_is_a_remark(random_case):
    model, campaign = random_case(1)
    (finding,) = compare(model, as_exported(campaign, 3.0))
    assert not finding.is_certain
    assert "check unit and quantity" in finding.sentence


@pytest.fixture
def folder(tmp_path):
    """Return a function that rewrites the FRFs of a campaign folder, and states keys."""

    def build(change, stated=""):
        place = write_folder(tmp_path / "pair")
        content = loadmat(place / "impact.mat")
        frfs, freqs = change(content["FRFs"], content["freqs"].ravel())
        arrays = {"FRFs": frfs, "freqs": freqs, "COHs": content["COHs"]}
        savemat(place / "impact.mat", arrays)
        toml = place / "campaign.toml"
        toml.write_text(toml.read_text("utf-8") + stated, "utf-8")
        return place

    return build


FAULTS = {
    'unit = "g/N"': lambda frfs, freqs: (frfs / 9.80665, freqs),
    'frequency_unit = "rad/s"': lambda frfs, freqs: (frfs, 2 * np.pi * freqs),
    'quantity = "receptance"': lambda frfs, freqs: (frfs / -((2 * np.pi * freqs) ** 2), freqs),
}


@pytest.mark.parametrize("key", FAULTS)
def test_a_campaign_is_refused_before_any_fit_and_the_key_mends_it(folder, key):
    with pytest.raises(InputError, match=r"campaign\.toml: impact\.mat: measured FRFs") as caught:
        open_session(folder(FAULTS[key]))
    assert f"set {key} in its [[test]]" in str(caught.value)
    mended = open_session(folder(FAULTS[key], f"{key}\n"))
    right = open_session(folder(lambda *arrays: arrays))
    assert not any("measured FRFs" in remark for remark in mended.campaign.remarks)
    np.testing.assert_allclose(mended.campaign.freq_hz, right.campaign.freq_hz, rtol=1e-12)


@pytest.mark.parametrize("key", FAULTS)
def test_a_file_that_is_as_stated_is_questioned_but_not_refused(folder, key):
    session = open_session(folder(FAULTS[key], "as_stated = true\n"))
    assert any(f"set {key} in its [[test]]" in remark for remark in session.campaign.remarks)


@pytest.mark.parametrize("seed", range(3))
def test_less_than_an_octave_holds_too_little_for_a_refusal_by_one_unit(random_case, seed):
    model, campaign = random_case(seed)
    narrow = as_exported(campaign, 4.44822).select_lines(slice(60, 100))  # 62..101 Hz
    assert not any(finding.is_certain for finding in compare(model, narrow))
    (finding,) = compare(model, as_exported(campaign, 1e3).select_lines(slice(60, 100)))
    assert finding.is_certain


def test_lines_beyond_any_frequency_in_another_unit_are_no_error(random_case):
    model, campaign = random_case(3)
    assert compare(model, as_exported(campaign, axis=1e3)) != []  # 242 kHz, or 242 MHz if in kHz


def test_units_of_a_quantity_tell_the_quantity(folder):
    receptance = FAULTS['quantity = "receptance"']
    session = open_session(folder(receptance, 'unit = "m/N"\n'))
    assert session.campaign.tests[0].estimate.frf.quantity == "receptance"
    assert parse_frf_units("a.mat", "receptance", "um/lbf").scalar == pytest.approx(
        1e-6 / 4.4482216
    )
