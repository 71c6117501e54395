"""The public face: paths and labels as text, short summaries, tables and figures."""

import ast
import inspect
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

import mbworkbench as mb
from diagnosis.settings import SETTINGS
from identification.words import Dof
from mbmodel import FrfRequest, as_drawn, linearise, load_machine
from mbw.identify.verb import IdentifyChoices
from mbw.identify.verb import run as run_identify
from mbw.output_folder import ResultOptions
from mbworkbench.campaign import open_together

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGN = ROOT / "assets" / "two_bodies"
FREQ_HZ = np.linspace(1.0, 200.0, 50)


@pytest.fixture(scope="module")
def campaign():
    return mb.read_campaign(str(CAMPAIGN))


@pytest.fixture(scope="module")
def model():
    return mb.read_model(CAMPAIGN / "model.xml")


@pytest.fixture(scope="module")
def tuned(model, campaign):
    return mb.tune(campaign, model=model, band=(20.0, 120.0))


@pytest.fixture(scope="module")
def steps():
    return []


@pytest.fixture(scope="module")
def result(campaign, steps):
    return mb.diagnose(campaign, progress=steps.append)


@pytest.fixture(scope="module")
def every_result(campaign, model, tuned, result):
    return {
        "campaign": campaign,
        "test": campaign.content.tests[0].estimate,
        "model": model,
        "modes": model.modes(),
        "frf": model.frf(["acc5:+tx", "acc1:+ty"], "acc5:+tx", FREQ_HZ),
        "identified": mb.identify(campaign),
        "tuned": tuned,
        "result": result,
    }


def test_the_face_is_that_of_the_snapshot():
    """A changed name or signature is a change for every user: CHANGELOG and this file say it."""
    text = "".join(f"{line}\n" for line in face_lines())
    assert text == (Path(__file__).parent / "face.txt").read_text()
    assert dir(mb) == mb.__all__


def face_lines():
    """Every public name, with the signatures of functions and methods and names of properties."""
    for name in mb.__all__:
        value = getattr(mb, name)
        if not inspect.isclass(value) or value.__module__.partition(".")[0] != "mbworkbench":
            yield name + arguments(value)
            continue
        yield name
        for member in sorted(set(dir(value)) - set(dir(object))):
            if not member.startswith("_"):
                yield f"  {member}{arguments(getattr(value, member))}"


def arguments(call):
    """The arguments of a function with their defaults, without annotations."""
    if not inspect.isfunction(call):
        return ""
    signature = inspect.signature(call)
    plain = [p.replace(annotation=p.empty) for p in signature.parameters.values()]
    return str(signature.replace(parameters=plain, return_annotation=signature.empty))


def test_signals_for_drives_come_with_expected_intervals(model):
    limits = {"acc5:+tx": {"force": 50.0}}
    plan = {"outputs": ["acc1:+x", "acc5:+x"], "band": (20.0, 120.0), "seconds": 10.0}
    result = mb.excite(model, limits, **plan)
    assert result.signals.shape == (len(result.time_s), 1)
    assert np.abs(result.signals).max() == pytest.approx(50.0)
    assert result.reached == {"acc5:+tx force": pytest.approx(1.0)}
    assert len(result.table().rows) == len(mb.excite(str(CAMPAIGN), limits, **plan).table().rows)
    assert "acc5:+tx" in repr(result)
    assert isinstance(result.plot(), go.Figure)
    with pytest.raises(mb.UsageError, match="motor_constant"):
        mb.excite(model, {"acc5:+tx": {"power": 1.0}}, **plan)


def test_drive_points_are_drawn_where_the_hammer_has_a_site_of_its_own(tmp_path):
    shutil.copytree(CAMPAIGN, tmp_path / "c")
    path, acc = tmp_path / "c" / "model.xml", '<site name="acc5" pos="0.18 0.18 0.58" />'
    text = path.read_text("utf-8")
    assert acc in text
    path.write_text(text.replace(acc, acc + acc.replace("acc5", "hit5")), "utf-8")
    figure = mb.read_campaign(tmp_path / "c").plot()
    assert [trace.name for trace in figure.data[::2]] == [
        f"hit5:+t{axis} (impact_200N.uff)" for axis in "xyz"
    ]


