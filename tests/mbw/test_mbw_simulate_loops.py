"""``mbw simulate`` with control loops closed: budgets, campaigns, moves, and their page."""

import csv
import json

import numpy as np
import pytest
from budget_case import BUDGET, LOOP_DELAY, write_machine
from simulate_command import run

import mbworkbench as mb
from mbw.simulate.encoder_readings import round_readings

SAMPLED = BUDGET.format(gain=3e4, delay=LOOP_DELAY, lines="").replace(
    "zeros = [-60.0, -8.0], poles = [-0.5, -700.0], gain = 30000.0",
    "zeros = [0.95], poles = [0.4], gain = 9e4, period = 1e-3",
)
MOVE = ("--signal", "move", "--at", "reference:axis", "--amplitude", "1e-3", "--duration", "0.6")
LIMITS = ("--limits", "0.1,20,3e3,1e6")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = write_machine(tmp_path_factory.mktemp("two"))
    (place / "budget.toml").write_text(SAMPLED, encoding="utf-8")
    return place


def read_columns(file):
    with file.open(newline="", encoding="utf-8") as opened:
        header, *rows = csv.reader(opened)
    return dict(zip(header, np.array(rows, float).T, strict=True))


def test_readings_of_an_encoder_are_steps_whose_mean_is_the_position():
    motion = np.column_stack([np.full(40_000, 3.3e-6), np.full(40_000, 0.7)])
    read = round_readings(motion, (1e-6, 0.0), seed=1)
    np.testing.assert_array_equal(read[:, 1], motion[:, 1])
    np.testing.assert_allclose(np.unique(read[:, 0]), [3e-6, 4e-6])
    error = read[:, 0] - motion[:, 0]
    assert abs(error.mean()) < 1e-8
    assert error.std() == pytest.approx(1e-6 * np.sqrt(0.3 * 0.7), rel=0.02)


def test_a_budget_in_time_stands_beside_that_of_the_linear_machine(place):
    row = place / "row.json"
    options = ("--duration", "4", "--json", row, "--out", place / "random")
    said = run(place / "two.xml", "--budget", place / "budget.toml", *options)
    written = json.loads(row.read_text())
    for error in written["errors"]:
        assert abs(error["rms"] / error["predicted"] - 1) < 3.5 * error["scatter"]
        assert f"{error['error']}: " in said
    assert "the budget of the linear machine predicts" in said
    assert written["rate"] == 3000.0  # a whole multiple of the sampling rate
    columns = read_columns(place / "random" / "response.csv")
    top = columns["error:top [m]"]
    assert np.sqrt((top**2).mean()) == pytest.approx(written["errors"][0]["rms"], rel=1e-6)
    np.testing.assert_allclose(columns["measured:axis [m]"], top, rtol=1e-9, atol=1e-15)


def test_a_move_that_is_limited_by_force_stays_behind(place):
    quiet = SAMPLED.replace("density = 0.3", "density = 1e-12").replace("2e-7", "1e-12")
    quiet = (
        quiet.partition("[disturbance.floor]")[0]
        + "[disturbance.ripple]"
        + (quiet.partition("[disturbance.ripple]")[2].partition("[[correlation]]")[0])
    )
    results = []
    for number, limit in enumerate(("", "limit = 3.0\n")):
        file = place / f"quiet{number}.toml"
        file.write_text(quiet.replace("delay =", f"{limit}delay ="), encoding="utf-8")
        out = place / f"move{number}"
        options = ("--window", "2e-5", "--json", out.with_suffix(".json"), "--out", out)
        said = run(place / "two.xml", "--budget", file, *MOVE, *LIMITS, *options)
        results.append((json.loads(out.with_suffix(".json").read_text())["loops"][0], said))
    (free, _), (limited, said) = results
    assert free["control"] > 10
    assert limited["control"] == 3.0
    assert limited["limited"] > 0.5
    assert limited["rms"] > 1.02 * free["rms"]
    assert "at its limit of 3" in said
    assert "limit, quantisation and resolution of axis act in mbw simulate" in said
    page = (place / "move1" / "simulate.html").read_text()
    assert "at its limit of 3 for" in page.partition('<p class="lead">')[2].partition("</p>")[0]
    assert '"limit":3.0' in page.replace(": ", ":")


def test_python_simulates_the_same_and_takes_controllers(place):
    time_s = np.arange(0, 0.6, 1 / 2000)
    move = mb.move_signal(time_s, 1e-3, [0.1, 20, 3e3], start_s=0.03)
    result = mb.simulate_budget(
        place / "two.xml",
        place / "budget.toml",
        time_s,
        references={"axis": move},
        controllers={"axis": 0.0},
        seed=1,
    )
    (loop,) = result.response.loops
    np.testing.assert_allclose(loop.reference, move, atol=1e-12)
    assert not loop.control.any()
    assert "loop axis: error" in repr(result)
    assert result.rms["top"] > 0
    assert len(result.plot().data) == 5  # three signals of the loop, two errors


def test_a_campaign_is_simulated_with_its_loops_closed_by_name(place):
    (place / "campaign.toml").write_text(
        'model = "two.xml"\n[[test]]\nfile = "later.uff"\n[loop.axis]\n'
        'input = "drive"\noutput = "acc2:+tx"\n'
        "controller = { zeros = [0.95], poles = [0.4], gain = 3e4, period = 1e-3 }\n"
        "resolution = 1e-7\n"
    )
    out = place / "campaign-out"
    closed = ("--closed", "*", *MOVE, *LIMITS, "--out", out)
    said = run(place, *closed)
    assert "control loops of the test: axis closed" in said
    assert "reference:axis [m]" in read_columns(out / "response.csv")
    said = run(place, *MOVE, *LIMITS, "--out", out, "--overwrite", code=2)
    assert "no loop 'axis' is closed" in said


def test_what_cannot_be_played_in_a_loop_is_refused(place):
    model, budget = place / "two.xml", ("--budget", place / "budget.toml")
    out = ("--out", place / "refused")
    for options, words in (
        ((*budget, *MOVE), "--limits ''"),
        ((*budget, *MOVE, "--limits", "1,2"), "velocity, acceleration and jerk"),
        ((*budget, *MOVE, *LIMITS, "--rate", "1500"), "whole multiple of 1000 Hz"),
        (
            (*budget, "--signal", "step", "--at", "drive", *LIMITS),
            "--limits belongs to --signal move",
        ),
        (("--closed", "*"), "is no loop that was closed during the test"),
        ((*budget, "--rate", "200"), "do not hold"),
    ):
        assert words in run(model, *options, *out, code=2)
