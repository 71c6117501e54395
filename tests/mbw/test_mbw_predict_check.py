"""``mbw predict --check``, and losses, delays and Maxwell branches from the command."""

import json

import control
import numpy as np
import pytest
from browser import CHROMIUM, GL, browse
from small_machine import MJCF
from typer.testing import CliRunner

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from mbw.command import app

RUNNER = CliRunner()
INPUTS = ("--input", "acc3:+tx", "--input", "acc3:+ty", "--input", "acc3:+tz")
LAWS = (
    "--loss-factor", "head=0.05", "--delay", "base_tx=0.00008", "--maxwell", "base_tz=0.6@0.002",
)  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("check")
    (folder / "pair.xml").write_text(MJCF, encoding="utf-8")
    return folder


def run(place, *arguments):
    call = ["predict", place / "pair.xml", "--out", place / "out", *arguments]
    return RUNNER.invoke(app, [str(argument) for argument in call])


def test_the_difference_at_all_centres_of_mass_is_printed(place):
    result = run(place, "--check", "--no-pictures", *INPUTS)
    assert result.exit_code == 0, result.stderr
    words = " ".join(result.stdout.split())
    assert "state space of 12 states by python-control" in words
    assert "12 x 3 FRFs at centres of mass" in words
    assert float(words.split("largest difference ")[1].split()[0]) < 1e-9
    assert float(words.split("rms difference ")[1].split()[0]) < 1e-9


@pytest.fixture(scope="module")
def checked(place):
    result = run(place, "--check", "--json", place / "check.json", "--band", 5, 250, *LAWS)
    assert result.exit_code == 0, result.stderr
    return json.loads((place / "check.json").read_text("utf-8")), result.stdout


def test_orders_and_errors_of_approximations_stand_in_json_on_page_and_terminal(place, checked):
    row = checked[0]["state_space_check"]
    assert row["band"] == [5, 250]
    assert len(row["outputs"]) == 12
    assert row["is_stable"]
    laws = {law["parameter"]: law for law in row["laws"]}
    assert laws.keys() == {
        "head_tx.loss_factor", "head_ty.loss_factor", "head_rz.loss_factor", "base_tx.delay",
        "base_tz.maxwell",
    }  # fmt: skip
    loss, late = laws["head_tx.loss_factor"], laws["base_tx.delay"]
    assert loss["kind"] == "positive frequencies"
    assert loss["max_error_of_stiffness"] is None
    assert 0 < loss["max_error"] < 0.05
    assert late["kind"] == "pade"
    assert late["max_error"] < 1e-6
    omega = 2j * np.pi * np.linspace(5, 250, 801)
    polynomials = control.pade(8e-5, late["order"])
    fraction = np.polyval(polynomials[0], omega) / np.polyval(polynomials[1], omega)
    expected = np.abs(fraction - np.exp(-8e-5 * omega)) / np.abs(np.expm1(-8e-5 * omega)).max()
    assert late["max_error"] == pytest.approx(expected.max(), rel=1e-2)
    assert laws["base_tz.maxwell"]["kind"] == "exact"
    assert row["states"] == 12 + sum(law["states"] for law in row["laws"])
    page = (place / "out" / "predict.html").read_text("utf-8")
    for sentence in (
        "Pade's fraction of order",
        "by the poles of positive frequency",
        "exact, with",
    ):
        assert sentence in checked[1]
        assert sentence.replace("'", "&#x27;") in page


