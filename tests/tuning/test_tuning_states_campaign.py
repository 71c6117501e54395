"""A campaign of two tests: what it holds, and what keeps two campaigns apart."""

import numpy as np
import pytest
import scipy.io

from identification.words import InputError
from tests.helpers.changed_chain import CHAIN, write_visits
from tuning import open_session
from tuning.files.states_campaign import find_differences, write_states_campaign


def test_both_tests_become_one_campaign_with_the_values_of_each(tmp_path):
    first, second = write_visits(tmp_path)
    assert find_differences(first, second) == []
    folder = tmp_path / "deep" / "both"
    folder.mkdir(parents=True)
    write_states_campaign(first, second, folder, folder, two_machines=True)
    both = open_session(folder).campaign
    assert both.has_states
    assert both.has_two_machines
    for source, state in ((first, "before"), (second, "after")):
        alone, of_state = open_session(source).campaign, both.select_state(state)
        for test, copy in zip(alone.tests, of_state.tests, strict=True):
            np.testing.assert_array_equal(test.estimate.frf.values, copy.estimate.frf.values)


def test_one_machine_is_the_default(tmp_path):
    first, second = write_visits(tmp_path)
    folder = tmp_path / "both"
    folder.mkdir()
    write_states_campaign(first, second, folder, folder)
    assert not open_session(folder).campaign.has_two_machines


def test_a_log_becomes_the_log_of_its_test(tmp_path):
    first, second = write_visits(tmp_path)
    for place in (first, second):
        (place / "campaign.toml").write_text(
            'model = "model.xml"\n[log]\nfile = "frf.npz"\nmotors = { drive = "u" }\n'
            'encoders = { "acc1:+x" = "y" }\nreferences = ["r"]\n'
        )
    folder = tmp_path / "both"
    folder.mkdir()
    write_states_campaign(first, second, folder, folder)
    text = (folder / "campaign.toml").read_text()
    assert text.count("[[test]]") == 2
    assert text.count('log = {file = "frf.npz"') == 2
    assert "\n[log]" not in text


@pytest.mark.parametrize(
    ("added", "keys"),
    [
        ("[tolerance]\nmass = 0.05\n", ["tolerance.mass"]),
        ("[tolerance]\nmass = 0.02\n", []),  # the default, stated
        ('[sensor.acc1]\nflip = ["y"]\n', ["sensor.acc1.flip"]),
    ],
)
def test_what_differs_beside_the_tests_is_named_by_its_key(tmp_path, added, keys):
    first, second = write_visits(tmp_path)
    file = second / "campaign.toml"
    file.write_text(file.read_text() + added)
    differences = find_differences(first, second)
    assert [key for key in differences if key in keys] == keys
    assert bool(differences) == bool(keys)


def test_another_drawing_is_named(tmp_path):
    first, second = write_visits(tmp_path)
    model = second / "model.xml"
    model.write_text(model.read_text().replace('mass="5"', 'mass="5.5"'))
    assert find_differences(first, second) == ["the model model.xml"]


def test_controllers_in_files_are_compared_by_their_numbers(tmp_path):
    visits = write_visits(tmp_path)
    for folder, name, gain in zip(visits, ("c.mat", "other.mat"), (1.0, 1.0), strict=True):
        scipy.io.savemat(folder / name, {"num": [[gain]], "den": [[1.0, 1.0]]})
        file = folder / "campaign.toml"
        loop = f'[loop.x]\ncontroller = "{name}"\ninput = "acc1:+tx"\noutput = "acc1:+tx"\n'
        file.write_text(file.read_text() + loop)
    assert find_differences(*visits) == []
    scipy.io.savemat(visits[1] / "other.mat", {"num": [[2.0]], "den": [[1.0, 1.0]]})
    assert find_differences(*visits) == ["loop.x.controller"]


def test_meshes_are_compared_by_their_content_and_textures_are_not(tmp_path):
    visits = write_visits(tmp_path)
    assets = (
        '<compiler meshdir="parts"/><asset><mesh name="m" file="foo.stl"/>'
        '<texture name="t" type="2d" file="wood.png"/></asset><worldbody>'
    )
    for number, folder in enumerate(visits):
        (folder / "model.xml").write_text(CHAIN.replace("<worldbody>", assets))
        (folder / "parts").mkdir()
        (folder / "parts" / "foo.stl").write_bytes(b"solid")
        (folder / "wood.png").write_bytes(bytes([number]))
    assert find_differences(*visits) == []
    (visits[1] / "parts" / "foo.stl").write_bytes(b"hollow")
    assert find_differences(*visits) == ["the mesh foo.stl"]


def test_the_model_of_a_test_is_looked_up_beside_its_campaign(tmp_path):
    first, second = write_visits(tmp_path)
    loaded = CHAIN.replace('mass="5"', 'mass="6"')
    (second / "loaded.xml").write_text(loaded)
    file = second / "campaign.toml"
    file.write_text(file.read_text() + 'model = "loaded.xml"\n')
    assert find_differences(first, second) == []
    folder = tmp_path / "both"
    folder.mkdir()
    write_states_campaign(first, second, folder, folder)
    (variant,) = open_session(folder).model.machine.variants.values()
    assert variant.source.samefile(second / "loaded.xml")


def test_two_machines_need_states(tmp_path):
    first, _ = write_visits(tmp_path)
    file = first / "campaign.toml"
    file.write_text("two_machines = true\n" + file.read_text())
    with pytest.raises(InputError, match="no test has a state"):
        open_session(first)
