"""Gravity, tendons, sag: stiffness at the static equilibrium against closed forms."""

import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf, taut

from identification.words import ConvergenceError, Dof
from mbmodel import FrfRequest, as_drawn, linearise, modes_of_matrices

G = 9.81
DOWN = f"0 0 -{G}"
# The remaining stiffness comes from central differences: step^2 / 6 = 2e-13 of truncation and
# 1e-16 / 1e-6 = 1e-10 of rounding in K, half of it in a frequency.
DIFFERENCES = 1e-9


def frequencies(machine):
    model = as_drawn(machine)
    return np.sort(modes_of_matrices(model.matrices(model.drawn)).freq_hz)


def pendulum(*, length=0.7, mass=3.0, inertia=1e-3, joint="", turn=0.0, gravity=DOWN):
    """A mass on a rod that hangs from a hinge at the origin, turned about y by ``turn``."""
    body = (
        f'<body name="bob" euler="0 {turn} 0">'
        f'<inertial pos="0 0 {-length}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
        f'<joint name="pivot" type="hinge" axis="0 1 0" {joint}/>'
        f'<site name="acc1" pos="0 0 {-length}"/></body>'
    )
    return mjcf(body, gravity=gravity)


def test_a_pendulum_swings_at_root_m_g_l_over_inertia(from_text):
    machine = from_text(pendulum())
    expected = np.sqrt(3 * G * 0.7 / (3 * 0.7**2 + 1e-3)) / (2 * np.pi)
    assert frequencies(machine)[0] == pytest.approx(expected, rel=DIFFERENCES)


def test_a_pendulum_without_gravity_has_no_stiffness(from_text):
    assert not from_text(pendulum(gravity="0 0 0")).remaining_stiffness.any()


def test_a_pendulum_drawn_aslant_is_linearised_where_it_hangs(from_text):
    machine = from_text(pendulum(turn=0.4))
    # The residual of Newton's method is 1e-11 of the weight, an angle of about 1e-11.
    np.testing.assert_allclose(machine.layout.centres[0], [0, 0, -0.7], atol=1e-10)
    hanging = from_text(pendulum())
    assert frequencies(machine)[0] == pytest.approx(frequencies(hanging)[0], rel=DIFFERENCES)


def test_a_pendulum_on_a_ball_swings_both_ways_and_turns_freely(from_text):
    text = pendulum().replace('type="hinge" axis="0 1 0"', 'type="ball"')
    text = text.replace('diaginertia="0.001 0.001', 'diaginertia="0.002 0.001')
    model = as_drawn(from_text(text))
    swing = [np.sqrt(3 * G * 0.7 / (3 * 0.7**2 + about)) / (2 * np.pi) for about in (2e-3, 1e-3)]
    freq_hz = np.sort(modes_of_matrices(model.matrices(model.drawn)).freq_hz)
    np.testing.assert_allclose(freq_hz[-2:], swing, rtol=DIFFERENCES)
    # Spinning is a double pole at zero: it splits by the root of the differences' 1e-10.
    assert (freq_hz[:-2] < 1e-4).all()


def test_a_double_pendulum_swings_as_the_textbook_says(from_text):
    # Point masses m1, m2 on rods l1, l2 in absolute angles: M = [[(m1+m2) l1^2, m2 l1 l2],
    # [m2 l1 l2, m2 l2^2]], K = g diag((m1+m2) l1, m2 l2).
    (m1, l1), (m2, l2) = (3.0, 0.7), (2.0, 0.4)
    point = 'diaginertia="1e-12 1e-12 1e-12"'
    lower = (
        f'<body name="low" pos="0 0 {-l1}"><inertial pos="0 0 {-l2}" mass="{m2}" {point}/>'
        '<joint name="elbow" type="hinge" axis="0 1 0"/></body>'
    )
    upper = (
        f'<body name="up"><inertial pos="0 0 {-l1}" mass="{m1}" {point}/>'
        f'<joint name="shoulder" type="hinge" axis="0 1 0"/>{lower}</body>'
    )
    M = np.array([[(m1 + m2) * l1**2, m2 * l1 * l2], [m2 * l1 * l2, m2 * l2**2]])
    K = G * np.diag([(m1 + m2) * l1, m2 * l2])
    expected = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)) / (2 * np.pi)
    machine = from_text(mjcf(upper, gravity=DOWN))
    np.testing.assert_allclose(frequencies(machine), expected, rtol=DIFFERENCES)


