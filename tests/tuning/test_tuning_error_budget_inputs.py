"""Spectra, controllers and budget.toml: units, criteria, and what is refused."""

import control
import numpy as np
import pytest
import scipy.io
from budget_case import BUDGET, TWO, VALUES

from identification.readers.controller import controller_from_roots, read_controller
from identification.words import InputError, UsageError
from mbmodel import as_drawn, load_machine
from tuning.control_loops.read_loops import controller_from_system
from tuning.plant.error_budget.read_definition import read_definition
from tuning.plant.error_budget.spectra import (
    VIBRATION_CRITERIA_M_PER_S,
    read_spectrum,
    vibration_criterion,
)
from tuning.plant.error_budget.spectral_units import parse_density_unit, parse_signal_unit

WHOLE = BUDGET.format(gain=3e5, delay=0.0, lines="")


@pytest.mark.parametrize("name", VIBRATION_CRITERIA_M_PER_S)
def test_a_criterion_has_its_rms_velocity_in_each_third_octave_band(name):
    spectrum, velocity = vibration_criterion(name), VIBRATION_CRITERIA_M_PER_S[name]
    lowest = 8.0 * 2 ** (1 / 3) if name in ("VC-A", "VC-B") else 1.0
    for centre in np.geomspace(lowest, 80.0, 7):
        freq = np.geomspace(centre / 2 ** (1 / 6), centre * 2 ** (1 / 6), 400) * (1 + 1e-12)
        freq[-1] *= 1 - 1e-9
        rms = np.sqrt(np.trapezoid(spectrum.at(freq, 1), freq))
        assert rms == pytest.approx(velocity, rel=1e-4)


def test_criterion_a_is_an_acceleration_of_260_millionths_of_g_below_8_hz():
    freq = np.linspace(4.5 / 2 ** (1 / 6), 4.5 * 2 ** (1 / 6), 400)
    acceleration = np.sqrt(np.trapezoid(vibration_criterion("VC-A").at(freq, 2), freq))
    assert acceleration == pytest.approx(260e-6 * 9.80665, rel=1e-4)


@pytest.mark.parametrize(
    ("text", "kind", "derivative", "si_density"),
    [
        ("(m/s^2)^2/Hz", "length", 2, 1.0),
        ("m^2/s^4/Hz", "length", 2, 1.0),
        ("m²/s²/Hz", "length", 1, 1.0),
        ("g^2/Hz", "length", 2, 9.80665**2),
        ("ug/sqrt(Hz)", "length", 2, (9.80665e-6) ** 2),
        ("nm/√Hz", "length", 0, 1e-18),
        ("(mm/s)^2/Hz", "length", 1, 1e-6),
        ("nrad/rtHz", "angle", 0, 1e-18),
        ("(N m)^2/Hz", "torque", 0, 1.0),
        ("mN^2/Hz", "force", 0, 1e-6),
        ("1/sqrt(Hz)", "control", 0, 1.0),
    ],
)
def test_units_of_densities(text, kind, derivative, si_density):
    unit = parse_density_unit(text)
    assert (unit.signal.kind, unit.signal.derivative) == (kind, derivative)
    assert unit.signal.factor**2 == pytest.approx(si_density)
    assert unit.is_root == ("sq" in text or "√" in text or "rt" in text)


@pytest.mark.parametrize("text", ["m/s^2", "Hz", "furlong^2/Hz", "", "m^2", "dB"])
def test_what_is_no_unit_of_a_density_is_refused(text):
    with pytest.raises(ValueError, match="is no unit of a spectral density"):
        parse_density_unit(text)
    assert parse_signal_unit("um").factor == pytest.approx(1e-6)


def table(tmp_path, text):
    file = tmp_path / "floor.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_root_density_and_a_two_sided_one_become_a_one_sided_power_density(tmp_path):
    file = table(tmp_path, "f,x [nm/sqrt(Hz)],z [nm^2/Hz]\n1,3,9\n10,3,9\n")
    root, _ = read_spectrum(file, "x", None)
    power, _ = read_spectrum(file, "z", None, is_two_sided=True)
    freq = np.array([2.0, 9.0])
    assert root.at(freq, 0) == pytest.approx(9e-18)
    assert power.at(freq, 0) == pytest.approx(18e-18)
    # The acceleration's density is (2 pi f)^4 times that of the displacement.
    assert root.at(freq, 2) == pytest.approx(9e-18 * (2 * np.pi * freq) ** 4)
    assert root.at(np.array([0.5, 11.0]), 0) == pytest.approx([0.0, 0.0])


