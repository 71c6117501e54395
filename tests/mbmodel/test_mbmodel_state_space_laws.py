"""Losses, delays and Maxwell branches in the state space, against closed forms of a mass chain."""

import sys
from itertools import pairwise

import control
import numpy as np
import pytest
from mbmodel_examples import mass_on_spring, mjcf, worst_of_channels

from identification.words import Dof, InputError, UsageError
from mbmodel import (
    AddedPart,
    Change,
    ConstantLoss,
    FrfRequest,
    LateForce,
    Model,
    Parameter,
    Relaxation,
    as_drawn,
    compare_state_space,
    export_state_space,
    linearise,
    modes_with_laws,
    respond_linearly,
    sensor_parts,
    spring_law_part,
    spring_parts,
)
from mbmodel.control_loops.loop_law import DelayFraction
from mbmodel.export.approximations import approximate
from mbmodel.export.positive_frequencies import keep_positive_frequencies

FREQ_HZ = np.linspace(2.0, 200.0, 397)
S = 2j * np.pi * FREQ_HZ
MASS, STIFF, DAMP = (30.0, 8.0), (5e6, 1.4e6), (150.0, 60.0)
CHAIN = mjcf(
    mass_on_spring(MASS[0], STIFF[0], DAMP[0]).removesuffix("</body>")
    + mass_on_spring(MASS[1], STIFF[1], DAMP[1], name="b", node=2)
    + "</body>"
)
DOFS = (Dof("a", "+tz"), Dof("b", "+tz"))


@pytest.fixture(autouse=True)
def no_slycot(monkeypatch):
    """With slycot, python-control evaluates faster and five digits worse."""
    monkeypatch.setitem(sys.modules, "slycot", None)


@pytest.fixture(scope="module")
def chain(from_text_module):
    return from_text_module(CHAIN)


@pytest.fixture(scope="module")
def from_text_module(tmp_path_factory):
    from mbmodel import load_machine  # noqa: PLC0415

    def load(text):
        path = tmp_path_factory.mktemp("chain") / "chain.xml"
        path.write_text(text, encoding="utf-8")
        return load_machine(path)

    return load


def with_law(machine, shape, size, spring="b_j"):
    """Return the nominal model with a law of one spring."""
    (chosen,) = (each for each in machine.springs if each.name == spring)
    return Model(machine, (*spring_parts(machine), spring_law_part(chosen, "law", size, shape)))


def closed_form(upper):
    """Return the receptance of both masses per force on the lower one; (n_freq, 2, 1).

    Args:
        upper: complex stiffness between the masses; (n_freq,).
    """
    lower = S**2 * MASS[0] + STIFF[0] + S * DAMP[0] + upper
    determinant = lower * (S**2 * MASS[1] + upper) - upper**2
    return np.stack([(S**2 * MASS[1] + upper) / determinant, upper / determinant], axis=1)[
        ..., None
    ]


def by_control(system):
    response = control.frequency_response(system, S.imag, squeeze=False)
    return np.moveaxis(np.asarray(response.complex), -1, 0)


REQUEST = FrfRequest(FREQ_HZ, DOFS, DOFS[:1], "receptance")


def test_a_maxwell_branch_is_one_state_and_exact(chain):
    ratio, tau = 0.7, 2e-3
    model = with_law(chain, Relaxation(tau), ratio)
    export = export_state_space(model, model.drawn, REQUEST)
    upper = STIFF[1] * (1 + ratio * S * tau / (1 + S * tau)) + S * DAMP[1]
    assert export.system.nstates == 5
    assert export.laws[0].approximation.kind == "exact"
    assert worst_of_channels(by_control(export.system), closed_form(upper)) < 1e-11


