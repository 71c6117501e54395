"""Layouts without a model: layout.toml, or the nodes of a universal file."""

import numpy as np
import pytest
from identification_examples import dataset, units
from scipy.spatial.transform import Rotation

from identification import read_layout
from identification.words import InputError

TOML = """\
[body.frame]
centre = [0.1, 0.2, 0.3]
[body.lid]

[site.acc1]
body = "frame"
position = [1.0, 2.0, 3.0]
turn = [0.0, 0.0, 0.5]
[site.acc2]
body = "lid"
position = [4.0, 5.0, 6.0]
[site.hit2]
body = "lid"
position = [5.0, 7.0, 9.0]
"""


@pytest.fixture
def read(tmp_path):
    def write(text: str):
        path = tmp_path / "layout.toml"
        path.write_text(text, encoding="utf-8")
        return read_layout(path)

    return write


def test_bodies_and_sites_are_where_the_file_has_them(read) -> None:
    layout = read(TOML)
    assert layout.bodies == ("frame", "lid")
    assert layout.points == ("acc1", "acc2", "hit2")
    assert layout.body_of.tolist() == [0, 1, 1]
    np.testing.assert_array_equal(layout.positions[0], [1, 2, 3])
    turned = Rotation.from_rotvec([0, 0, 0.5]).as_matrix()
    np.testing.assert_allclose(layout.axes[0], turned, rtol=1e-12)


def test_a_body_without_a_centre_has_it_amid_its_sites(read) -> None:
    np.testing.assert_allclose(read(TOML).centres, [[0.1, 0.2, 0.3], [4.5, 6.0, 7.5]])


def test_sites_alone_sit_on_one_structure(read) -> None:
    layout = read("[site.acc1]\nposition = [1, 2, 3]\n[site.acc2]\nposition = [3, 2, 1]\n")
    assert layout.bodies == ("structure",)
    np.testing.assert_allclose(layout.centres, [[2, 2, 2]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[site.a]\nposition = [1, 2]\n", "site.a.position"),
        ("[site.a]\nposition = [1, 2, nan]\n", "site.a.position"),
        ("[site.a]\n", "site.a.position is missing"),
        ("[body.b]\n", "site is missing"),
        (TOML.replace('body = "lid"', 'body = "lit"'), "names the unknown body 'lit'"),
        (TOML.replace('body = "frame"\n', ""), "site.acc1 names no body"),
        (TOML + "[body.loose]\n", "body.loose has neither"),
        (TOML.replace("[body.lid]", "[body.acc1]").replace('"lid"', '"acc1"'), "more than one"),
        (TOML + "colour = 1\n", "unknown key"),
        ("[site.a\n", "TOML syntax"),
    ],
)
def test_what_makes_no_layout_is_refused_by_name(read, text, words) -> None:
    with pytest.raises(InputError, match=r"layout\.toml") as caught:
        read(text)
    assert words in str(caught.value)


def test_nodes_of_a_universal_file_are_sites_in_metres(tmp_path) -> None:
    path = tmp_path / "nodes.unv"
    rows = [f"{node:10d}{0:10d}{0:10d}{11:10d}" for node in (3, 12)]
    places = ["".join(f"{v:25.16E}" for v in place) for place in ((1e3, 2e3, 0), (0, -5e2, 1))]
    nodes = [line.replace("E", "D") for pair in zip(rows, places, strict=True) for line in pair]
    path.write_bytes(units(1000.0, 1.0) + dataset("  2411", nodes))
    layout = read_layout(path)
    assert layout.points == ("acc3", "acc12")
    np.testing.assert_allclose(layout.positions, [[1, 2, 0], [0, -0.5, 0.001]], rtol=1e-12)


@pytest.mark.parametrize("name", ["layout.toml", "nodes.unv"])
def test_a_layout_that_is_not_there_is_refused(tmp_path, name) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_layout(tmp_path / name)


def test_a_universal_file_without_nodes_is_refused(tmp_path) -> None:
    path = tmp_path / "nodes.unv"
    path.write_bytes(units(1.0, 1.0))
    with pytest.raises(InputError, match="no nodes"):
        read_layout(path)


@pytest.mark.parametrize("name", ["a:3", ""])
@pytest.mark.parametrize("kind", ["site", "body"])
def test_a_name_that_no_label_holds_is_refused(read, kind, name) -> None:
    keys = {"site": "position = [0.0, 0.0, 0.0]", "body": "centre = [0.0, 0.0, 0.0]"}
    text = f'[{kind}."{name}"]\n{keys[kind]}\n' + ("" if kind == "site" else "[site.acc1]\n")
    text += "" if kind == "site" else "position = [1.0, 0.0, 0.0]\n"
    with pytest.raises(InputError, match="is no name of a body or site"):
        read(text)


def test_a_turn_in_degrees_is_refused(read) -> None:
    with pytest.raises(InputError, match=r"site\.acc1\.turn\.3 = 90\.0"):
        read(TOML.replace("turn = [0.0, 0.0, 0.5]", "turn = [0.0, 0.0, 90.0]"))