def test_an_inverted_pendulum_takes_m_g_l_from_its_spring(from_text):
    machine = from_text(pendulum(length=-0.7, joint='stiffness="35"'))
    expected = np.sqrt((35 - 3 * G * 0.7) / (3 * 0.7**2 + 1e-3)) / (2 * np.pi)
    assert frequencies(machine)[0] == pytest.approx(expected, rel=DIFFERENCES)


def test_an_inverted_pendulum_on_a_weak_spring_falls_with_a_real_pole(from_text):
    machine = from_text(pendulum(length=-0.7, joint='stiffness="5"'))
    model = as_drawn(machine)
    poles = modes_of_matrices(model.matrices(model.drawn)).poles
    growth = np.sqrt((3 * G * 0.7 - 5) / (3 * 0.7**2 + 1e-3))
    np.testing.assert_allclose(np.sort(poles.real), [-growth, growth], rtol=DIFFERENCES)


def test_an_unstable_machine_still_has_its_receptance(from_text):
    # Z = k - m g l - J w^2 < 0: the modal form with a negative squared frequency.
    model = as_drawn(from_text(pendulum(length=-0.7, joint='stiffness="5" damping="0.3"')))
    freq, dof = np.array([0.0, 0.3, 0.8, 2.0]), Dof.parse("bob:+ry")
    H = linearise(model, model.drawn, FrfRequest(freq, (dof,), (dof,), "receptance")).values
    w = 2 * np.pi * freq
    expected = 1 / (5 - 3 * G * 0.7 - (3 * 0.7**2 + 1e-3) * w**2 + 0.3j * w)
    np.testing.assert_allclose(H[:, 0, 0], expected, rtol=DIFFERENCES)


def test_a_mass_on_a_spring_sags_by_its_weight_over_its_stiffness(from_text):
    machine = from_text(mjcf(mass_on_spring(4, 3e4, 7, pos="0.1 0.2 0.3"), gravity=DOWN))
    # Newton stops at 1e-11 of the weight.
    sag = machine.layout.centres[0] - [0.1, 0.2, 0.3]
    np.testing.assert_allclose(sag, [0, 0, -4 * G / 3e4], rtol=1e-10, atol=1e-15)


def test_a_sensor_sags_with_its_body(from_text):
    machine = from_text(mjcf(mass_on_spring(4, 3e4, 7), gravity=DOWN))
    np.testing.assert_allclose(machine.layout.positions, machine.layout.centres, atol=1e-15)


def test_gravity_does_not_change_the_frequency_of_a_mass_on_a_spring(from_text):
    heavy, floating = (
        frequencies(from_text(mjcf(mass_on_spring(4, 3e4, 7), gravity=gravity)))
        for gravity in (DOWN, "0 0 0")
    )
    assert heavy[0] == pytest.approx(np.sqrt(3e4 / 4) / (2 * np.pi), rel=1e-12)
    # A constant force has no slope; differences of it leave 1e-14 / 1e-6 N/m beside 3e4 N/m.
    assert heavy[0] == pytest.approx(floating[0], rel=1e-12)


def test_a_spring_reference_holds_a_mass_where_it_is_drawn(from_text):
    text = mjcf(mass_on_spring(4, 3e4, 7), gravity=DOWN)
    held = text.replace('name="a_j"', f'name="a_j" springref="{4 * G / 3e4:.17g}"')
    np.testing.assert_allclose(from_text(held).layout.centres[0], 0, atol=1e-14)


def test_a_taut_string_is_stiff_across_by_tension_over_length(from_text):
    text, tension = taut(0.02)
    model = as_drawn(from_text(text))
    K = model.matrices(model.drawn).stiffness
    across = tension / 0.4 + tension / 0.9
    # Off-diagonal terms are zero but for the differences' rounding, relative to the largest term.
    np.testing.assert_allclose(np.diag(K), [4e4, across, across], rtol=DIFFERENCES)
    assert np.abs(K - np.diag(np.diag(K))).max() < DIFFERENCES * 4e4