def test_at_most_40_names_are_exported_and_documented():
    assert 20 <= len(mb.__all__) <= 40
    for name in set(mb.__all__) - {"__version__"}:
        assert len(getattr(mb, name).__doc__) > 20
    assert re.fullmatch(r"\d+\.\d+\.\d+", mb.__version__)


def test_frfs_are_those_of_the_model_with_the_signs_of_the_labels(model):
    frf = model.frf(["acc1:+ty", "acc5:-tx"], ["acc5:+tx"], list(FREQ_HZ), "mobility")
    drawn = as_drawn(load_machine(CAMPAIGN / "model.xml"))
    outputs = (Dof("acc1", "+ty"), Dof("acc5", "-tx"))
    request = FrfRequest(FREQ_HZ, outputs, (Dof("acc5", "+tx"),), "mobility")
    expected = linearise(drawn, drawn.drawn, request).frf()
    np.testing.assert_array_equal(frf.values, expected.values)
    np.testing.assert_array_equal(frf["acc5:+tx", "acc5:-tx"], frf["acc5:-tx", "acc5:+tx"])
    np.testing.assert_array_equal(frf["acc5:+x", "acc5:+x"], -frf.values[:, 1, 0])


def test_a_state_space_has_named_signals(model):
    system = model.state_space("acc1:+ty", "acc5:+tx")
    assert system.input_labels == ["acc5:+tx"]
    assert system.output_labels == ["acc1:+ty"]
    assert system.nstates == 2 * len(model.coordinates)


@pytest.mark.parametrize(
    ("labels", "freq_hz", "quantity", "said"),
    [
        (("acc99:+tx", "acc5:+tx"), FREQ_HZ, "accelerance", "acc99"),
        (("acc1", "acc5:+tx"), FREQ_HZ, "accelerance", "'acc1' is not a label"),
        (("acc1:+tx", "acc5:+tx"), FREQ_HZ[::-1], "accelerance", "strictly increasing"),
        (("acc1:+tx", "acc5:+tx"), [1.0, np.nan], "accelerance", "finite"),
        (("acc1:+tx", "acc5:+tx"), [-1.0, 1.0], "accelerance", "not negative"),
        (("acc1:+tx", "acc5:+tx"), FREQ_HZ, "acceleration", "'acceleration'"),
        (("acc1:+tx", "acc5:+tx"), "abc", "accelerance", "frequencies .* as numbers"),
        ((["acc1:+tx", "acc1:+tx"], "acc5:+tx"), FREQ_HZ, "accelerance", "appears twice"),
        (([], "acc5:+tx"), FREQ_HZ, "accelerance", "at least one label"),
    ],
)
def test_a_request_without_sense_is_refused_in_one_sentence(model, labels, freq_hz, quantity, said):
    with pytest.raises(mb.UsageError, match=said):
        model.frf(*labels, freq_hz, quantity)


def test_a_file_that_is_none_is_named():
    with pytest.raises(mb.InputError, match="no_such"):
        mb.read_model("no_such.xml")
    with pytest.raises(mb.InputError, match="no_such"):
        mb.read_campaign("no_such")


def test_identified_modes_lie_in_the_band_and_their_number_is_said(campaign):
    modes = mb.identify(campaign, band=(20.0, 70.0))
    assert ((modes.freq_hz > 20) & (modes.freq_hz < 70)).all()
    assert len(modes.freq_hz) == len(modes.damping) == modes.count > 2
    assert f"{modes.count} modes of two_bodies" in repr(modes)


def test_identified_modes_have_the_sentences_of_the_command(every_result, tmp_path, capsys):
    modes = every_result["identified"]
    run_identify(CAMPAIGN, ResultOptions(tmp_path / "modes"), IdentifyChoices(), None)
    said = capsys.readouterr().err.splitlines()
    assert len(modes.remarks) > 1
    assert set(modes.remarks) <= set(said)
    assert repr(modes).splitlines()[1:] == [f"  {text}" for text in modes.remarks[:9]]


def test_a_wrong_unit_is_said_with_the_modes(tmp_path):
    shutil.copytree(CAMPAIGN, tmp_path / "c")
    toml = tmp_path / "c" / "campaign.toml"
    toml.write_text(toml.read_text("utf-8").replace("averages", 'unit = "g/N"\naverages'), "utf-8")
    remarks = mb.identify(tmp_path / "c").remarks
    assert any("nominal model's, as if values in m/s^2/N were read as g/N" in r for r in remarks)