def test_a_delay_is_pades_fraction_with_the_stated_error(chain):
    tau = 4e-4
    model = with_law(chain, LateForce(tau), 1.0)
    export = export_state_space(model, model.drawn, REQUEST)
    (law,) = export.laws
    fraction = law.approximation
    assert fraction.kind == "pade"
    assert export.system.nstates == 4 + fraction.function.order
    # python-control's own fraction of this order, by coefficients.
    numerator, denominator = control.pade(tau, fraction.function.order)
    expected = np.polyval(numerator, S) / np.polyval(denominator, S) - 1
    assert np.abs(fraction.function.at(S) - expected).max() < 1e-9
    late = np.expm1(-S * tau)
    error = np.abs(expected - late).max() / np.abs(late).max()
    assert fraction.max_error == pytest.approx(error, rel=1e-3, abs=1e-9)
    upper = STIFF[1] * np.exp(-S * tau) + S * DAMP[1]
    assert worst_of_channels(by_control(export.system), closed_form(upper)) < 1e-4


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 12, 25])
@pytest.mark.parametrize("tau", [1e-3, 2e-2])
def test_pades_fraction_is_python_controls_and_so_are_its_states(order, tau):
    fraction = DelayFraction(tau, order)
    numerator, denominator = control.pade(tau, order)
    expected = np.polyval(numerator, S) / np.polyval(denominator, S) - 1
    assert np.abs(fraction.at(S) - expected).max() < 1e-11
    dynamics, drive, reading = fraction.states()
    values = control.frequency_response(
        control.ss(dynamics, drive[:, None], reading[None], fraction.constant), S.imag
    ).complex
    assert np.abs(values - expected).max() < 1e-10
    assert np.linalg.eigvals(dynamics).real.max() < 0


def test_a_delay_of_four_turns_needs_a_higher_order_and_no_other_way():
    fit = approximate(LateForce(0.02), FREQ_HZ, has_slope=True)
    assert fit.kind == "pade"
    assert 15 < fit.function.order < 30
    assert fit.max_error < 1e-6


def lossy_chain(eta):
    return closed_form(STIFF[1] * (1 + 1j * eta) + S * DAMP[1])


def difference_by_loss(chain, eta):
    """Largest difference of the state space from the complex stiffness, over each FRF's peak."""
    model = with_law(chain, ConstantLoss(), eta)
    system = export_state_space(model, model.drawn, REQUEST).system
    return system, worst_of_channels(by_control(system), lossy_chain(eta))


def test_a_loss_factor_is_held_to_a_thousandth_of_the_peak_without_states(chain):
    system, worst = difference_by_loss(chain, 0.05)
    assert system.nstates == 4
    assert worst < 1e-3
    # Far nearer than the damper of the same loss at the resonance that strains the spring most.
    model = with_law(chain, ConstantLoss(), 0.05)
    strained = modes_with_laws(model, model.drawn).poles[1].imag
    damper = closed_form(STIFF[1] * (1 + 0.05 * S / strained) + S * DAMP[1])
    assert worst < 0.3 * worst_of_channels(damper, lossy_chain(0.05))


def test_the_error_of_a_loss_factor_falls_faster_than_it(chain):
    errors = [difference_by_loss(chain, eta)[1] for eta in (0.02, 0.04, 0.08)]
    for small, large in pairwise(errors):  # over a peak that falls as the loss grows
        assert 2 < large / small < 4


@pytest.mark.parametrize("eta", [0.12, 0.2, 0.5, 1.5])
def test_a_loss_factor_keeps_the_modes_and_destabilises_nothing(chain, eta):
    model = with_law(chain, ConstantLoss(), eta)
    system = export_state_space(model, model.drawn, REQUEST).system
    poles = system.poles()
    assert poles.real.max() < 0
    modes = modes_with_laws(model, model.drawn).poles
    np.testing.assert_allclose(np.sort(poles[poles.imag > 0].imag), np.sort(modes.imag), rtol=1e-9)
    assert np.abs(poles[poles.imag > 0].sum() - modes.sum()) < 1e-9 * np.abs(modes).sum()


