"""``mbw compare``: two visits, two machines, a fleet; files, page and refusals."""

import csv
import json
import shutil

import numpy as np
import pytest

from identification.readers.result_files import FORMAT
from mbw.compare.schema import ComparedFile, ComparedModeRow, ShiftRow
from mbw.compare.verb import print_result
from tests.helpers.browser import data_of
from tests.helpers.changed_chain import BEFORE, write_chain, write_visits
from tests.helpers.command import invoke as mbw

LAYOUT = """
[body.all]
centre = [0.0, 0.0, 0.0]
[site.acc1]
body = "all"
position = [0.0, 0.0, 0.0]
[site.acc2]
body = "all"
position = [0.0, 0.0, 0.2]
"""


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("visits")
    first, second = write_visits(folder, factor=1.003, names=("march", "june"))
    done = mbw("compare", first, second)
    assert done.exit_code == 0, done.output
    return folder, done


def read(folder):
    return json.loads((folder / "compared.json").read_text())


def test_a_change_is_named_beside_the_modes_that_it_moves(compared):
    folder, done = compared
    out = folder / "march-june-compared"
    result = read(out)
    assert result["format"] == FORMAT
    assert result["kind"] == "visits"
    assert [row["name"] for row in result["campaigns"]] == ["march", "june"]
    changed = [row["frequency_shift"]["changed"] for row in result["modes"]]
    assert changed == [False, False, True]
    shift = result["modes"][2]["frequency_shift"]
    assert shift["value"] < 0
    assert shift["significance"] == pytest.approx(abs(shift["value"]) / shift["sd"])
    cause = result["verdict"]["causes"][0]
    assert (cause["effect"], cause["location"]) == ("stiffness", "joint:high")
    assert result["verdict"] == json.loads((out / "diagnosed" / "verdict.json").read_text())
    assert "Another stiffness at joint high, along x" in result["change"]
    assert "change -6" in result["change"]
    assert result["change"] in " ".join(done.output.split())
    assert result["without_diagnosis"] is None


def test_the_campaign_of_both_can_be_diagnosed_again_by_itself(compared):
    folder, _ = compared
    done = mbw("identify", folder / "march-june-compared" / "both", "--out", folder / "modes")
    assert done.exit_code == 0, done.output
    assert "tests after the change are left out here" in " ".join(done.output.split())


def test_a_diagnosis_without_pictures_has_no_page(compared):
    folder, _ = compared
    both, out = folder / "march-june-compared" / "both", folder / "again"
    done = mbw("diagnose", both, "--out", out, "--no-pictures")
    assert done.exit_code == 0, done.output
    assert (out / "verdict.json").exists()
    assert not (out / "report.html").exists()
    assert "report in" not in done.output


def test_the_page_overlays_the_frfs_that_differ_most_first(compared):
    folder, _ = compared
    out = folder / "march-june-compared"
    page = (out / "page.html").read_text(encoding="utf-8")
    data, result = data_of(page), read(out)
    assert data["cells"] == [[row["output"], row["input"]] for row in result["frfs"]]
    sizes = [row["over_noise"] for row in result["frfs"]]
    assert sizes == sorted(sizes, reverse=True)
    assert 'href="diagnosed/report.html"' in page
    again = mbw("report", out, "--out", folder / "again.html")
    assert again.exit_code == 0, again.output
    assert (folder / "again.html").read_text(encoding="utf-8") == page


def test_tables_of_modes_and_frfs_have_a_row_for_each(compared):
    folder, _ = compared
    out, result = folder / "march-june-compared", read(folder / "march-june-compared")
    for name, rows in (("modes.csv", result["modes"]), ("frfs.csv", result["frfs"])):
        with (out / name).open(newline="") as stream:
            table = list(csv.DictReader(stream))
        assert len(table) == len(rows)
    with (out / "modes.csv").open(newline="") as stream:
        first = next(csv.DictReader(stream))
    assert float(first["frequency_hz june"]) == pytest.approx(result["modes"][0]["frequency"][1])