def test_a_tuned_model_has_parameters_and_a_gap_and_can_be_written(tuned, tmp_path):
    assert tuned.gap.tuned.error < 0.2 * tuned.gap.as_drawn.error
    assert {"table_tx.stiffness", "stage.mass"} <= {row.name for row in tuned.parameters}
    folder = tuned.write(tmp_path / "tuned")
    assert {"tuned.json", "tuned.xml"} <= {path.name for path in folder.iterdir()}


def test_a_diagnosis_names_the_cause_and_can_be_written(result, tmp_path):
    assert result.verdict.verdict == "explained"
    assert "appendage at body:stage" in repr(result)
    file = result.write(tmp_path / "verdict.json")
    assert '"verdict": "explained"' in file.read_text()


def test_another_model_may_be_given(campaign, model):
    tuned = mb.tune(campaign, band=(20.0, 60.0))
    again = mb.tune(str(CAMPAIGN), model=model, band=(20.0, 60.0))
    assert tuned.summary.gap == again.summary.gap
    with pytest.raises(mb.UsageError, match="a tuning has its model and band"):
        mb.diagnose(tuned, model=model)


def test_tests_that_were_read_are_not_read_again(campaign, model, monkeypatch):
    monkeypatch.setattr("tuning.session.read_campaign", None)
    assert open_together(campaign, None, None).campaign.tests[0].estimate is not None
    with pytest.raises(TypeError):
        open_together(campaign, model, None)  # their labels refer to another model


def test_a_tuning_is_diagnosed_on_its_own_session(tuned, monkeypatch):
    given = []

    def keep(session, **options):
        given.append((session, options))
        raise KeyboardInterrupt

    monkeypatch.setattr("mbworkbench.diagnosis.diagnose_session", keep)
    with pytest.raises(KeyboardInterrupt):
        mb.diagnose(tuned, settings=replace(SETTINGS, max_causes=1))
    ((session, options),) = given
    assert session is tuned.fits.session
    assert options["settings"].max_causes == 1


def test_progress_is_told_and_an_interrupted_fit_goes_on(campaign, result, steps, tmp_path):
    assert len(steps) > 4
    assert steps[1] == "null model: stiffness, damping and tolerances"
    seen = []
    options = {"band": (20.0, 60.0), "resume": tmp_path / "steps.json"}
    first = mb.tune(campaign, progress=seen.append, **options)
    count = len(seen)
    again = mb.tune(campaign, progress=seen.append, **options)
    assert count > 0
    assert len(seen) == count
    assert again.summary.gap == first.summary.gap
    with pytest.raises(mb.InputError, match="belongs to other inputs"):
        mb.tune(campaign, seed=1, **options)


def test_exchanged_arguments_are_refused_in_one_sentence(campaign, model):
    for call, name in ((mb.tune, "tune"), (mb.diagnose, "diagnose")):
        for former in ((model, campaign), (campaign, model)):
            with pytest.raises(mb.UsageError, match=rf"mb\.{name}\(campaign, model=model\)"):
                call(*former)
        with pytest.raises(mb.UsageError, match=r"call tune\(campaign, model=model\)"):
            call(model)
        with pytest.raises(mb.UsageError, match=r"call tune\(campaign, model=model\)"):
            call(campaign, model=campaign)


@pytest.mark.parametrize("band", [(200.0, 10.0), (np.nan, 10.0), (10.0,)])
def test_a_band_without_sense_is_refused(campaign, band):
    with pytest.raises(mb.UsageError, match="lower one first"):
        mb.identify(campaign, band=band)


def test_counts_and_models_without_sense_are_refused(campaign):
    with pytest.raises(mb.UsageError, match="jobs is 0"):
        mb.diagnose(campaign, jobs=0)
    with pytest.raises(mb.UsageError, match="starts is 0"):
        mb.tune(campaign, starts=0)
    with pytest.raises(mb.UsageError, match="is no model: give what read_model returned"):
        mb.tune(campaign, model="model.xml")


def test_labels_may_come_from_any_collection(model):
    frf = model.frf(np.array(["acc1:+tx", "acc5:+tx"]), (k for k in ["acc5:+tx"]), FREQ_HZ)
    assert frf.values.shape == (len(FREQ_HZ), 2, 1)
    for wrong in ("acc1:+tx", (0, 0)):
        with pytest.raises(mb.UsageError, match=r"write frf\[output, input\]|is not a label"):
            frf[wrong]


