"""FRFs against closed forms: one and two bodies, windows, free bodies, labels."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
from mbmodel_examples import (
    mass_on_spring,
    mjcf,
    random_request,
    random_tree,
    some_dofs,
    worst_of_channels,
)

from identification.words import Dof, Frf, UsageError
from mbmodel import Evaluator, FrfRequest, Model, as_drawn, linearise

SPRINGS = {"tx": 3e6, "ty": 5e6, "tz": 7e6, "rx": 2e5, "ry": 3e5, "rz": 4e5}
FREQ = np.linspace(0.0, 120.0, 61)


def six_joints(stage, scale=1.0):
    return "".join(
        f'<joint name="{stage}_{name}" type="{"slide" if name[0] == "t" else "hinge"}" '
        f'axis="{" ".join(str(int(a == name[1])) for a in "xyz")}" stiffness="{scale * k:.17g}" '
        f'damping="{scale * k * 2e-4:.17g}"/>'
        for name, k in SPRINGS.items()
    )


ONE_BODY = mjcf(
    '<body name="table" pos="0.1 0.2 0.3"><inertial pos="0 0 0" mass="120" diaginertia="3 4 5"/>'
    + six_joints("table")
    + '<site name="acc1" pos="0.5 0 0"/><site name="acc3"/></body>'
)


def impedance(direction, freq):
    """k + i w c - w^2 m of one direction of ONE_BODY, at its centre of mass."""
    m = {"tx": 120, "ty": 120, "tz": 120, "rx": 3, "ry": 4, "rz": 5}[direction]
    w = 2 * np.pi * freq
    return SPRINGS[direction] * (1 + 2e-4j * w) - m * w**2


def answer(model, outputs, inputs, quantity="receptance", freq=FREQ, **changed):
    labels = [tuple(map(Dof.parse, side)) for side in (outputs, inputs)]
    return linearise(model, model.drawn, FrfRequest(freq, *labels, quantity, **changed)).frf()


@pytest.mark.parametrize("direction", SPRINGS)
def test_each_direction_of_one_body_is_one_resonance(from_text, direction):
    dof = f"table:+{direction}"
    H = answer(as_drawn(from_text(ONE_BODY)), [dof], [dof]).values[:, 0, 0]
    # Rotations of 5e5 N m and shifts of 7e6 N/m do not mix: rounding of the six eigenvectors.
    np.testing.assert_allclose(H, 1 / impedance(direction, FREQ), rtol=1e-12)


def test_directions_through_the_centre_of_mass_do_not_mix(from_text):
    dofs = [f"table:+{direction}" for direction in SPRINGS]
    H = answer(as_drawn(from_text(ONE_BODY)), dofs, dofs).values
    diagonal = np.abs(np.einsum("fii->fi", H)).max()
    assert np.abs(H * (1 - np.eye(6))).max() < 1e-15 * diagonal


def test_a_point_off_the_centre_also_feels_the_rotation(from_text):
    # At 0.5 m along x, hit in y: y/f = 1/Zy + 0.25/Zrz, and about z 0.5/Zrz.
    H = answer(as_drawn(from_text(ONE_BODY)), ["acc1:+ty", "acc1:-rz"], ["acc1:+ty"]).values
    turn = 1 / impedance("rz", FREQ)
    expected = np.stack([1 / impedance("ty", FREQ) + 0.25 * turn, -0.5 * turn], axis=-1)
    np.testing.assert_allclose(H[:, :, 0], expected, rtol=1e-11)


def test_at_resonance_the_motion_lags_by_a_quarter_turn(from_text):
    # One mass at w0: H = -i / (2 zeta k) with 2 zeta k = c w0. The sign fixes the time convention.
    mass, k, c = 4.0, 3e4, 11.0
    w0 = np.sqrt(k / mass)
    model = as_drawn(from_text(mjcf(mass_on_spring(mass, k, c))))
    zeta = c / (2 * np.sqrt(k * mass))
    H = answer(model, ["acc1:+tz"], ["acc1:+tz"], freq=np.array([w0 / (2 * np.pi)])).values
    # k - m w0^2 is rounding: 1e-16 k beside c w0 = 3e-2 k.
    np.testing.assert_allclose(H[0, 0, 0], -1j / (2 * zeta * k), rtol=1e-13)


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_two_masses_in_a_row_follow_the_closed_form(from_text, quantity):
    # q1 of the lower mass, q2 of the upper against the lower: x1 = q1, x2 = q1 + q2. In x:
    # Z = [[z1 + k2', -k2'], [-k2', k2' - m2 w^2]], inverted by Cramer's rule.
    m1, k1, c1, m2, k2, c2 = 7.0, 4e5, 60.0, 3.0, 9e4, 15.0
    upper = mass_on_spring(m2, k2, c2, name="b", node=2)
    lower = mass_on_spring(m1, k1, c1, name="a").replace("</body>", upper + "</body>")
    model = as_drawn(from_text(mjcf(lower)))
    w = 2 * np.pi * FREQ
    s1, s2 = k1 + 1j * w * c1, k2 + 1j * w * c2
    z11, z22 = s1 + s2 - m1 * w**2, s2 - m2 * w**2
    adjugate = np.array([[z22, s2], [s2, z11]])
    expected = (adjugate / (z11 * z22 - s2**2)).transpose(2, 0, 1)
    factor = (1j * w) ** {"receptance": 0, "mobility": 1, "accelerance": 2}[quantity]
    H = answer(model, ["acc1:+tz", "acc2:+tz"], ["acc1:+tz", "acc2:+tz"], quantity).values
    np.testing.assert_allclose(H, expected * factor[:, None, None], rtol=1e-11)


@pytest.mark.parametrize(("quantity", "power"), [("mobility", 1), ("accelerance", 2)])
def test_quantities_of_the_station_differ_by_powers_of_i_omega(station_model, quantity, power):
    freq = np.linspace(2, 200, 40)
    frf_request = random_request(station_model.machine, freq, quantity="receptance")
    receptance = linearise(station_model, station_model.drawn, frf_request).values
    values = linearise(
        station_model, station_model.drawn, replace(frf_request, quantity=quantity)
    ).values
    factor = (2j * np.pi * freq[:, None, None]) ** power
    # To rounding of each line's sum over modes, whose terms are far larger than some sums.
    peak = np.abs(values).max(axis=(1, 2), keepdims=True)
    assert (np.abs(values - receptance * factor) < 1e-12 * peak).all()


def windowed_transform(order, tau):
    """Transform of exp(-t/tau) times an impulse response and its derivatives, by quadrature.

    One mass m, pole -d + i b: h = exp(-d t) sin(b t) / (m b), h' and h'' in closed form; the
    acceleration also starts with the impulse itself, which transforms to 1/m.
    """
    mass, k, c = 4.0, 3e4, 11.0
    d = c / (2 * mass)
    b = np.sqrt(k / mass - d**2)
    t = np.linspace(0.0, 12.0, 240_001)
    pole = complex(-d, b)
    motion = (pole**order * np.exp(pole * t)).imag / (mass * b) * np.exp(-t / tau)
    freq = np.array([5.0, 12.0, 13.8, 15.0, 30.0])
    kernel = np.exp(-2j * np.pi * freq[:, None] * t)
    direct = 1 / mass if order == 2 else 0.0
    return freq, scipy.integrate.simpson(motion * kernel, x=t, axis=1) + direct


@pytest.mark.parametrize(
    ("quantity", "order"), [("receptance", 0), ("mobility", 1), ("accelerance", 2)]
)
def test_a_windowed_frf_is_the_transform_of_the_windowed_impulse_response(
    from_text, quantity, order
):
    tau = 0.8
    freq, expected = windowed_transform(order, tau)
    model = as_drawn(from_text(mjcf(mass_on_spring(4.0, 3e4, 11.0))))
    H = answer(model, ["acc1:+tz"], ["acc1:+tz"], quantity, freq, window_tau=tau).values[:, 0, 0]
    # Simpson with 1440 steps a period of the fastest line: (w dt)^4 / 180 = 5e-11.
    np.testing.assert_allclose(H, expected, rtol=1e-9)


def test_a_window_widens_a_resonance_by_1_over_tau_omega(from_text):
    # zeta + 1 / (tau w0), since s = i w + 1/tau moves every pole by 1/tau to the left.
    mass, k, c, tau = 4.0, 3e4, 11.0, 0.8
    model = as_drawn(from_text(mjcf(mass_on_spring(mass, k, c))))
    freq = np.linspace(5, 30, 11)
    windowed_frf = answer(model, ["acc1:+tz"], ["acc1:+tz"], freq=freq, window_tau=tau).values
    damped = as_drawn(
        from_text(mjcf(mass_on_spring(mass, k + c / tau + mass / tau**2, c + 2 * mass / tau)))
    )
    expected = answer(damped, ["acc1:+tz"], ["acc1:+tz"], freq=freq).values
    np.testing.assert_allclose(windowed_frf, expected, rtol=1e-13)


def test_a_free_solid_body_accelerates_by_its_mass_and_inertia(from_text):
    text = """<body name="a" quat="0.9 0.1 0.2 0.3"><freejoint/>
      <inertial pos="0.1 -0.2 0.3" mass="6" fullinertia="0.5 0.6 0.4 0.05 -0.02 0.03"/>
      <site name="acc1" pos="0.4 0.2 -0.1" quat="0.3 0.1 0.7 0.2"/>
      <site name="hit2" pos="-0.2 0.3 0.1" quat="0.5 0.6 -0.2 0.1"/></body>"""
    machine = from_text(mjcf(text))
    outputs, inputs = some_dofs(machine, 6, 1), some_dofs(machine, 3, 2)
    freq = np.array([0.5, 3.0, 40.0])
    H = linearise(as_drawn(machine), np.zeros(0), FrfRequest(freq, outputs, inputs)).values
    rows, columns = machine.layout.rows(outputs), machine.layout.rows(inputs).T
    expected = rows @ np.linalg.inv(machine.body_mass) @ columns
    np.testing.assert_allclose(H, np.broadcast_to(expected, H.shape), rtol=1e-12, atol=1e-14)


def free_pair(from_text):
    """Two masses with a spring between them and none to the ground; the first may slide freely."""
    upper = mass_on_spring(3.0, 9e4, 15.0, name="b", node=2)
    return as_drawn(
        from_text(mjcf(mass_on_spring(7.0, 0, 0, name="a").replace("</body>", upper + "</body>")))
    )


def test_a_free_pair_follows_the_closed_form(from_text):
    freq = np.array([0.01, 1.0, 30.0, 32.9, 80.0])
    s = 2j * np.pi * freq
    k = 9e4 + 15 * s
    # Both masses together, and the spring: determinant s^2 (m1 m2 s^2 + (m1 + m2) k).
    expected = k / (s**2 * (21 * s**2 + 10 * k))
    H = answer(free_pair(from_text), ["acc2:+tz"], ["acc1:+tz"], freq=freq).values[:, 0, 0]
    # At 0.01 Hz the spring's term is 1e6 times the rigid one; velocities keep the digits.
    np.testing.assert_allclose(H, expected, rtol=1e-11)


def test_a_free_pair_moves_as_one_mass_at_low_frequency(from_text):
    H = answer(
        *(free_pair(from_text), ["acc1:+tz", "acc2:+tz"], ["acc1:+tz"], "accelerance"),
        freq=np.array([1e-3]),
    ).values[0, :, 0]
    # (w / w0)^2 = 1e-9 below the resonance at 33 Hz.
    np.testing.assert_allclose(H, 0.1, rtol=1e-8)


@pytest.mark.parametrize("direct", [False, True])
def test_a_free_pair_at_0_hz_is_refused_with_the_remedy(from_text, direct):
    model = free_pair(from_text)
    dof = (Dof.parse("acc1:+tz"),)
    frf_request = FrfRequest(np.array([0.0, 1.0, 2.0]), dof, dof, "receptance")
    with pytest.raises(UsageError, match="start the band above it"):
        Evaluator(model, frf_request, direct=direct).at(model.drawn)


def test_a_window_gives_a_free_pair_a_value_at_0_hz(from_text):
    s = 1 / 0.5
    k = 9e4 + 15 * s
    expected = k / (s**2 * (21 * s**2 + 10 * k))
    H = answer(
        *(free_pair(from_text), ["acc2:+tz"], ["acc1:+tz"]),
        freq=np.array([0.0, 1.0]),
        window_tau=0.5,
    ).values[0, 0, 0]
    np.testing.assert_allclose(H, expected, rtol=1e-10)


def test_static_receptance_is_the_inverse_stiffness(station_model):
    machine = station_model.machine
    frf_request = random_request(machine, [0.0, 10.0], quantity="receptance")
    H = linearise(station_model, station_model.drawn, frf_request).values[0]
    rows = machine.layout.rows(frf_request.outputs) @ machine.jacobian
    columns = (machine.layout.rows(frf_request.inputs) @ machine.jacobian).T
    expected = rows @ np.linalg.inv(station_model.matrices(station_model.drawn).stiffness) @ columns
    assert np.abs(H - expected).max() < 1e-12 * np.abs(expected).max()
    assert not H.imag.any() or np.abs(H.imag).max() < 1e-12 * np.abs(H).max()


def test_accelerance_at_0_hz_is_zero(station_model):
    frf_request = random_request(station_model.machine, [0.0, 10.0])
    assert not linearise(station_model, station_model.drawn, frf_request).values[0].any()


def test_an_answer_carries_the_questions_labels(station_model):
    frf_request = random_request(station_model.machine, [1.0, 2.0, 5.0], quantity="mobility")
    frf = linearise(station_model, station_model.drawn, frf_request).frf()
    assert isinstance(frf, Frf)
    assert (frf.outputs, frf.inputs, frf.quantity) == (
        frf_request.outputs,
        frf_request.inputs,
        "mobility",
    )
    np.testing.assert_array_equal(frf.freq_hz, [1, 2, 5])


def test_asking_for_other_labels_is_selecting_among_the_answers(station_model):
    frf_request = random_request(station_model.machine, np.linspace(1, 200, 9), n_out=7, n_in=3)
    whole = linearise(station_model, station_model.drawn, frf_request).frf()
    outputs = [Dof.of(d.point, d.axis, -d.sign) for d in frf_request.outputs[4:1:-1]]
    inputs = frf_request.inputs[::-1]
    part = linearise(
        station_model,
        station_model.drawn,
        replace(frf_request, outputs=tuple(outputs), inputs=tuple(inputs)),
    ).frf()
    # The same sums in other blocks of the same products.
    assert worst_of_channels(whole.select(outputs, inputs).values, part.values) < 1e-13


def test_an_unknown_label_is_named(station_model):
    dof = (Dof.parse("acc99:+tx"),)
    with pytest.raises(UsageError, match="acc99"):
        Evaluator(station_model, FrfRequest(np.array([1.0]), dof, dof))


@pytest.mark.parametrize("length", [0, 71, 73])
def test_theta_of_another_length_is_refused(station_model, length):
    with pytest.raises(UsageError, match=rf"theta has shape \({length},\), expected \(72,\)"):
        station_model.matrices(np.ones(length))


def test_two_parameters_with_one_name_are_refused(station_model):
    parts = station_model.parts
    with pytest.raises(ValueError, match=r"with the same name: .*tilt_tx\.stiffness"):
        Model(station_model.machine, (*parts, parts[3]))


@pytest.mark.parametrize("seed", range(6))
def test_an_evaluator_answers_as_a_single_call(from_text, seed):
    model = as_drawn(from_text(random_tree(seed)))
    frf_request = random_request(model.machine, np.linspace(1, 300, 20))
    once = linearise(model, model.drawn * 1.2, frf_request).values
    evaluator = Evaluator(model, frf_request)
    evaluator.at(model.drawn)
    np.testing.assert_array_equal(evaluator.at(model.drawn * 1.2).values, once)


def test_a_model_without_parts_is_the_bare_machine(from_text):
    servo = '<actuator><position joint="a_j" kp="2e3"/></actuator>'
    machine = from_text(mjcf(mass_on_spring(4, 0, 0)).replace("</mujoco>", servo + "</mujoco>"))
    matrices = Model(machine, ()).matrices(np.zeros(0))
    np.testing.assert_allclose(matrices.stiffness, [[2e3]], rtol=1e-9)
