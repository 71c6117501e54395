"""``mbw tune --modes`` in-process: results, the table on stdout, refusals and exit codes."""

import csv
import json
import shutil

import numpy as np
import pytest
from small_machine import MJCF

from mbmodel import as_drawn, load_machine, modes_of_matrices
from tests.helpers.command import invoke as mbw
from tuning.fitting import fitter

TABLE = "frequency,damping/%,body,direction\n60,2,,\n80,4,,\n100,3,head,tx\n"


@pytest.fixture
def machine(tmp_path):
    (tmp_path / "pair.xml").write_text(MJCF, encoding="utf-8")
    (tmp_path / "modes.csv").write_text(TABLE, encoding="utf-8")
    return tmp_path / "pair.xml", tmp_path / "modes.csv"


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("table")
    model, table = folder / "pair.xml", folder / "modes.csv"
    model.write_text(MJCF, encoding="utf-8")
    table.write_text(TABLE, encoding="utf-8")
    run = mbw("tune", "--modes", table, model)
    assert run.exit_code == 0, run.stderr
    return folder / "pair-tuned", run


def test_the_tuned_mjcf_has_the_modes_that_the_json_states(result):
    folder, _ = result
    summary = json.loads((folder / "mode_table.json").read_text())
    model = as_drawn(load_machine(folder / "tuned.xml"))
    modes = modes_of_matrices(model.matrices(model.drawn))
    for row in summary["modes"]:
        nearest = int(np.argmin(np.abs(modes.freq_hz - row["tuned"]["frequency"])))
        assert modes.freq_hz[nearest] == pytest.approx(row["tuned"]["frequency"], rel=1e-9)
        assert modes.damping[nearest] == pytest.approx(row["tuned"]["damping"], rel=1e-9)
        assert abs(row["tuned"]["frequency_error"]) < 0.03 < abs(row["as_drawn"]["frequency_error"])


def test_the_plant_of_a_table_of_modes_has_bands(result):
    folder, _ = result
    options = ("--bands", "--output", "head:+tx", "--input", "head:+tx", "--no-pictures")
    run = mbw("predict", folder, *options, "--band", 5, 150, "--lines", 30)
    assert run.exit_code == 0, run.stderr
    with np.load(folder / "tuned-predicted" / "bands.npz") as bands:
        assert (bands["low"] < np.abs(bands["frf"])).all()
        assert (bands["high"] > np.abs(bands["frf"])).all()


def test_the_table_stands_on_stdout_beside_the_model_before_and_after(result):
    _, run = result
    lines = run.stdout.splitlines()
    assert len(lines) == 4
    assert lines[0].split()[:2] == ["mode", "table:"]
    assert lines[3].split()[:4] == ["3", "100.00", "3.00", "head:tx"]
    assert lines[3].endswith("head:tx")
    assert "converged after" in run.stderr
    assert "the table determines" in run.stderr


def test_the_csv_has_the_table_and_both_models(result):
    folder, _ = result
    rows = list(csv.DictReader((folder / "mode_table.csv").read_text("utf-8").splitlines()))
    summary = json.loads((folder / "mode_table.json").read_text())
    assert [float(row["frequency/Hz"]) for row in rows] == [60.0, 80.0, 100.0]
    for row, expected in zip(rows, summary["modes"], strict=True):
        assert float(row["as drawn frequency/Hz"]) == expected["as_drawn"]["frequency"]
        assert float(row["tuned damping/%"]) == pytest.approx(100 * expected["tuned"]["damping"])


def test_a_tuned_table_is_reported_again_as_the_same_page(result, tmp_path):
    folder, _ = result
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    page = (copy / "mode_table.html").read_bytes()
    assert b"Table and modes of the model" in page
    (copy / "mode_table.html").unlink()
    again = mbw("report", copy)
    assert again.exit_code == 0, again.stderr
    assert (copy / "mode_table.html").read_bytes() == page