def test_a_parameter_is_found_by_its_name(tuned):
    row = tuned.parameters["table_tx.stiffness"]
    assert row == next(r for r in tuned.parameters if r.name == "table_tx.stiffness")
    assert len(tuned.parameters[:3]) == 3
    with pytest.raises(mb.UsageError, match=r"'no\.such' is no parameter"):
        tuned.parameters["no.such"]


def test_doubts_of_a_fit_stand_in_its_summary(model, campaign):
    tuned = mb.tune(campaign, model=model)
    assert tuned.summary.fit.doubts
    assert f"doubt: {tuned.summary.fit.doubts[0]}" in repr(tuned)


def test_what_results_hold_has_short_summaries_too(every_result):
    inner = {
        "campaign": every_result["campaign"].content,
        "test": every_result["campaign"].content.tests[0],
        "machine": every_result["model"].machine,
        "modes": every_result["modes"].modes,
        "modal model": every_result["identified"].model,
        "tuning": every_result["tuned"].fits,
        "fit": every_result["tuned"].fits.fit,
        "tuned.json": every_result["tuned"].summary,
        "parameters": every_result["tuned"].parameters,
        "diagnosis": every_result["result"].fits,
    }
    for name, value in inner.items():
        lines = repr(value).splitlines()
        assert 1 <= len(lines) <= 10, name
        assert max(map(len, lines)) <= 160, name


def test_every_summary_is_short_and_every_table_is_html(every_result):
    for name, value in every_result.items():
        lines = repr(value).splitlines()
        assert 1 <= len(lines) <= 10, name
        assert max(map(len, lines)) <= 160, name
        if name not in ("test", "frf"):
            html, frame = value._repr_html_(), value.to_pandas()
            assert html.startswith("<table>"), name
            assert html.count("<tr>") == 1 + len(frame), name
            assert list(frame.columns) == list(value.table().header), name


def test_everything_but_a_model_has_a_figure(every_result):
    for name, value in every_result.items():
        if name != "model":
            figure = value.plot() if hasattr(value, "plot") else mb.plot(value)
            assert isinstance(figure, go.Figure), name
            assert len(figure.data) > 0, name
    with pytest.raises(TypeError, match="there is no figure of MachineModel"):
        mb.plot(every_result["model"])


def test_a_figure_of_an_frf_shows_its_magnitude_and_phase(every_result):
    frf = every_result["frf"]
    first = mb.plot(frf).data[:2]
    np.testing.assert_allclose(first[0].y, np.abs(frf.values[:, 0, 0]))
    np.testing.assert_allclose(first[1].y, np.degrees(np.angle(frf.values[:, 0, 0])))


def test_the_facade_computes_nothing():
    # Only figures and tables turn numbers: no file solves, decomposes or optimises.
    for path in (ROOT / "mbworkbench").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute):
                assert node.attr not in ("linalg", "fft", "random", "optimize"), path
            assert not isinstance(node, ast.While | ast.MatMult), path


def test_a_model_is_simulated_in_time(model):
    # A slow push moves a body as the static receptance says.
    time_s = np.arange(0, 0.5, 1e-3)
    force = 10 * np.sin(np.pi * time_s / time_s[-1]) ** 2
    response = model.simulate("stage:+tx", "stage:+tx", time_s, force, "receptance")
    static = model.frf("stage:+tx", "stage:+tx", [0.01], "receptance").values[0, 0, 0].real
    assert response.outputs[:, 0].max() == pytest.approx(10 * static, rel=0.02)
    assert len(repr(response).splitlines()) == 1


@pytest.mark.parametrize(("name", "is_hidden"), [("plant", False), ("identification", True)])
def test_beside_a_users_file_it_works_or_says_what_to_do(name, is_hidden, tmp_path):
    (tmp_path / f"{name}.py").write_text("x = 1\n")
    script = tmp_path / "script.py"
    script.write_text("import mbworkbench as mb\n\nmb.read_plant\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode != 0) == is_hidden, done.stderr
    if is_hidden:
        said = done.stderr.splitlines()[-1]
        assert f"{name}.py hides the package {name} of mbworkbench: rename that file" in said