def test_strings_that_balance_as_drawn_are_at_equilibrium(from_text):
    # No gravity, and 600 N on either side: the forces left over are rounding of those 600 N.
    text, tension = taut(0.02, start="0 0 0")
    machine = from_text(text)
    across = tension / 0.4 + tension / 0.9
    model = as_drawn(machine)
    stiffness = np.diag(model.matrices(model.drawn).stiffness)
    np.testing.assert_allclose(stiffness[1:], [across, across], rtol=DIFFERENCES)


def test_a_taut_string_damps_along_itself_only(from_text):
    text, _ = taut(0.02)
    model = as_drawn(from_text(text))
    C = model.matrices(model.drawn).damping
    # Newton leaves the mass some 1e-10 m off the line between the anchors.
    np.testing.assert_allclose(C, np.diag([14, 0, 0]), atol=1e-8)


def test_a_string_without_tension_gives_way_across(from_text):
    text, _ = taut(0.0, start="0 0 0")
    model = as_drawn(from_text(text))
    K = model.matrices(model.drawn).stiffness
    np.testing.assert_allclose(K, np.diag([4e4, 0, 0]), atol=1e-9)


def test_strings_are_parts_of_their_own(from_text):
    text, _ = taut(0.02)
    model = as_drawn(from_text(text))
    assert [p.name for p in model.parameters] == [
        *("one.stiffness", "one.damping", "two.stiffness", "two.damping"),
    ]
    assert model.locations[0] == "tendon:one"


def test_unequal_strings_pull_the_mass_to_their_balance(from_text):
    text, _ = taut(0.02)
    shorter = text.replace('springlength="0.84', 'springlength="0.74')
    assert shorter != text
    machine = from_text(shorter)
    # k1 (0.4 + x - 0.38) = k2 (0.9 - x - l2).
    length = 0.9 - 600 / 1e4 - 0.1
    x = (1e4 * (0.9 - length) - 3e4 * 0.02) / 4e4
    np.testing.assert_allclose(machine.layout.centres[0], [x, 0, 0], rtol=1e-9, atol=1e-12)


def test_a_slack_string_is_no_spring(from_text):
    text, _ = taut(0.0, start="0 0 0")
    machine = from_text(text.replace('springlength="0.40000000000000002"', 'springlength="0 0.5"'))
    stiffness = {spring.name: spring.stiffness for spring in machine.springs}
    assert (stiffness["one"], stiffness["two"]) == (0, 1e4)


def test_a_fixed_tendon_couples_joints_by_its_coefficients(from_text):
    text = mass_on_spring(2, 3e4, 4, name="a") + mass_on_spring(3, 5e4, 6, name="b", node=2)
    tendon = (
        '<tendon><fixed name="t" stiffness="7e3" damping="11"><joint joint="a_j" coef="2"/>'
        '<joint joint="b_j" coef="-3"/></fixed></tendon>'
    )
    model = as_drawn(from_text(mjcf(text).replace("</mujoco>", tendon + "</mujoco>")))
    matrices = model.matrices(model.drawn)
    rank_one = np.outer([2, -3], [2, -3])
    np.testing.assert_allclose(matrices.stiffness, np.diag([3e4, 5e4]) + 7e3 * rank_one, rtol=1e-14)
    np.testing.assert_allclose(matrices.damping, np.diag([4, 6]) + 11 * rank_one, rtol=1e-14)


def test_a_hardening_spring_is_linearised_at_its_sag(from_text):
    # k1 x + k3 x^3 = m g; slope k1 + 3 k3 x^2.
    k1, k3, mass = 3e4, 5e9, 4.0
    text = mjcf(mass_on_spring(mass, k1, 7), gravity=DOWN)
    machine = from_text(text.replace(f'stiffness="{k1:.17g}"', f'stiffness="{k1} 0 {k3}"'))
    (sag,) = (r.real for r in np.roots([k3, 0, k1, -mass * G]) if abs(r.imag) < 1e-12)
    expected = np.sqrt((k1 + 3 * k3 * sag**2) / mass) / (2 * np.pi)
    # Differences of a cubic: step^2 k3 = 5e-3 N/m of truncation beside 5e4 N/m.
    assert frequencies(machine)[0] == pytest.approx(expected, rel=2e-7)