def test_json_on_stdout_takes_the_place_of_the_table(machine, tmp_path):
    model, table = machine
    out = tmp_path / "out"
    run = mbw("tune", model, "--modes", table, "--json", "-", "--out", out, "--no-pictures")
    assert json.loads(run.stdout) == json.loads((out / "mode_table.json").read_text())
    assert not (out / "mode_table.html").exists()


def test_results_of_another_model_are_not_replaced(machine, tmp_path):
    model, table = machine
    out = tmp_path / "out"
    out.mkdir()
    (out / "tuned.xml").write_text("mine", encoding="utf-8")
    run = mbw("tune", model, "--modes", table, "--out", out, "--quiet")
    assert run.exit_code == 3
    assert "--overwrite" in run.stderr
    assert mbw("tune", model, "--modes", table, "--out", out, "--quiet", "--overwrite").stdout == ""


def test_a_search_that_runs_out_of_steps_writes_its_result_and_exits_with_4(machine, monkeypatch):
    model, table = machine
    monkeypatch.setattr(fitter, "_MAX_TABLE_STEPS", 1)
    run = mbw("tune", model, "--modes", table, "--quiet", "--no-pictures")
    assert run.exit_code == 4
    assert "not converged, out of evaluations" in run.stderr
    summary = json.loads((model.parent / "pair-tuned" / "mode_table.json").read_text())
    assert summary["fit"]["converged"] is False


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--prior", "*.stifness=0.3"], 3, "--prior '*.stifness' fits no parameter"),
        (["--prior", "*.stiffness"], 2, "write NAME=SD"),
        (["--prior", "*.stiffness=-1"], 2, "with SD of 0 or more"),
        (["--prior", "*=0"], 3, "no parameter varies"),
        (["--complete-below", "-5"], 2, "give a frequency in Hz above 0"),
        (["--resume", "--band", "1", "20"], 2, "--band, --resume cannot be combined"),
    ],
)
def test_wrong_options_are_refused(machine, arguments, code, sentence):
    model, table = machine
    run = mbw("tune", model, "--modes", table, *arguments)
    assert run.exit_code == code
    assert sentence in run.stderr


def test_a_malformed_table_ends_with_3_and_names_file_and_row(machine):
    model, table = machine
    table.write_text("frequency,damping\n60,0.02\n80,4\n", encoding="utf-8")
    run = mbw("tune", model, "--modes", table)
    assert run.exit_code == 3
    assert f"{table}, row 3: damping '4' is no damping ratio" in run.stderr
    assert not (model.parent / "pair-tuned").exists()


def test_files_that_are_missing_are_named(machine, tmp_path):
    model, table = machine
    run = mbw("tune", model, "--modes", tmp_path / "absent.csv")
    assert (run.exit_code, "absent.csv does not exist" in run.stderr) == (3, True)
    run = mbw("tune", tmp_path, "--modes", table)
    assert (run.exit_code, "name the MJCF of a machine" in run.stderr) == (2, True)


def test_priors_need_a_table(machine):
    run = mbw("tune", machine[0].parent, "--prior", "*.stiffness=1")
    assert (run.exit_code, "--prior works with --modes only" in run.stderr) == (2, True)


def test_the_first_line_counts_the_rows_that_are_reached(result):
    _, run = result
    assert run.stderr.splitlines()[0].startswith("3 of 3 rows are reached")


def test_a_row_that_cannot_be_reached_is_named_first_and_ends_with_4(tmp_path):
    (tmp_path / "pair.xml").write_text(MJCF, encoding="utf-8")
    (tmp_path / "modes.csv").write_text("frequency\n60\n61\n100\n", encoding="utf-8")
    model, table = tmp_path / "pair.xml", tmp_path / "modes.csv"
    fixed = ("--prior", "*=0.02")
    run = mbw("tune", "--modes", table, model, *fixed, "--no-pictures")
    assert run.exit_code == 4
    first = run.stderr.splitlines()[0]
    assert "of 3 rows are reached within their standard deviation; not those of" in first
    assert (tmp_path / "pair-tuned" / "tuned.xml").is_file()
