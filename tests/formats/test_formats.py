"""Results of earlier versions are read by this one, and each file says its format."""

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from identification.readers.campaign_toml import CampaignSettings
from identification.readers.result_files import (
    FORMAT,
    ResultFile,
    read_result_arrays,
    read_result_json,
    write_result_arrays,
)
from identification.readers.toml_files import read_toml
from identification.words import InputError
from mbw.command import app
from tests.formats.__main__ import CALLS, HERE

VERSIONS = sorted(path for path in HERE.iterdir() if (path / "tuned").is_dir())
# What reads the results of each verb, with {here} for a copy of them.
READERS = {
    "campaign": "identify {here}/campaign --out {out} --band 20 120",
    "identified": "report {here}/identified --out {out}",
    "tuned": "report {here}/tuned --out {out}",
    "diagnosed": "report {here}/diagnosed --out {out}",
    "plant": "predict {here}/tuned --bands --lines 11 --out {out}",
    "matched": "report {here}/matched --out {out}",
    "placed": "place {shapes} --check {here}/placed/sites.csv --band 15 60 --out {out}",
    "blind": "report {here}/blind --out {out}",
}


@pytest.mark.parametrize("results", VERSIONS, ids=lambda path: path.name)
@pytest.mark.parametrize("verb", CALLS)
def test_results_of_a_version_are_read(results, verb, tmp_path):
    here = tmp_path / "kept"
    shutil.copytree(results, here)
    shapes = HERE.parents[1] / "assets" / "gondola" / "shapes.vtu"
    words = READERS[verb].format(here=here, out=tmp_path / "out", shapes=shapes).split()
    done = CliRunner().invoke(app, [*words, "--quiet"])
    assert done.exit_code in (0, 4), done.output


class Content(ResultFile):
    mass: float


def test_a_file_states_its_format_and_a_newer_one_is_refused(tmp_path):
    file = tmp_path / "result.json"
    file.write_text(Content(mass=1.0).model_dump_json(exclude_unset=True))
    assert list(json.loads(file.read_text())) == ["format", "mass"]
    assert read_result_json(file, Content, "mbw tune").format == FORMAT
    file.write_text('{"mass": 1.0}')
    assert read_result_json(file, Content, "mbw tune").mass == 1.0
    file.write_text(f'{{"format": {FORMAT + 1}, "mass": 1.0, "new": []}}')
    with pytest.raises(InputError, match="install a newer mbworkbench"):
        read_result_json(file, Content, "mbw tune")


def test_arrays_state_their_format_and_newer_ones_are_refused(tmp_path):
    file = tmp_path / "result.npz"
    write_result_arrays(file, {"mass": np.ones(2)})
    with np.load(file) as stored:
        assert stored["format"] == FORMAT
    assert list(read_result_arrays(file, "mbw tune")) == ["mass"]
    np.savez(file, mass=np.ones(2), format=np.array(FORMAT + 1))
    with pytest.raises(InputError, match=f"has format {FORMAT + 1}"):
        read_result_arrays(file, "mbw tune")


@pytest.mark.parametrize(
    ("stated", "is_read"), [("", True), ("format = 1\n", True), ("format = 2\n", False)]
)
def test_a_campaign_may_state_its_format(stated, is_read, tmp_path):
    file = tmp_path / "campaign.toml"
    file.write_text(f'{stated}model = "model.xml"\n\n[[test]]\nfile = "frf.npz"\n')
    if is_read:
        assert read_toml(file, CampaignSettings).model == "model.xml"
    else:
        with pytest.raises(InputError, match="has format 2"):
            read_toml(file, CampaignSettings)
