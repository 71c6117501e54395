"""The files of a campaign: readable by others, the same for the same seed, sealed."""

import hashlib
import tomllib
import warnings
from dataclasses import asdict, replace
from io import BytesIO
from pathlib import Path

import mujoco
import numpy as np
import pytest

from truth.campaign.cause import Cause, Drawn, Draws, Wanted
from truth.campaign.draw import Tolerances
from truth.campaign.file_formats import answer_toml, uff_bytes
from truth.campaign.folder import write_answer, write_campaign
from truth.campaign.measure import Measurement
from truth.campaign.protocol import Protocol
from truth.campaign.virtual_test import Plan, VirtualCampaign, draw_campaign
from truth.effects import Answer
from truth.effects.effect import draw_nothing
from truth.errors import TruthError

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of pyuff's own imports
    import pyuff


APPENDAGE = Cause((Wanted("appendage", "body:ty"),))


@pytest.fixture(scope="module")
def campaign(nominal) -> VirtualCampaign:
    return draw_campaign(nominal, Plan(11, APPENDAGE))


@pytest.fixture
def measurement() -> Measurement:
    """Three responses, two references, every value different."""
    random = np.random.default_rng(3)
    parts = random.standard_normal((3, 17, 3, 2))
    return Measurement(
        freq_hz=0.25 * np.arange(17),
        frf=parts[0] + 1j * parts[1],
        coherence=np.abs(np.tanh(parts[2])),
        responses=((1, 1), (1, 3), (20, 2)),
        references=((11, 1), (11, 2)),
    )


def test_the_universal_file_reads_back_as_it_was_written(measurement, tmp_path):
    path = tmp_path / "test.uff"
    path.write_bytes(uff_bytes(measurement))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        units, *sets = pyuff.UFF(str(path)).read_sets()
    assert (units["type"], units["units_code"]) == (164, 1)
    assert (units["length"], units["force"], units["temp"]) == (1.0, 1.0, 1.0)
    assert len(sets) == 12
    kinds = {4: measurement.frf.astype(np.complex64), 6: measurement.coherence.astype(np.float32)}
    for one in sets:
        row = measurement.responses.index((one["rsp_node"], one["rsp_dir"]))
        column = measurement.references.index((one["ref_node"], one["ref_dir"]))
        np.testing.assert_array_equal(one["data"], kinds[one["func_type"]][:, row, column])
        np.testing.assert_allclose(one["x"], measurement.freq_hz)
    frf = sets[0]
    assert (frf["ordinate_spec_data_type"], frf["orddenom_spec_data_type"]) == (12, 13)
    assert (frf["n_bytes"], frf["ord_data_type"]) == (17 * 8, 5)
    assert (sets[1]["n_bytes"], sets[1]["ord_data_type"]) == (17 * 4, 2)


def test_the_number_of_bytes_leads_exactly_to_the_next_delimiter(measurement):
    stream = BytesIO(uff_bytes(measurement))
    for _ in range(6):
        stream.readline()
    for _ in range(12):
        assert stream.readline() == b"    -1\n"
        header = stream.readline()
        assert header.startswith(b"    58b     1     2          11")
        for _ in range(11):
            assert len(stream.readline().rstrip(b"\n")) <= 80
        stream.read(int(header[31:43]))
        assert stream.readline() == b"\n"
        assert stream.readline() == b"    -1\n"
    assert stream.read() == b""


def test_a_measurement_without_all_its_cells_is_refused(measurement):
    with pytest.raises(TruthError, match="expected the shape"):
        replace(measurement, frf=measurement.frf[:, :2])


def test_the_campaign_states_its_test_and_every_tolerance(campaign):
    stated = tomllib.loads(campaign.files["campaign.toml"].decode())
    assert stated["model"] in campaign.files
    assert stated["tolerance"] == asdict(Tolerances())
    (test,) = stated["test"]
    assert test == {"file": "impact_200N.uff", "level": 200.0, "averages": 10}
    assert test["file"] in campaign.files


def test_the_answer_states_effect_place_and_parameters(campaign):
    answer = tomllib.loads(campaign.answer.decode())
    assert (answer["effect"], answer["location"]) == ("appendage", "body:ty")
    assert answer["dof"] in {"tx", "ty", "tz"}
    assert answer["parameters"].keys() == {"mass", "frequency", "damping"}


def test_an_answer_is_toml_whatever_the_bodys_name():
    name = 'body:a "b" \\ c'

    draws = Draws((Drawn(draw_nothing(None, None, None), None),), 0)
    text = answer_toml((Answer("x", name),), draws, Cause(), Protocol(), 'a "b"', "00")
    answer = tomllib.loads(text)
    assert answer["location"] == name
    assert answer["drawn"]["machine"] == 'a "b"'


def test_the_hash_of_the_answer_is_salted_and_verifies(campaign, tmp_path):
    write_campaign(campaign, tmp_path / "out")
    content = (tmp_path / "out" / "answer.toml").read_bytes()
    assert hashlib.sha256(content).hexdigest() == campaign.answer_hash
    first, rest = content.split(b"\n", 1)
    assert first.startswith(b"# salt ")
    assert len(bytes.fromhex(first[7:].decode())) == 16
    assert hashlib.sha256(rest).hexdigest() != campaign.answer_hash