def test_between_lines_a_density_is_a_power_of_frequency(tmp_path):
    file = table(tmp_path, "# a comment\n1\t100\n100\t0.01\n")
    spectrum, _ = read_spectrum(file, None, "N^2/Hz")
    assert spectrum.at(np.array([10.0]), 0) == pytest.approx([1.0])


@pytest.mark.parametrize(
    ("heading", "factor"),
    [("f", 1.0), ("f [Hz]", 1.0), ("w [rad/s]", 1 / (2 * np.pi)), ("f (kHz)", 1e3)],
)
def test_the_heading_states_the_unit_of_frequency(tmp_path, heading, factor):
    spectrum, _ = read_spectrum(table(tmp_path, f"{heading},x [N^2/Hz]\n1,2\n500,3\n"), None, None)
    assert spectrum.band == pytest.approx((factor, 500 * factor))
    # A density per Hz stays one.
    assert spectrum.at(np.array([500 * factor]), 0) == pytest.approx([3.0])


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("f,x\n1,2\n2,3\n", None, "the unit of the density is missing"),
        ("f,x\n1,-2\n2,3\n", "N^2/Hz", "negative"),
        ("f,x\n2,2\n1,3\n", "N^2/Hz", "must increase"),
        ("f,x\n1,2\n", "N^2/Hz", "two at least"),
        ("f,x\n1,a\n2,3\n", "N^2/Hz", "row 1 of the numbers"),
        ("f,x\n1,2\n2,nan\n", "N^2/Hz", "not finite"),
        ("f,x\n1,2\n2,3\n", "kg^2/Hz", "is no unit"),
        ("T [s],x\n1,2\n2,3\n", "N^2/Hz", r"heading 'T \[s\]' states no unit of frequency"),
    ],
)
def test_a_table_that_is_no_density_is_refused(tmp_path, text, unit, words):
    with pytest.raises(InputError, match=words):
        read_spectrum(table(tmp_path, text), None, unit)


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    file = tmp_path_factory.mktemp("two") / "two.xml"
    file.write_text(TWO.format(**VALUES), encoding="utf-8")
    return as_drawn(load_machine(file)).machine


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('output = "acc2:+tx"', 'output = "acc9:+tx"', "acc9"),
        ('input = "drive"', 'input = "motor"', "motor"),
        ("csv = ", "cvs = ", "unknown key disturbance.floor.cvs"),
        ('unit = "1^2/Hz"', "", r"unit is missing: state it, such as 1/sqrt"),
        ('"1^2/Hz"', '"m^2/Hz"', "a motor takes units of its control"),
        ('"1^2/Hz"', '"A^2/Hz"', "a motor takes units of its control"),
        ('"1^2/Hz"', '"(N m)^2/Hz"', "drive acts at head_tx in N: write N/"),
        ('"m/sqrt(Hz)"', '"N/sqrt(Hz)"', "no unit of an input that takes m:"),
        ("density = 0.3", 'vc = "VC-C"', "vibration criterion is a velocity"),
        ('loop = "axis"', 'loop = "axes"', "which the file lacks: choose one of axis"),
        ("[-0.5, -700.0]", "[-0.5, [-700.0, 9.0]]", "without its conjugate"),
        ("[-0.5, -700.0]", "[-0.5]", "add the poles that limit its bandwidth"),
        ('["floor", "ripple"]', '["floor", "rain"]', "names 'rain', which is no source"),
        ("coherence = 0.6", "coherence = 1.6", "less than or equal to 1"),
        ("band = [2.0, 45.0]", "band = [45.0, 2.0]", "lower first"),
        ("band = [2.0, 45.0]", "", "constant density without limits"),
        ('minus = "acc1:+tx"', 'minus = "acc1:+rx"', "name two outputs of one unit"),
        ('unit = "um"', 'unit = "N"', "is no unit of this error"),
        ('csv = "floor.csv"', 'csv = "absent.csv"', "absent.csv"),
        ("delay = 0.0", "delay = 0.0\nsign = -1", "unknown key loop.axis.sign"),
    ],
)
def test_a_budget_that_cannot_be_used_is_refused_in_one_sentence(
    tmp_path, machine, old, new, words
):
    table(tmp_path, "f,x [(m/s^2)^2/Hz]\n1,2\n60,3\n")
    file = tmp_path / "budget.toml"
    assert old in WHOLE
    file.write_text(WHOLE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match="[^\n]*" + words) as caught:
        read_definition(file, machine)
    assert "\n" not in str(caught.value)