def test_without_a_diagnosis_two_machines_differ_beyond_noise_alone(tmp_path):
    first, second = write_visits(tmp_path, after=BEFORE, factor=1.003)
    out = tmp_path / "out"
    done = mbw("compare", first, second, "--two-machines", "--no-diagnosis", "--out", out)
    assert done.exit_code == 0, done.output
    result = read(out)
    assert result["kind"] == "machines"
    assert all(row["frequency_shift"]["changed"] for row in result["modes"])
    assert result["verdict"] is None
    assert sorted(path.name for path in out.iterdir() if path.suffix) == [
        ".mbw.json", "compared.json", "frfs.csv", "modes.csv", "page.html",
    ]  # fmt: skip
    visits = mbw("compare", first, second, "--no-diagnosis", "--out", out, "--no-pictures")
    assert visits.exit_code == 0
    assert not any(row["frequency_shift"]["changed"] for row in read(out)["modes"])
    assert not (out / "page.html").exists()


def test_frfs_that_differ_are_said_where_no_mode_changed(tmp_path):
    visits = write_visits(tmp_path, after=BEFORE)
    unchanged = mbw("compare", *visits, "--no-diagnosis", "--quiet", "--json", "-")
    assert "differ all the same" not in json.loads(unchanged.stdout)["sentence"]
    (file,) = visits[1].glob("*.npz")
    arrays = dict(np.load(file))
    np.savez(file, **(arrays | {"frf": 3 * arrays["frf"], "variance": 9 * arrays["variance"]}))
    options = ("--no-diagnosis", "--quiet", "--overwrite", "--json", "-")
    said = json.loads(mbw("compare", *visits, *options).stdout)["sentence"]
    assert "None of 3 modes changed" in said
    assert "4 of 4 FRFs differ all the same" in said
    assert "by 200 %" in said


def test_a_layout_gives_modes_and_says_that_a_change_needs_a_model(tmp_path):
    for folder in write_visits(tmp_path):
        (folder / "layout.toml").write_text(LAYOUT)
        text = (folder / "campaign.toml").read_text()
        text = text.replace('model = "model.xml"', 'layout = "layout.toml"')
        (folder / "campaign.toml").write_text(text)
    done = mbw("compare", tmp_path / "before", tmp_path / "after", "--json", "-", "--quiet")
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert "can only be named with a model" in result["without_diagnosis"]
    assert len(result["modes"]) == 3


