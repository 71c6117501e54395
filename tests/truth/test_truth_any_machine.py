"""Any MJCF, read through MuJoCo: against mbmodel, and against MuJoCo with other values."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from any_machines import GANTRY, SERVO_AXIS

from identification.words import Dof
from mbmodel import FrfRequest, as_drawn, linearise, load_machine
from truth import Cause, Plan, Protocol, TruthError, Wanted, draw_campaign, read_station
from truth.campaign.case_design import fit_to_machine, natural_frequencies
from truth.campaign.draw import NO_TOLERANCE, draw_as_drawn, draw_hammers
from truth.machine.couplings import coupled_matrices, gravity_stiffness
from truth.machine.mujoco_forces import force_slopes
from truth.machine.mujoco_reader import read_machine
from truth.machine.rig import Prepared, accelerance, build
from truth.machine.settling import settle

ASSETS = Path(__file__).resolve().parents[2] / "assets"


@pytest.fixture(params=["gantry", "servo", "legs", "plain"])
def machine(request, tmp_path):
    """A file of each kind; the last is one that is also read without MuJoCo."""
    if request.param == "legs":
        return ASSETS / "microstation" / "station_legs.xml"
    if request.param == "plain":
        return ASSETS / "two_bodies.xml"
    path = tmp_path / "machine.xml"
    path.write_text(GANTRY if request.param == "gantry" else SERVO_AXIS)
    return path


def written(tmp_path, text):
    path = tmp_path / "machine.xml"
    path.write_text(text)
    return path


def frfs(station, freq):
    hammers = draw_hammers(station, station.first_aim(), NO_TOLERANCE, 1)
    return accelerance(build(Prepared(station, hammers)), freq)


def frfs_by_mbmodel(path, station, freq):
    node = station.first_aim()
    hits = [hit.node for stage in station.stages for hit in stage.hit_points]
    site = f"hit{node}" if node in hits else station.site(node)
    model = as_drawn(load_machine(path))
    outputs = (Dof.of(one.site, axis) for _, one in station.sensors() for axis in range(3))
    inputs = tuple(Dof.of(site, axis) for axis in range(3))
    return linearise(model, model.drawn, FrfRequest(freq, tuple(outputs), inputs)).values


def test_frfs_are_those_of_mbmodel_to_eight_digits(machine):
    station = read_machine(machine)
    freq = np.linspace(0, natural_frequencies(station)[-1] * 1.2, 60)
    theirs = frfs_by_mbmodel(machine, station, freq)
    size = np.maximum(np.abs(theirs).max(axis=0), 1e-6 * np.abs(theirs).max())
    for ours in (frfs(station, freq), frfs(settle(station), freq)):
        assert (np.abs(ours - theirs) / size).max() < 1e-8


def test_other_springs_and_masses_settle_where_mbmodel_finds_them(tmp_path):
    """The pendulum's weight is heavier and every spring softer: in the file, and in the station."""
    path = written(tmp_path, GANTRY)
    station = read_machine(path)
    softer = station.vary_joints(lambda joint: replace(joint, stiffness=0.8 * joint.stiffness))
    stages = [*softer.stages]
    last = stages[-1]
    stages[-1] = replace(last, mass=3 * last.mass, inertia=3 * last.inertia)
    ours = settle(replace(softer, stages=tuple(stages)))
    text = GANTRY.replace('stiffness="4e6"', 'stiffness="3.2e6"').replace("2e5", "1.6e5")
    text = text.replace('"3e5"', '"2.4e5"').replace('"1e6"', '"8e5"').replace('"5e4"', '"4e4"')
    text = text.replace('name="carriage_rz" type="hinge" axis="0 0 1" stiffness="4e4"', "@")
    text = text.replace("@", 'name="carriage_rz" type="hinge" axis="0 0 1" stiffness="3.2e4"')
    text = text.replace('size="0.03" fromto', 'density="8100" size="0.03" fromto')
    other = written(tmp_path, text)
    freq = np.linspace(0, 120, 50)
    theirs = frfs_by_mbmodel(other, ours, freq)
    size = np.maximum(np.abs(theirs).max(axis=0), 1e-6 * np.abs(theirs).max())
    assert (np.abs(frfs(ours, freq) - theirs) / size).max() < 1e-8