def test_a_position_servo_is_a_spring(from_text):
    servo = '<actuator><position joint="a_j" kp="2e3" kv="13"/></actuator>'
    text = mjcf(mass_on_spring(4, 3e4, 7)).replace("</mujoco>", servo + "</mujoco>")
    machine = from_text(text)
    np.testing.assert_allclose(machine.remaining_stiffness, [[2e3]], rtol=DIFFERENCES)
    np.testing.assert_allclose(machine.remaining_damping, [[13]], rtol=DIFFERENCES)


def test_a_body_in_free_fall_has_no_equilibrium(from_text):
    falling = mjcf(mass_on_spring(2, 0, 3), gravity=DOWN)
    with pytest.raises(ConvergenceError, match=r"falling\.xml: .*joint 'a_j'.*gravity off"):
        from_text(falling, name="falling.xml")


def test_a_free_fall_is_named_although_a_limit_is_met_on_the_way(from_text):
    # Free directions move by chance in the search; a wider range of the slide is no cure.
    inertial = '<inertial pos="0 0 0" mass="{}" diaginertia="{} {} {}"/>'
    body = (
        '<body name="frame" pos="0 0 0.5"><joint name="float" type="free"/>'
        + inertial.format(380, 28, 40, 60)
        + '<body name="base" pos="0 0 0.16"><joint name="base_tx" type="slide" axis="1 0 0" '
        + 'damping="200"/>'
        + inertial.format(120, 6, 9, 14)
        + '<body name="arm" pos="0.05 0 0.1"><joint name="arm_tx" type="slide" axis="1 0 0" '
        + 'range="-0.1 0.1" damping="60"/>'
        + inertial.format(22, 0.3, 0.35, 0.6)
        + "</body></body></body>"
    )
    with pytest.raises(ConvergenceError, match="joint 'float' stays unbalanced"):
        from_text(mjcf(body, gravity=DOWN))


def test_a_body_in_free_fall_is_named_even_if_its_joint_is_not(from_text):
    falling = mjcf(mass_on_spring(2, 0, 3), gravity=DOWN).replace('name="a_j"', "")
    with pytest.raises(ConvergenceError, match="a_joint0"):
        from_text(falling)


def test_a_drive_that_gravity_does_not_pull_may_be_free(from_text):
    machine = from_text(mjcf(mass_on_spring(2, 0, 3, axis="1 0 0"), gravity=DOWN))
    np.testing.assert_array_equal(machine.remaining_stiffness, [[0]])


def test_relaxed_struts_are_at_rest_despite_the_rounding_of_their_lengths(from_text):
    """Without gravity all forces are rounding: 1e-9 N of struts with 1e8 N/m, along z and x."""
    struts = (
        ("0.5 -0.08 0.85", "0.5 -0.08 0.97", 0.12),
        ("0.5 0.08 0.85", "0.5 0.08 0.97", 0.12),
        ("0.45 0 0.9", "0.35 0 0.9", 0.1),
        ("0.55 0 0.85", "0.6 0 0.97", 0.13),
    )
    feet = "".join(f'<site name="foot{i}" pos="{row[0]}"/>' for i, row in enumerate(struts))
    heads = "".join(f'<site name="head{i}" pos="{row[1]}"/>' for i, row in enumerate(struts))
    tendons = "".join(
        f'<spatial name="strut{i}" stiffness="1e8" springlength="{row[2]}">'
        f'<site site="foot{i}"/><site site="head{i}"/></spatial>'
        for i, row in enumerate(struts)
    )
    slides = "".join(
        f'<joint name="{n}" type="slide" axis="{a}"/>' for n, a in (("x", "1 0 0"), ("z", "0 0 1"))
    )
    body = mass_on_spring(3.0, 1e6, 5.0, axis="0 1 0")
    body = body.replace("</body>", f"{slides}{heads}</body>")
    text = mjcf(feet + body).replace("</mujoco>", f"<tendon>{tendons}</tendon></mujoco>")
    # Relaxed struts across y add no stiffness along y.
    assert frequencies(from_text(text))[0] == pytest.approx(np.sqrt(1e6 / 3) / 2 / np.pi, rel=1e-6)