def test_a_force_at_a_motor_is_divided_by_its_gear(tmp_path, machine):
    table(tmp_path, "f,x [(m/s^2)^2/Hz]\n1,2\n60,3\n")
    sources = {}
    for name, gear in (("1", 1.0), ("N", 2.0), ("mN", 2e3)):  # the gear of the drive is 2
        text = WHOLE.replace('"1^2/Hz"', f'"{name}^2/Hz"')
        (tmp_path / "budget.toml").write_text(text, encoding="utf-8")
        source = read_definition(tmp_path / "budget.toml", machine).sources[1]
        ((port, factor),) = source.inputs
        assert str(port) == "drive"
        sources[name] = factor * np.sqrt(source.spectrum.density)
        np.testing.assert_allclose(sources[name], np.sqrt(0.3) / gear, rtol=1e-9)
        assert source.unit == ("control" if name == "1" else "N")


def test_coherences_that_no_three_signals_have_are_refused(tmp_path, machine):
    table(tmp_path, "f,x [(m/s^2)^2/Hz]\n1,2\n60,3\n")
    rows = "\n".join(
        f'[[correlation]]\nbetween = ["{a}", "encoder"]\ncoherence = {value}'
        for a, value in (("floor", 1.0), ("ripple", 0.0))
    )
    text = WHOLE.replace("coherence = 0.6", "coherence = 0.9") + rows
    (tmp_path / "budget.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="no signals have these coherences"):
        read_definition(tmp_path / "budget.toml", machine)


def test_controllers_of_all_forms_have_the_same_response(tmp_path):
    system = control.zpk([-60.0, -8.0], [-0.5, -700.0], 3e5)
    state = control.ss(system)
    files = {
        "ss.mat": {"A": state.A, "B": state.B, "C": state.C, "D": state.D},
        "tf.mat": {"num": system.num[0][0], "den": system.den[0][0]},
        "zpk.mat": {"zeros": [-60.0, -8.0], "poles": [-0.5, -700.0], "gain": 3e5},
    }
    s = 2j * np.pi * np.array([0.3, 4.0, 150.0])
    expected = 3e5 * (s + 60) * (s + 8) / ((s + 0.5) * (s + 700))
    assert controller_from_system(system).response(s) == pytest.approx(expected)
    assert controller_from_system(2.5).response(s) == pytest.approx(2.5)
    for name, arrays in files.items():
        scipy.io.savemat(tmp_path / name, arrays)
        assert read_controller(tmp_path / name).response(s) == pytest.approx(expected)


def test_a_controller_of_many_roots_over_five_decades_keeps_its_digits():
    rng = np.random.default_rng(4)
    sizes = np.geomspace(0.1, 1e4, 8)
    pairs = -sizes * rng.uniform(0.02, 0.9, 8) + 1j * sizes
    zeros = np.concatenate([1.3 * pairs, 1.3 * pairs.conj()])
    poles = np.concatenate([pairs, pairs.conj(), [-3.0]])
    s = 2j * np.pi * np.geomspace(0.01, 3e3, 50)
    expected = 7.0 * np.prod(s[:, None] - zeros, axis=1) / np.prod(s[:, None] - poles, axis=1)
    found = controller_from_roots(zeros.tolist(), poles.tolist(), 7.0).response(s)
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_spectrum_that_ends_within_the_band_is_remarked(tmp_path, machine):
    table(tmp_path, "f,x [(m/s^2)^2/Hz]\n1,2\n30,3\n")
    (tmp_path / "budget.toml").write_text(WHOLE, encoding="utf-8")
    (remark,) = read_definition(tmp_path / "budget.toml", machine).remarks
    assert remark.startswith("The spectrum of floor covers 1 to 30 Hz of the band from 2 to 45 Hz")


def test_sampled_controllers_are_read_with_their_period(tmp_path):
    s, period = 2j * np.pi * np.array([0.3, 20.0, 240.0, 1000.0]), 1e-3
    z = np.exp(s * period)
    held = -np.expm1(-s * period) / (s * period)
    expected = 5.0 * (z - 0.9) / ((z - 0.5) * (z - 0.999)) * held
    law = control.zpk([0.9], [0.5, 0.999], 5.0, dt=period)
    matrices = control.ss(law)
    numerator, denominator = 5.0 * np.poly([0.9]), np.poly([0.5, 0.999])
    for name, arrays in (
        ("abcd", {"A": matrices.A, "B": matrices.B, "C": matrices.C, "D": matrices.D}),
        ("fraction", {"num": numerator, "den": denominator}),
        ("roots", {"zeros": [0.9], "poles": [0.5, 0.999], "gain": 5.0}),
    ):
        scipy.io.savemat(tmp_path / f"{name}.mat", {**arrays, "Ts": period})
        read = read_controller(tmp_path / f"{name}.mat")
        assert read.period_s == period
        assert read.response(s[:3]) == pytest.approx(expected[:3], rel=1e-9)
    for system in (law, control.tf(law), matrices):
        read = controller_from_system(system)
        assert read.response(s[:3]) == pytest.approx(expected[:3], rel=1e-9)
    # the integrator's part at the sampling rate: its pole and the zero of the hold cancel there
    integrator = controller_from_system(control.tf([1], [1, -1], period))
    limit = 1 / (2j * np.pi)  # h(s) / (z - 1) = 1 / (s T z) at s T = 2 pi i
    assert integrator.response(s[3:]) == pytest.approx(limit, rel=1e-6)


def test_controllers_that_are_discrete_without_a_period_or_wide_are_refused(tmp_path):
    with pytest.raises(UsageError, match="discrete with the step True: give its sampling period"):
        controller_from_system(control.tf([1], [1, 0.5], True))
    with pytest.raises(UsageError, match="2 x 2 channels"):
        controller_from_system(control.ss([], [], [], np.eye(2)))
    for step in (-1.0, 20.0):
        scipy.io.savemat(tmp_path / "x.mat", {"num": 1.0, "den": 1.0, "Ts": step})
        with pytest.raises(InputError, match=rf"Ts = {step:g} s is no sampling period"):
            read_controller(tmp_path / "x.mat")
    with pytest.raises(ValueError, match="2 zeros and 1 poles: add poles at 0 for its delay"):
        controller_from_roots([0.1, 0.2], [0.3], 1.0, 1e-3)
    scipy.io.savemat(tmp_path / "y.mat", {"K": 1.0})
    with pytest.raises(InputError, match="holds no controller"):
        read_controller(tmp_path / "y.mat")


@pytest.mark.parametrize("key", ["InputDelay", "input_delay", "OutputDelay", "IODelay", "ioDelay"])
def test_a_controller_with_a_delay_beside_its_matrices_is_refused(tmp_path, key):
    transfer = {"num": [1.0], "den": [1.0, 2.0]}
    scipy.io.savemat(tmp_path / "zero.mat", {**transfer, key: 0.0})
    assert read_controller(tmp_path / "zero.mat").response(np.zeros(1)) == pytest.approx(0.5)
    scipy.io.savemat(tmp_path / "late.mat", {**transfer, key: 3e-4})
    words = f"{key} is not zero, but .* state delay .s. of the loop, or put Pade's fraction"
    with pytest.raises(InputError, match=words):
        read_controller(tmp_path / "late.mat")
    system = control.tf([1.0], [1.0, 2.0])
    setattr(system, key, 3e-4)
    with pytest.raises(UsageError, match=words):
        controller_from_system(system)


def test_a_controller_keeps_the_poles_that_its_zeros_cancel():
    numerator, denominator = np.polymul([8e5, 16e6], [1, -5.0]), np.polymul([1, 600.0], [1, -5.0])
    controller = controller_from_system(control.tf(numerator, denominator))
    assert np.sort(controller.poles.real) == pytest.approx([-600.0, 5.0])
    s = 2j * np.pi * np.array([0.3, 20.0])
    assert controller.response(s) == pytest.approx(8e5 * (s + 20) / (s + 600))