def test_the_stiffness_of_weights_is_that_of_the_forces_of_mujoco(tmp_path):
    station = read_machine(written(tmp_path, GANTRY))
    model, data = station.source.model, station.source.data
    names = [joint.name for stage in station.stages for joint in stage.joints]
    springs = np.diag([j.stiffness for stage in station.stages for j in stage.joints])
    weights = force_slopes(model, data, "position") - springs
    exact = gravity_stiffness(station)
    assert np.abs(exact).max() > 5
    assert len(names) == len(exact)
    np.testing.assert_allclose(weights, exact, atol=2e-6)


def test_tendons_and_servos_are_in_the_machine(tmp_path):
    station = read_machine(written(tmp_path, SERVO_AXIS))
    assert [tendon.name for tendon in station.tendons] == ["hose", "coupling"]
    assert station.remaining is not None
    drive = station.remaining.joints.index("drive")
    assert station.remaining.mass[drive, drive] == pytest.approx(6)
    assert station.remaining.damping[drive, drive] == pytest.approx(1500)
    without = replace(station, tendons=(), remaining=None, gravity=np.zeros(3))
    assert not coupled_matrices(without).stiffness.any()
    assert coupled_matrices(station).stiffness.any()


def test_the_true_machine_varies_about_a_drawing_that_stays(tmp_path):
    path = written(tmp_path, SERVO_AXIS)
    station = read_station(path)
    plan = Plan(5, Cause(), fit_to_machine(Protocol((6,)), station))
    campaign = draw_campaign(station, plan)
    assert campaign.files["model/machine.xml"] == path.read_bytes()
    assert b'model = "model/machine.xml"' in campaign.files["campaign.toml"]
    true = draw_as_drawn(station, 5)
    factors = [
        new.stiffness / old.stiffness
        for new, old in zip(true.tendons, station.tendons, strict=True)
    ]
    assert np.ptp(factors) > 0.01


@pytest.mark.parametrize(
    ("text", "effect", "place"),
    [
        (GANTRY, "mass_error", "body:bridge"),
        (GANTRY, "missing_dof", "joint:bridge"),
        (GANTRY, "hammer_misalignment", "hammer:hit9"),
        (GANTRY, "sensor_misalignment", "sensor:acc1"),
        (SERVO_AXIS, "friction", "joint:frame"),
    ],
)
def test_effects_are_sized_in_any_machine(tmp_path, text, effect, place):
    station = read_station(written(tmp_path, text))
    protocol = fit_to_machine(
        Protocol((station.first_aim(),), lines=161, resolution_hz=1.0), station
    )
    drawn = draw_campaign(station, Plan(8, Cause((Wanted(effect, place, 4.0),)), protocol))
    answer = drawn.answer.decode()
    assert f'effect = "{effect}"' in answer
    ratio = float(answer.split("ratio = ")[1].split()[0])
    assert 2 < ratio < 8


def test_the_band_follows_the_modes_and_the_level_the_mass(tmp_path):
    usual = Protocol((6,))
    small = read_station(written(tmp_path, SERVO_AXIS))
    fitted = fit_to_machine(usual, small)
    modes = natural_frequencies(small)
    assert fitted.freq_hz[-1] == pytest.approx(1.2 * modes[-1], rel=0.05)
    assert fitted.levels[0] == pytest.approx(200 * 145 / 3735, rel=0.05)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('damping="0.02"', 'damping="0.02" frictionloss="1"', "frictionloss"),
        ('class="stiff" axis="0 0 1"', 'class="stiff" axis="0 0 1" stiffness="0"', "equilibrium"),
        ("</worldbody>", "</worldbody><nonsense/>", "MuJoCo refuses"),
    ],
)
def test_what_has_no_linear_model_is_refused_by_name(tmp_path, old, new, reason):
    assert old in GANTRY
    with pytest.raises(TruthError, match=reason):
        read_station(written(tmp_path, GANTRY.replace(old, new)))