def test_the_stated_error_of_a_loss_factor_is_that_along_its_spring(chain):
    eta = 0.04
    model = with_law(chain, ConstantLoss(), eta)
    export = export_state_space(model, model.drawn, REQUEST)
    (law,) = export.laws
    assert (law.approximation.kind, law.states) == ("positive frequencies", 0)

    both = FrfRequest(FREQ_HZ, DOFS, DOFS, "accelerance")
    held = by_control(export_state_space(model, model.drawn, both).system)
    exact = linearise(model, model.drawn, both).values
    stretch = np.array([-1.0, 1.0])  # of the upper spring
    held, exact = (stretch @ values @ stretch for values in (held, exact))
    error = np.abs(held - exact).max() / np.abs(exact).max()
    assert law.approximation.max_error == pytest.approx(error, rel=0.05)


def test_a_law_that_poles_alone_do_not_reach_has_a_constant_loss_beside_them():
    def shape(s):  # a loss that grows slowly
        return 1j * (0.8 + 0.1 * np.abs(s.imag) / 1000) * np.sign(s.imag) + 0.2 * s / (s + 300)

    fit = approximate(shape, FREQ_HZ, has_slope=True)
    assert fit.kind == "positive frequencies"
    assert fit.loss == pytest.approx(0.8, rel=1e-6)
    assert fit.max_error < 1e-6
    with pytest.raises(InputError, match="no stable system has a law like"):
        approximate(shape, FREQ_HZ, has_slope=True, has_loss=False)