PROBE = """<script>
(async () => {
  await new Promise(done => setTimeout(done, 1500));
  const curves = byId("state-space").data.filter(t => t.showlegend !== false);
  const found = {names: curves.map(t => t.name), largest: Math.max(...curves[2].y),
    peak: Math.max(...curves[0].y), title: byId("state-space").layout.title.text, faults: FAULTS};
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_page_draws_the_frf_with_the_largest_difference(place, checked, tmp_path):
    row = checked[0]["state_space_check"]
    page = (place / "out" / "predict.html").read_text("utf-8")
    found = browse(page, tmp_path, *GL, probe=PROBE)
    assert found["faults"] == []
    assert found["names"] == ["equation of motion", "state space", "difference"]
    assert found["title"] == f"{row['worst_output']} / {row['worst_input']}"
    assert found["largest"] / found["peak"] == pytest.approx(row["max_difference"], rel=1e-5)


def test_frfs_hold_the_laws_exactly(place):
    result = run(place, "--frf", "--no-pictures", *LAWS[:2], "--input", "acc3:+tx", "--output",
                 "acc3:+tx", "--lines", "40", "--band", "5", "200")  # fmt: skip
    assert result.exit_code == 0, result.stderr
    table = np.array([line.split(",") for line in result.stdout.splitlines()[1:]], float)
    values = table[:, 1] + 1j * table[:, 2]
    model = as_drawn(load_machine(place / "pair.xml"))
    matrices = model.matrices(model.drawn)
    eta = np.zeros((6, 6))
    names = model.machine.coordinates
    for spring in model.machine.springs:
        if spring.location == "joint:head":
            k = names.index(spring.name)
            eta[k, k] = 0.05 * spring.stiffness
    row = model.machine.layout.rows([Dof("acc3", "+tx")]) @ model.machine.jacobian
    for frequency, value in zip(table[:, 0], values, strict=True):
        s = 2j * np.pi * frequency
        z = matrices.dynamic_stiffness(s) + 1j * eta
        assert value == pytest.approx((s**2 * row @ np.linalg.solve(z, row.T))[0, 0], rel=1e-7)


def test_a_loss_factor_shows_in_the_damping_of_the_modes(place):
    def modes(*arguments):
        result = run(place, "--json", "-", "--no-pictures", *arguments)
        assert result.exit_code == 0, result.stderr
        return json.loads(result.stdout)["modes"]

    before, after = modes(), modes("--loss-factor", "head=0.05")
    for old, new in zip(before, after, strict=True):
        share = old["strain_by_stage"].get("joint:head", 0.0)
        assert new["damping"] - old["damping"] == pytest.approx(0.025 * share, rel=0.15, abs=1e-3)


def test_a_written_state_space_with_laws_reproduces_the_frfs(place):
    target = place / "system.npz"
    result = run(place, "--statespace", target, "--no-pictures", "--band", "5", "200",
                 "--input", "acc3:+tx", "--output", "acc3:+tx", *LAWS[2:])  # fmt: skip
    assert result.exit_code == 0, result.stderr
    assert "Pade's fraction" in result.stderr
    arrays = np.load(target)
    system = control.ss(*(arrays[name] for name in "ABCD"))
    freq = np.linspace(5, 200, 50)
    values = control.frequency_response(system, 2 * np.pi * freq, squeeze=True).complex
    plain = load_machine(place / "pair.xml")
    model = as_drawn(plain)
    dof = (Dof("acc3", "+tx"),)
    unlawful = Evaluator(model, FrfRequest(freq, dof, dof)).at(model.drawn).values[:, 0, 0]
    printed = run(place, "--frf", "--no-pictures", "--band", "5", "200", "--lines", "50", "--input",
                  "acc3:+tx", "--output", "acc3:+tx", *LAWS[2:])  # fmt: skip
    table = np.array([line.split(",") for line in printed.stdout.splitlines()[1:]], float)
    expected = table[:, 1] + 1j * table[:, 2]
    assert np.abs(values - expected).max() < 1e-4 * np.abs(expected).max()
    assert np.abs(unlawful - expected).max() > 1e-2 * np.abs(expected).max()


def test_laws_act_on_the_machine_with_a_stage_too(place):
    stage = (
        '<mujoco model="s"><worldbody><body name="top"><joint name="top_tz" type="slide" '
        'axis="0 0 1" stiffness="1e5"/><geom size="0.1" mass="2"/></body></worldbody></mujoco>'
    )
    (place / "stage.xml").write_text(stage, encoding="utf-8")
    result = run(
        place, "--mount", place / "stage.xml", "--at", "head:0,0,0.1", "--loss-factor", "top=0.1",
        "--no-pictures", "--json", place / "top.json", "--overwrite",
    )  # fmt: skip
    assert result.exit_code == 0, result.stderr
    summary = json.loads((place / "top.json").read_text("utf-8"))
    (new,) = summary["put_on_top"]["new"]
    assert summary["modes"][new]["damping"] == pytest.approx(0.05, rel=0.2)


def test_modes_that_a_long_delay_ends_are_listed_without_it_and_a_remark_says_so(place):
    result = run(place, "--delay", "head_tx=0.5", "--json", "-", "--no-pictures")
    assert result.exit_code == 0, result.stderr
    assert "modes are those without losses, delays" in " ".join(result.stderr.split())
    plain = run(place, "--json", "-", "--no-pictures")
    both = [json.loads(each.stdout) for each in (result, plain)]
    assert [m["frequency"] for m in both[0]["modes"]] == [m["frequency"] for m in both[1]["modes"]]
    assert any("modes are those without" in remark for remark in both[0]["remarks"])


BAD = {
    "no number": (("--loss-factor", "head=much"), 2, "write JOINT=ETA"),
    "no name": (("--delay", "0.1"), 2, "write JOINT=SECONDS"),
    "one number": (("--maxwell", "head=0.5"), 2, "write JOINT=RATIO@SECONDS"),
    "not finite": (("--delay", "head=inf"), 2, "write JOINT=SECONDS"),
    "unknown": (("--loss-factor", "foot=0.1"), 3, "no spring with stiffness at 'foot'"),
    "negative": (("--loss-factor", "head=-0.1"), 3, "above 0"),
    "zero delay": (("--delay", "head=0"), 3, "above 0"),
    "per cent": (("--loss-factor", "head=20"), 3, "up to 10"),
    "twice": (("--loss-factor", "head=0.1", "--loss-factor", "head_tx=0.1"), 3, "twice"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_laws_end_with_a_sentence(place, case):
    arguments, code, words = BAD[case]
    result = run(place, *arguments)
    assert result.exit_code == code, result.output
    assert words in " ".join(result.stderr.split())