def test_campaigns_that_differ_beside_their_tests_are_not_diagnosed(tmp_path):
    first, second = write_visits(tmp_path)
    file = second / "campaign.toml"
    file.write_text(file.read_text() + '[sensor.acc2]\nflip = ["y"]\n')
    done = mbw("compare", first, second)
    assert done.exit_code == 0, done.output
    assert "differ in sensor.acc2.flip; make them agree" in " ".join(done.output.split())


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Five machines whose springs scatter by 0.5 %, one of which has a spring 20 % softer."""
    folder = tmp_path_factory.mktemp("fleet")
    random = np.random.default_rng(3)
    (folder / "machines").mkdir()
    for number in range(1, 6):
        stiffness = np.array(BEFORE) * np.exp(0.005 * random.standard_normal(2))
        stiffness[1] *= 0.8 if number == 3 else 1.0
        place = folder / str(number)
        place.mkdir()
        _, after = write_visits(place, tuple(stiffness))
        shutil.move(after, folder / "machines" / f"m{number}")
    return folder


def test_the_machine_of_a_fleet_that_differs_stands_out(fleet):
    done = mbw("compare", fleet / "machines")
    assert done.exit_code == 0, done.output
    result = read(fleet / "machines-compared")
    assert result["kind"] == "fleet"
    assert [row["name"] for row in result["campaigns"]] == ["m1", "m2", "m3", "m4", "m5"]
    names = {n for row in result["modes"] for n in row["frequency_scatter"]["stands_out"]}
    assert names == {"m3"}
    for row in result["modes"]:
        scatter = row["frequency_scatter"]
        assert scatter["spread"] == pytest.approx(np.std(row["frequency"], ddof=1))
        assert scatter["spread"] > 10 * scatter["within"]
    assert "m3 stands out" in result["sentence"]
    assert not (fleet / "machines-compared" / "both").exists()
    assert data_of((fleet / "machines-compared" / "page.html").read_text())["kind"] == "fleet"


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["m1"], 3, "is compared with nothing"),
        (["m1", "m1"], 2, "is named twice"),
        (["m1", "m1/campaign.toml"], 2, "is named twice"),
        (["m1", "m2", "m3", "--two-machines"], 2, "more are a fleet"),
        (["nothing", "m2"], 3, "a campaign is a folder with a campaign.toml"),
    ],
)
def test_calls_that_cannot_be_meant_are_refused_in_one_sentence(fleet, words, code, message):
    places = [fleet / "machines" / w if not w.startswith("--") else w for w in words]
    done = mbw("compare", *places, "--no-diagnosis")
    assert done.exit_code == code
    assert message in " ".join(done.output.split())


def test_a_campaign_with_states_is_diagnosed_and_not_compared(tmp_path):
    whole = write_chain(tmp_path / "whole")
    (tmp_path / "more").mkdir()
    first, second = write_visits(tmp_path / "more")
    for words in ([], ["--no-diagnosis"], [second]):
        done = mbw("compare", first, whole, *words)
        assert done.exit_code == 3
        assert "call mbw diagnose" in " ".join(done.output.split())


def test_large_ratios_keep_their_digits_and_columns(capsys):
    shift = ShiftRow(value=1.0, sd=1e-5, significance=0.0, changed=True)
    row = ComparedModeRow(
        frequency=[10.0, 11.0],
        frequency_sd=[1e-5, 1e-5],
        damping=[0.01, 0.02],
        damping_sd=[1e-5, 1e-5],
        mac=[1.0, 0.87],
        probability=[1.0, 1.0],
        frequency_shift=shift.model_copy(update={"significance": 1.23e4}),
        damping_shift=shift.model_copy(update={"significance": 4.56e4}),
    )
    result = ComparedFile(
        kind="visits",
        campaigns=[],
        sentence="",
        remarks=[],
        band=(1.0, 20.0),
        channels=[],
        modes=[row, row.model_copy(update={"damping_shift": None})],
        frfs=[],
    )
    print_result(result)
    header, line, without = capsys.readouterr().out.splitlines()
    assert "1.23e+04" in line
    assert "4.56e+04" in line
    assert {text.index("0.87") for text in (line, without)} == {header.index(" MAC")}


def test_tests_of_two_quantities_are_compared_as_one_and_not_diagnosed(tmp_path):
    first, second = write_visits(tmp_path, after=BEFORE)
    with np.load(second / "frf.npz") as stored:
        arrays = dict(stored)
    factor = (2j * np.pi * arrays["freq_hz"])[:, None, None]
    arrays["frf"] = arrays["frf"] / factor
    arrays["variance"] = arrays["variance"] / np.abs(factor) ** 2
    np.savez(second / "frf.npz", **arrays)
    file = second / "campaign.toml"
    text = file.read_text().replace("accelerance", "mobility").replace("m/s^2/N", "m/s/N")
    file.write_text(text)
    done = mbw("compare", first, second, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    result = read(tmp_path / "out")
    assert "are two quantities" in result["without_diagnosis"]
    # The lines of one resonance outweigh all others: few values, so a wide scatter about 1.
    assert all(row["over_noise"] == pytest.approx(1.0, abs=0.4) for row in result["frfs"])
    assert not any(row["frequency_shift"]["changed"] for row in result["modes"])


def test_friction_is_left_out_of_both_visits(tmp_path):
    visits = write_visits(tmp_path, factor=1.003, names=("march", "june"))
    for visit in visits:
        model = visit / "model.xml"
        model.write_text(model.read_text().replace("<joint ", '<joint frictionloss="3" ', 1))
    refused = mbw("compare", *visits, "--no-diagnosis")
    assert refused.exit_code == 3
    assert "frictionloss" in refused.stderr
    done = mbw("compare", *visits, "--no-diagnosis", "--without", "friction", "--json", "-")
    assert done.exit_code == 0
    assert done.stderr.count("left out as requested: frictionloss") == len(visits)