def lossy_system(seed, eta):
    """Springs of which some have losses, and dampers from slight to far above critical."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 7))
    springs, dampers = rng.standard_normal((2, size, size))
    lossy = springs[:, : rng.integers(1, size + 1)]
    stiffness = 1e4 * springs @ springs.T + 10 * np.eye(size)
    damping = rng.choice([0.01, 1, 30]) * dampers @ dampers.T
    inverse = np.diag(1 / rng.uniform(0.5, 2, size))
    complex_stiffness = stiffness + 1j * eta * 1e4 * lossy @ lossy.T
    rates = np.hstack([-inverse @ complex_stiffness, -inverse @ damping])
    a = np.vstack([np.eye(2 * size)[size:], rates])
    return a, np.eye(2 * size)[:, size:] @ inverse + 0j


def mobility_of(a, b):
    unit, lines = np.eye(len(a)), np.geomspace(5, 400, 100)
    return np.array([np.linalg.solve(1j * w * unit - a, b)[len(a) // 2 :] for w in lines])


def test_losses_beside_any_damping_leave_the_system_stable_and_near():
    errors = []
    for seed in range(60):
        lossy = lossy_system(seed, 0.05)
        kept = keep_positive_frequencies(*lossy)
        assert np.linalg.eigvals(kept[0]).real.max() < 0
        exact, held = mobility_of(*lossy), mobility_of(*kept)
        errors.append(np.abs(held - exact).max() / np.abs(exact).max())
    assert np.median(errors) < 0.01
    assert max(errors) < 0.1


def test_a_system_without_losses_stays_as_it_is_with_rigid_modes_too():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((4, 6))
    stiffness, damping = root.T @ root, 0.01 * root.T @ root  # two rigid modes, free
    stiffness[:4, :4] += np.diag([9.0, 0, 0, 0])
    a = np.block([[np.zeros((6, 6)), np.eye(6)], [-stiffness, -damping]])
    b = np.vstack([np.zeros((6, 2)), rng.standard_normal((6, 2))])
    kept = keep_positive_frequencies(a.astype(complex), b.astype(complex))
    for real, before in zip(kept, (a, b), strict=True):
        np.testing.assert_allclose(real, before, atol=1e-5 * np.abs(a).max())


def test_any_other_law_is_fitted_by_stable_poles_within_the_stated_error():
    def fractional(laplace):
        return np.sqrt(laplace / 500)

    fit = approximate(fractional, FREQ_HZ, has_slope=True)
    between = 2j * np.pi * (FREQ_HZ[:-1] + FREQ_HZ[1:]) / 2  # lines that were not fitted
    largest = np.abs(fractional(S)).max()
    assert fit.max_error < 1e-6
    assert np.abs(fit.function.at(between) - fractional(between)).max() < 3e-6 * largest
    assert (fit.function.poles.real < 0).all()


@pytest.mark.parametrize("power", [0, 2])
def test_a_mass_on_a_spring_as_a_law_is_the_machine_with_that_mass(chain, from_text, power):
    # s^2 m (2 zeta w s + w^2) / (s^2 + 2 zeta w s + w^2) at the upper mass: with s^2 in the law or
    # in the core; against the chain with a third body.
    mass, omega, zeta = 1.5, 2 * np.pi * 60, 0.03

    def shape(s):
        resonance = (2 * zeta * omega * s + omega**2) / (s**2 + 2 * zeta * omega * s + omega**2)
        return resonance * s ** (2 - power)

    row = np.zeros((len(chain.body_mass), 1))
    row[chain.layout.bodies.index("b") * 6 + 2] = 1.0

    def finite(theta):
        core = np.zeros((3, 1, 1))
        core[power] = theta[0]
        return (Change("body", row, row, core, shape=shape),)

    size = Parameter("pendulum.mass", mass, "kg")
    part = AddedPart("body:b", (size,), finite, lambda _: ())
    model = Model(chain, (*spring_parts(chain), part))
    export = export_state_space(model, model.drawn, REQUEST)
    assert export.laws[0].approximation.max_error < 1e-9
    third = mass_on_spring(mass, mass * omega**2, 2 * zeta * omega * mass, name="c", node=3)
    text = CHAIN.replace("</body></body>", f"{third}</body></body>")
    explicit = as_drawn(from_text(text))
    expected = linearise(explicit, explicit.drawn, REQUEST).values
    assert worst_of_channels(by_control(export.system), expected) < 1e-8


def test_the_stations_state_space_agrees_at_all_centres_of_mass(station_model):
    layout = station_model.machine.layout
    inputs = tuple(Dof.of("acc11", axis) for axis in range(3))
    request = FrfRequest(np.linspace(0, 200, 201), layout.body_dofs(), inputs)
    comparison = compare_state_space(station_model, request)
    assert (len(comparison.request.outputs), len(comparison.request.inputs)) == (36, 3)
    assert comparison.request.freq_hz[0] == 1.0
    assert comparison.max_difference < 1e-10
    assert comparison.rms_difference <= comparison.max_difference
    assert comparison.growth < 0
    assert comparison.laws == ()


def test_the_comparison_states_the_difference_of_an_approximation(chain):
    eta = 0.04
    model = with_law(chain, ConstantLoss(), eta)
    comparison = compare_state_space(model, REQUEST)
    approximated = by_control(export_state_space(model, model.drawn, REQUEST).system)
    exact = lossy_chain(eta)
    difference = np.abs(approximated - exact)
    largest = (difference / np.abs(exact).max(axis=0)).max()
    rms = np.sqrt(((difference**2).sum(axis=0) / (np.abs(exact) ** 2).sum(axis=0)).mean())
    assert comparison.max_difference == pytest.approx(largest, rel=1e-6)
    assert comparison.rms_difference == pytest.approx(rms, rel=1e-6)


def test_an_unstable_loop_is_seen_in_the_state_space(chain):
    model = with_law(chain, LateForce(2e-3), 1.0)
    assert compare_state_space(model, REQUEST).growth > 0


def test_delays_of_channels_are_refused_and_not_left_out(chain):
    model = Model(chain, (*spring_parts(chain), *sensor_parts(chain)))
    late = [parameter.name.endswith("delay_z") for parameter in model.parameters]
    with pytest.raises(UsageError, match="gains or delays of channels"):
        export_state_space(model, model.drawn + 1e-4 * np.array(late), REQUEST)


def test_laws_need_a_band(chain):
    model = with_law(chain, ConstantLoss(), 0.1)
    with pytest.raises(UsageError, match="8 or more frequency lines"):
        export_state_space(model, model.drawn, FrfRequest(np.ones(1), DOFS, DOFS[:1]))


@pytest.mark.parametrize(
    ("shape", "size"),
    [(ConstantLoss(), 0.3), (LateForce(3e-4), 1.0), (Relaxation(2e-3), 0.9)],
    ids=["loss", "delay", "maxwell"],
)
def test_modes_with_a_law_make_the_dynamic_stiffness_singular(chain, shape, size):
    model = with_law(chain, shape, size)
    modes = modes_with_laws(model, model.drawn)
    for pole, vector in zip(modes.poles, modes.shapes.T, strict=True):
        (law,) = shape(np.array([pole]))
        upper = STIFF[1] * (1 + size * law) + pole * DAMP[1]
        # relative coordinates: the upper mass moves with the sum
        lower = STIFF[0] + pole * DAMP[0]
        z = np.array(
            [
                [lower + pole**2 * sum(MASS), pole**2 * MASS[1]],
                [pole**2 * MASS[1], upper + pole**2 * MASS[1]],
            ]
        )
        assert np.abs(z @ vector).max() < 1e-9 * np.abs(z).max() * np.abs(vector).max()
    assert len(set(np.round(modes.poles, 3))) == len(modes.poles)


@pytest.mark.parametrize("shape", [ConstantLoss(), LateForce(2e-3), Relaxation(2e-2)], ids=str)
def test_close_modes_of_the_station_keep_apart_while_laws_grow(station_model, shape):
    machine = station_model.machine
    springs = [spring for spring in machine.springs if spring.location == "joint:granite_bottom"]
    parts = [spring_law_part(spring, "law", 1.0, shape) for spring in springs]
    model = Model(machine, (*spring_parts(machine), *parts))
    modes = modes_with_laws(model, model.drawn)
    distance = np.abs(modes.poles[:, None] - modes.poles) / np.abs(modes.poles)
    assert (distance + np.eye(len(distance))).min() > 1e-4
    matrices = model.assemble(model.drawn)
    for pole, vector in zip(modes.poles, modes.shapes.T, strict=True):
        z = matrices.matrices.dynamic_stiffness(pole)
        for term in matrices.frequency_dependent:
            z = z + term.left @ term.at(np.array([pole]))[0] @ term.right.T
        size = np.abs(z) @ np.abs(vector)
        assert (np.abs(z @ vector) < 1e-7 * size).all()


def test_a_lossy_mass_has_half_the_loss_factor_as_damping(from_text):
    machine = from_text(mjcf(mass_on_spring(20, 2e6, 0)))
    eta = 0.2
    model = with_law(machine, ConstantLoss(), eta, spring="a_j")
    (pole,) = modes_with_laws(model, model.drawn).poles
    assert pole == pytest.approx(1j * np.sqrt(2e6 / 20 * (1 + 1j * eta)), rel=1e-12)
    assert -pole.real / abs(pole) == pytest.approx(np.sin(np.arctan(eta) / 2), rel=1e-12)


def test_the_time_response_holds_a_maxwell_branch(from_text):
    # Against python-control's forced response of three states written by hand.
    mass, stiff, damp, ratio, tau = 20.0, 2e6, 300.0, 0.8, 3e-3
    machine = from_text(mjcf(mass_on_spring(mass, stiff, damp)))
    model = with_law(machine, Relaxation(tau), ratio, spring="a_j")
    # branch force = ratio k (x - y), y' = (x - y) / tau
    A = [
        [0, 1, 0],
        [-stiff * (1 + ratio) / mass, -damp / mass, ratio * stiff / mass],
        [1 / tau, 0, -1 / tau],
    ]
    system = control.ss(A, [[0], [1 / mass], [0]], [[1, 0, 0]], 0)
    time = np.arange(0, 0.4, 1e-4)
    force = np.sin(2 * np.pi * 30 * time) * np.exp(-((time - 0.1) ** 2) / 2e-3)
    expected = control.forced_response(system, time, force).outputs
    dof = (Dof("a", "+tz"),)
    values = respond_linearly(
        model, model.drawn, FrfRequest(np.ones(1), dof, dof, "receptance"), time, force[:, None]
    )
    # forced_response takes the force as linear between samples: 3e-5 at this step, falling as its
    # square
    assert np.abs(values[:, 0] - expected).max() < 6e-5 * np.abs(expected).max()
