"""Tuning to a table of modes: closed forms, slopes, matching through a swap, what is determined."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.readers.mode_table import ModeTable, TabulatedMode
from identification.words import InputError, UsageError
from mbmodel import as_drawn, load_machine, modes_of_matrices
from tuning.files.mode_table_result import summarise_mode_table
from tuning.fitting import fitter
from tuning.fitting.stage_search import STAGES
from tuning.misfit.mode_table_misfit import ModeTableMisfit, TableStage
from tuning.mode_table_tuning import parametrise_for_table, tune_to_modes

MASSES = (3.0, 2.0)
STIFFNESSES, DAMPINGS = (8e5, 2e5), (40.0, 15.0)


def chain(folder, stiffnesses=STIFFNESSES, dampings=DAMPINGS) -> Path:
    """Two masses in a row along x: ground - k1 - m1 - k2 - m2."""
    inner = (
        '<body name="upper"><inertial pos="0 0 0" mass="{1}" diaginertia="1 1 1"/>'
        '<joint name="upper_tx" type="slide" axis="1 0 0" stiffness="{3:.17g}" damping="{5:.17g}"/>'
        "</body>"
    )
    text = (
        '<mujoco model="chain"><option gravity="0 0 0"/><worldbody><body name="lower">'
        '<inertial pos="0 0 0" mass="{0}" diaginertia="1 1 1"/>'
        '<joint name="lower_tx" type="slide" axis="1 0 0" stiffness="{2:.17g}" damping="{4:.17g}"/>'
        + inner
        + "</body></worldbody></mujoco>"
    ).format(*MASSES, *stiffnesses, *dampings)
    path = folder / "chain.xml"
    path.write_text(text, encoding="utf-8")
    return path


def frequencies_of_chain(k1, k2):
    """Closed form: m1 m2 w^4 - (m1 k2 + m2 (k1 + k2)) w^2 + k1 k2 = 0."""
    m1, m2 = MASSES
    sums, product = (m1 * k2 + m2 * (k1 + k2)) / (m1 * m2), k1 * k2 / (m1 * m2)
    root = np.sqrt(sums**2 - 4 * product)
    return np.sqrt(np.array([sums - root, sums + root]) / 2) / (2 * np.pi)


def table_of(*modes) -> ModeTable:
    rows = tuple(TabulatedMode(line, *mode) for line, mode in enumerate(modes, start=2))
    return ModeTable(Path("table.csv"), rows)


def values_of(tuned) -> dict[str, float]:
    names = [parameter.name for parameter in tuned.model.parameters]
    return dict(zip(names, tuned.fit.theta.tolist(), strict=True))


def test_two_frequencies_of_a_chain_determine_both_stiffnesses_exactly(tmp_path):
    # A second pair, ((m1 + m2) k2 / m2, m2 k1 / (m1 + m2)), has these frequencies too, and lies
    # farther from the nominal one. Undamped but for 1e-9 of critical, so that |s| is the natural
    # frequency of the closed form.
    machine = load_machine(chain(tmp_path, dampings=(1e-6, 1e-6)))
    k1, k2 = 9.1e5, 1.7e5
    frequencies = frequencies_of_chain(k1, k2)
    table = table_of(*((f, None, 1e-9 * f) for f in frequencies))
    tuned = tune_to_modes(machine, table, [("*.damping", 0.0)])
    values = values_of(tuned)
    assert tuned.fit.outcome == "converged"
    assert values["lower_tx.stiffness"] == pytest.approx(k1, rel=1e-8)
    assert values["upper_tx.stiffness"] == pytest.approx(k2, rel=1e-8)
    assert (tuned.confidence.deviation < 1e-6).all()


def test_two_modes_with_damping_determine_all_four_parameters(tmp_path):
    machine = load_machine(chain(tmp_path))
    truth = np.array([7.1e5, 95.0, 1.4e5, 6.0])
    model = as_drawn(machine)
    modes = modes_of_matrices(model.matrices(truth))
    table = table_of(
        *((f, z, 1e-8 * f, 1e-8 * z) for f, z in zip(modes.freq_hz, modes.damping, strict=True))
    )
    tuned = tune_to_modes(machine, table)
    np.testing.assert_allclose(tuned.fit.theta, truth, rtol=1e-6)


def test_one_frequency_determines_one_combination_of_both_stiffnesses(tmp_path):
    machine = load_machine(chain(tmp_path))
    first = frequencies_of_chain(*STIFFNESSES)[0]
    tuned = tune_to_modes(machine, table_of((1.1 * first, None)), [("*.damping", 0.0)])
    # Posterior (J'J + 1)^-1, J = d ln f / d ln k times 0.7 (prior) over 0.01 (row), from the
    # closed form: one direction keeps its prior, the other shrinks to 1 / (1 + |J|^2).
    k = tuned.fit.theta[[0, 2]]
    rise = [frequencies_of_chain(*(k * np.exp(step)))[0] for step in 1e-6 * np.eye(2)]
    slopes = np.log(np.array(rise) / frequencies_of_chain(*k)[0]) / 1e-6 * 0.7 / 0.01
    eigenvalues = np.linalg.eigvalsh(tuned.confidence.covariance)
    np.testing.assert_allclose(eigenvalues, [1 / (1 + slopes @ slopes), 1.0], rtol=1e-3)


def test_slopes_of_the_misfit_agree_with_differences(small_station):
    machine, table = small_station
    model, parametrisation = parametrise_for_table(machine, [("*.mass", 0.05)])
    stage = TableStage(table.modes, 0.05, complete_below_hz=150.0)
    misfit = ModeTableMisfit(model, parametrisation, stage)
    x = 0.2 * np.random.default_rng(3).standard_normal(parametrisation.size)
    value, gradient = misfit(x)
    assert value == pytest.approx(misfit.value(x), rel=1e-12)
    step = 1e-6
    for k in range(parametrisation.size):
        along = np.eye(parametrisation.size)[k] * step
        numeric = (misfit.value(x + along) - misfit.value(x - along)) / (2 * step)
        assert gradient[k] == pytest.approx(numeric, rel=2e-5, abs=2e-6 * np.abs(gradient).max())


def test_every_residual_counts_and_some_name_a_larger_motion(small_station):
    # So that the test of slopes above covers all three kinds of residuals.
    machine, table = small_station
    model, parametrisation = parametrise_for_table(machine, [])
    misfit = ModeTableMisfit(model, parametrisation, TableStage(table.modes))
    _, residuals, slopes = misfit.linearised_residuals(np.zeros(parametrisation.size))
    with_damping = sum(mode.damping is not None for mode in table.modes)
    assert len(residuals) > len(table.modes) + with_damping
    assert np.isfinite(slopes).all()


@pytest.fixture
def small_station(drawing):
    machine = load_machine(drawing)
    return machine, table_of(
        (60.0, 0.02, None, None, "head", ("tz",)),
        (90.0, 0.05, 0.5, 0.01),
        (110.0, None, None, None, "base", ("ry",)),
    )


def crossed(folder) -> Path:
    """Two bodies side by side, each on its own spring: nothing couples their modes."""
    bodies = "".join(
        f'<body name="{name}"><inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>'
        f'<joint name="{name}_tx" type="slide" axis="1 0 0" stiffness="{k}" damping="{c}"/></body>'
        for name, mass, k, c in (("left", 2.0, 4e5, 20.0), ("right", 3.0, 9e5, 30.0))
    )
    path = folder / "crossed.xml"
    path.write_text(
        '<mujoco model="crossed"><option gravity="0 0 0"/><worldbody>'
        f"{bodies}</worldbody></mujoco>",
        encoding="utf-8",
    )
    return path


def test_modes_that_must_cross_follow_the_body_that_moves(tmp_path):
    # As drawn, left lies at 71 Hz and right at 87 Hz; the table wants left above right.
    machine = load_machine(crossed(tmp_path))
    named = table_of((70.0, None, 0.007, None, "right", ("tx",)),
                     (100.0, None, 0.01, None, "left", ("tx",)))  # fmt: skip
    values = values_of(tune_to_modes(machine, named))
    assert values["left_tx.stiffness"] == pytest.approx(2.0 * (2 * np.pi * 100) ** 2, rel=1e-3)
    assert values["right_tx.stiffness"] == pytest.approx(3.0 * (2 * np.pi * 70) ** 2, rel=1e-3)


def test_without_a_named_body_modes_keep_the_order_of_frequencies(tmp_path):
    machine = load_machine(crossed(tmp_path))
    values = values_of(tune_to_modes(machine, table_of((70.0, None, 0.007), (100.0, None, 0.01))))
    assert values["left_tx.stiffness"] == pytest.approx(2.0 * (2 * np.pi * 70) ** 2, rel=1e-3)
    assert values["right_tx.stiffness"] == pytest.approx(3.0 * (2 * np.pi * 100) ** 2, rel=1e-3)


def test_a_row_that_no_mode_can_match_is_told_in_one_sentence(tmp_path):
    machine = load_machine(chain(tmp_path))
    f1, f2 = frequencies_of_chain(*STIFFNESSES)
    summary = summarise_mode_table(
        tune_to_modes(machine, table_of((f1, None), (f2, None), (5000.0, None)))
    )
    assert [row.tuned is None for row in summary.modes] == [False, False, True]
    [remark] = summary.remarks
    assert remark == (
        "Mode 3 (5000 Hz, row 4) does not count: the model as drawn has no mode left for it "
        "within a factor of 3 in frequency."
    )
    assert summary.fit.converged


def test_more_rows_than_modes_leave_the_worst_row_out(tmp_path):
    machine = load_machine(chain(tmp_path))
    f1, f2 = frequencies_of_chain(*STIFFNESSES)
    tuned = tune_to_modes(machine, table_of((f1, None), (1.4 * f1, None), (f2, None)))
    assert (tuned.after.partner >= 0).tolist() == [True, False, True]


def test_a_complete_table_drives_other_modes_out(tmp_path):
    # left at 71 Hz and right at 87 Hz; the table knows one mode at 80 Hz and no other below 120.
    machine = load_machine(crossed(tmp_path))
    table = table_of((80.0, None, 0.1, None, "left", ("tx",)))
    kept = tune_to_modes(machine, table)
    complete = tune_to_modes(machine, table, complete_below_hz=120.0)
    assert values_of(kept)["right_tx.stiffness"] == pytest.approx(9e5, rel=1e-9)
    others = np.sqrt(values_of(complete)["right_tx.stiffness"] / 3.0) / (2 * np.pi)
    assert 119.0 < others < 120.0  # a balance of the limit's deviation, 1 %, and the prior
    assert values_of(complete)["left_tx.stiffness"] == pytest.approx(
        2.0 * (2 * np.pi * 80.0) ** 2, rel=1e-3
    )


def test_a_table_of_another_machine_is_refused(tmp_path):
    machine = load_machine(chain(tmp_path))
    with pytest.raises(InputError, match=r"no row has a mode of chain\.xml within a factor of 3"):
        tune_to_modes(machine, table_of((0.01, None), (9e4, None)))


def test_a_body_that_the_machine_lacks_is_named_with_its_row(tmp_path):
    machine = load_machine(chain(tmp_path))
    table = table_of((30.0, None, None, None, "granite", ("tx",)))
    with pytest.raises(InputError, match=r"row 2: chain\.xml has no body 'granite': name one of"):
        tune_to_modes(machine, table)


def test_a_prior_of_masses_lets_them_vary_and_none_keeps_them(tmp_path):
    machine = load_machine(chain(tmp_path))
    f1, f2 = frequencies_of_chain(*STIFFNESSES)
    table = table_of((1.2 * f1, None), (1.1 * f2, None))
    kept = tune_to_modes(machine, table)
    varied = tune_to_modes(machine, table, [("*.mass", 0.1), ("*.stiffness", 0.0)])
    assert "lower.mass" not in values_of(kept)
    assert values_of(varied)["lower.mass"] < MASSES[0]
    assert values_of(varied)["lower_tx.stiffness"] == STIFFNESSES[0]


def test_further_starts_keep_the_best_end_and_repeat_with_their_seed(small_station):
    machine, table = small_station
    one, four, again = (tune_to_modes(machine, table, starts=n, seed=5) for n in (1, 4, 4))
    assert len(four.fit.start_costs) == 4
    assert four.fit.start_costs[0] == one.fit.cost
    assert four.fit.cost == min(four.fit.start_costs)
    np.testing.assert_array_equal(four.fit.theta, again.fit.theta)


def test_a_search_that_begins_at_its_end_stays_there(small_station):
    machine, table = small_station
    tuned = tune_to_modes(machine, table)
    again = tune_to_modes(machine, table, begin=values_of(tuned))
    np.testing.assert_allclose(again.fit.theta, tuned.fit.theta, rtol=1e-6)


def test_an_interrupt_ends_the_search_and_keeps_the_best_end(small_station, monkeypatch):
    machine, table = small_station
    one = tune_to_modes(machine, table, starts=1)
    calls, search = [], fitter.gauss_newton

    def interrupted_after_the_first_start(*arguments, **options):
        calls.append(None)
        end = search(*arguments, **options)
        if len(calls) <= 11:  # ten stages of one schedule, one of the other
            return end
        return replace(end, value=-1.0, outcome="interrupted", advice="kept")

    monkeypatch.setattr(fitter, "gauss_newton", interrupted_after_the_first_start)
    tuned = tune_to_modes(machine, table, starts=4)
    assert len(calls) == 12
    assert (tuned.fit.outcome, tuned.fit.advice) == ("interrupted", "kept")
    np.testing.assert_array_equal(tuned.fit.theta, one.fit.theta)
    assert tuned.fit.agreeing_starts == 1


def test_a_stage_of_frfs_needs_a_campaign(small_station):
    model, parametrisation = parametrise_for_table(small_station[0], [])
    with pytest.raises(UsageError, match="a stage of FRFs needs a campaign: read one first"):
        fitter.fit_table(model, parametrisation, np.zeros(parametrisation.size), STAGES[:1])