def test_the_same_seed_gives_the_same_bytes(nominal, campaign):
    again = draw_campaign(nominal, Plan(11, APPENDAGE))
    assert again.files == campaign.files
    other = draw_campaign(nominal, Plan(12, APPENDAGE))
    assert again.answer == campaign.answer
    assert other.files["model.xml"] != campaign.files["model.xml"]
    assert other.answer != campaign.answer


def test_the_effect_is_not_in_the_drawing_and_takes_no_other_draw(nominal, campaign):
    plain = draw_campaign(nominal, Plan(11))
    assert plain.files["model.xml"] == campaign.files["model.xml"]
    assert plain.files["impact_200N.uff"] != campaign.files["impact_200N.uff"]
    answer = tomllib.loads(plain.answer.decode())
    assert (answer["effect"], answer["parameters"]) == ("none", {})


def test_more_averages_and_another_level_keep_the_machine_and_the_answer(nominal, campaign):
    plan = Plan(11, APPENDAGE, Protocol(averages=20, levels=(40.5,)))
    louder = draw_campaign(nominal, plan)
    assert "impact_40.5N.uff" in louder.files
    assert louder.files["model.xml"] == campaign.files["model.xml"]
    answers = [tomllib.loads(one.answer.decode()) for one in (louder, campaign)]
    assert answers[0].pop("drawn") != answers[1].pop("drawn")
    assert answers[0] == answers[1]


def test_the_drawing_opens_in_the_simulator_with_its_shapes_and_names(campaign, nominal, tmp_path):
    # Far from the station's own folder: the meshes have to come along.
    write_campaign(campaign, tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "model.xml"))
    names = [model.joint(i).name for i in range(model.njnt)]
    assert names == [joint.name for stage in nominal.stages for joint in stage.joints]
    assert model.ngeom == sum(len(stage.shapes) for stage in nominal.stages)
    assert model.nmesh == len(nominal.meshes) == 6
    np.testing.assert_allclose(model.geom_rgba[0], [0.27, 0.29, 0.32, 1], rtol=1e-6)
    assert not model.geom_contype.any()
    assert model.opt.gravity.tolist() == [0, 0, 0]


def test_meshes_are_copied_byte_for_byte(campaign, nominal_path):
    for mesh in (nominal_path.parent / "meshes").iterdir():
        assert campaign.files[f"meshes/{mesh.name}"] == mesh.read_bytes()


def test_an_unknown_effect_is_refused_with_the_catalogue(nominal):
    with pytest.raises(TruthError, match="'rust' is unknown; choose from none, mass_error"):
        draw_campaign(nominal, Plan(1, Cause((Wanted("rust"),))))


@pytest.fixture
def small() -> VirtualCampaign:
    return VirtualCampaign({"campaign.toml": b"new"}, b"b")


def test_a_campaign_is_replaced_only_when_told_so(small, tmp_path):
    folder = tmp_path / "deep" / "out"
    write_campaign(small, folder)
    (folder / "campaign.toml").write_bytes(b"old")
    with pytest.raises(TruthError, match="--overwrite"):
        write_campaign(small, folder)
    assert (folder / "campaign.toml").read_bytes() == b"old"
    (folder / "stale.uff").touch()
    write_campaign(small, folder, overwrite=True)
    assert sorted(path.name for path in folder.iterdir()) == ["answer.toml", "campaign.toml"]
    assert [path.name for path in folder.parent.iterdir()] == ["out"]


def test_a_sealed_answer_is_not_in_the_folder(small, tmp_path):
    write_campaign(small, tmp_path / "out", sealed=True)
    write_answer(small, tmp_path / "sealed" / "one.toml")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["campaign.toml"]
    assert [path.name for path in (tmp_path / "sealed").iterdir()] == ["one.toml"]
    assert (tmp_path / "sealed" / "one.toml").read_bytes() == b"b"


def test_an_empty_folder_is_taken(small, tmp_path):
    write_campaign(small, tmp_path)
    assert (tmp_path / "campaign.toml").exists()


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_of_something_else_is_never_replaced(small, tmp_path, overwrite):
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(TruthError, match=r"no campaign\.toml"):
        write_campaign(small, tmp_path, overwrite=overwrite)
    with pytest.raises(TruthError, match="is a file"):
        write_campaign(small, tmp_path / "thesis.txt", overwrite=overwrite)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("stage", ["write_bytes", "rename"])
def test_a_failure_on_the_way_leaves_the_old_campaign(small, tmp_path, monkeypatch, stage):
    folder = tmp_path / "out"
    write_campaign(VirtualCampaign({"campaign.toml": b"old"}, b"a"), folder)
    original = getattr(Path, stage)

    def full(path: Path, *arguments):
        if path.name.endswith("new") or path.parent.name.endswith("new"):
            raise OSError("no space left")
        return original(path, *arguments)

    monkeypatch.setattr(Path, stage, full)
    with pytest.raises(OSError, match="no space left"):
        write_campaign(small, folder, overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (folder / "campaign.toml").read_bytes() == b"old"
