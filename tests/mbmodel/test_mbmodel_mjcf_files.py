"""Files of an MJCF: which are read, and what in them is refused before MuJoCo sees it."""

import numpy as np
import pytest
from mbmodel_examples import STATION, mass_on_spring, mjcf

from identification.words import Dof, InputError
from mbmodel import load_machine, mjcf_files
from mbmodel.mjcf.source_files import read_source_files

GOOD = mjcf(mass_on_spring(4, 3e4, 7))
PART = f"<mujoco><default/>{mass_on_spring(2, 1e4, 1, name='b', node=2)}</mujoco>"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def save(folder, text, name="m.xml", encoding="utf-8"):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return path


@pytest.mark.parametrize(
    "word",
    ["inf", "-INF", "infinity", "nan", "nan(1)", "NaN", "1e308", "1e16", "-1e400", "0x1p2000"],
)
@pytest.mark.parametrize(
    ("attribute", "element"),
    [("stiffness", "joint 'a_j'"), ("mass", "inertial"), ("gravity", "option")],
)
def test_numbers_without_meaning_are_refused_by_element_and_attribute(
    tmp_path, word, attribute, element
):  # fmt: skip
    old = {"stiffness": 'stiffness="30000"', "mass": 'mass="4"', "gravity": 'gravity="0 0 0"'}
    new = f'{attribute}="0 0 {word}"' if attribute == "gravity" else f'{attribute}="{word}"'
    text = GOOD.replace(old[attribute], new)
    assert text != GOOD
    with pytest.raises(InputError, match=rf"m\.xml: {element} has {attribute}=.*finite numbers"):
        load_machine(save(tmp_path, text))


@pytest.mark.parametrize("word", ["", "  "])
def test_an_attribute_without_a_number_is_refused(tmp_path, word):
    text = GOOD.replace('stiffness="30000"', f'stiffness="{word}"')
    with pytest.raises(InputError, match=r"joint 'a_j' has stiffness=.*: give a value, or leave"):
        load_machine(save(tmp_path, text))


def test_names_may_look_like_numbers(tmp_path):
    text = GOOD.replace('"a_j"', '"inf"').replace('"a"', '"nan"')
    text = text.replace(
        "</mujoco>", '<actuator><motor name="1e400" joint="inf"/></actuator></mujoco>'
    )
    machine = load_machine(save(tmp_path, text))
    assert (machine.coordinates, machine.layout.bodies) == (("inf",), ("nan",))
    assert list(machine.motors) == ["1e400"]


NAMED = GOOD.replace('name="a"', 'name="T\u00fcr"')


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (NAMED.encode("latin-1"), "line 1: the text is not UTF-8"),
        (b'<?xml version="1.0" encoding="iso-8859-1"?>' + NAMED.encode("latin-1"), "not UTF-8"),
        (b'<?xml version="1.0" encoding="iso-8859-1"?>' + NAMED.encode(), "encoding iso-8859-1"),
        (GOOD.encode("utf-16"), "not UTF-8"),
        (GOOD.replace("<mujoco", "<mujoco\0").encode(), "not well-formed"),
        (b"", "not well-formed"),
    ],
)
def test_text_that_mujoco_would_misread_is_refused(tmp_path, content, words):
    with pytest.raises(InputError, match=words):
        load_machine(save(tmp_path, content))


@pytest.mark.parametrize(
    "head", [b"", b"\xef\xbb\xbf", b'<?xml version="1.0" encoding="UTF-8"?>\n']
)
def test_names_in_utf8_are_read(tmp_path, head):
    machine = load_machine(save(tmp_path, head + NAMED.encode()))
    assert machine.layout.bodies == ("T\u00fcr",)


def test_another_encoding_of_plain_letters_is_no_obstacle(tmp_path):
    content = b'<?xml version="1.0" encoding="iso-8859-1"?>' + GOOD.encode()
    assert load_machine(save(tmp_path, content)).coordinates == ("a_j",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!DOCTYPE m [<!ENTITY k "4000">]>' + GOOD.replace("30000", "&k;"), "declares the entity"),
        (
            '<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>' + GOOD,
            "declares the entity 'a'",
        ),
        ("<mujoco><worldbody>" + "<body>" * 5000 + "</body>" * 5000 + "</worldbody></mujoco>",
         "nested more than 400 deep"),
        (GOOD + "trailing", "not well-formed"),
    ],
)  # fmt: skip
def test_xml_that_grows_or_is_broken_is_refused(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        load_machine(save(tmp_path, text))


@pytest.mark.parametrize(
    ("element", "words"),
    [
        (
            '<replicate count="1e7" offset="0 0 1"><site/></replicate>',
            r"<replicate.*1e\+07 el",
        ),
        (
            '<replicate count="300"><replicate count="300"><geom/></replicate></replicate>',
            r"makes 9\.\d*e\+04 elements",
        ),
        ('<composite count="1000 1000 1000"/>', r'<composite count="1000 1000 1000"> makes 1e\+09'),
    ],
)
def test_elements_that_grow_beyond_any_machine_are_refused(tmp_path, element, words):
    with pytest.raises(InputError, match=words):
        load_machine(save(tmp_path, GOOD.replace("<worldbody>", f"<worldbody>{element}")))


@pytest.mark.parametrize(
    "element",
    [
        '<hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/>',
        '<texture name="t" type="2d" builtin="flat" width="30000" height="30000"/>',
    ],
)
def test_assets_of_absurd_size_are_refused_before_they_are_allocated(tmp_path, element):
    text = GOOD.replace("<worldbody>", f"<asset>{element}</asset><worldbody>")
    with pytest.raises(InputError, match=r"=\"30000\"> makes 9e\+08 points, more than 1e\+07"):
        load_machine(save(tmp_path, text))


def test_a_few_copies_are_no_obstacle(tmp_path):
    element = '<replicate count="50" offset="0 0 1"><site/></replicate>'
    text = GOOD.replace("<worldbody>", f"<worldbody>{element}")
    assert load_machine(save(tmp_path, text)).coordinates == ("a_j",)


def including(name, text=GOOD):
    return text.replace("<worldbody>", f'<worldbody><include file="{name}"/>')


def test_included_files_are_read_and_checked(tmp_path):
    path = save(tmp_path, including("parts/b.xml"))
    save(tmp_path, PART.replace("<default/>", ""), "parts/b.xml")
    assert load_machine(path).coordinates == ("b_j", "a_j")
    save(tmp_path, PART.replace("<default/>", "").replace("10000", "nan(2)"), "parts/b.xml")
    with pytest.raises(InputError, match=r"b\.xml: joint 'b_j' has stiffness='nan\(2\)'"):
        load_machine(path)


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"m.xml": including("gone.xml")}, r"m\.xml: the file .*gone\.xml.* does not exist"),
        ({"m.xml": including("m.xml")}, "includes itself"),
        (
            {"m.xml": including("b.xml"), "b.xml": '<mujoco><include file="m.xml"/></mujoco>'},
            r"b\.xml: m\.xml is included more than once, or includes itself",
        ),
        ({"m.xml": including("")}, "names no file"),
        (
            {"m.xml": including("b.xml"), "b.xml": "<mujoco><body>"},
            r"b\.xml, line 1: not well-formed",
        ),
        (
            {"m.xml": GOOD.replace("<worldbody>", '<asset><model name="s" file="s.xml"/></asset>'
                                   '<worldbody><attach model="s" prefix="s_" body="x"/>'),
             "s.xml": GOOD.replace("<worldbody>", '<asset><model name="m" file="m.xml"/></asset>'
                                   '<worldbody><body name="x"/>')},
            r"s\.xml: m\.xml attaches itself",
        ),
        ({"m.xml": mjcf(mass_on_spring(4, 3e4, 7).replace(
            "<site", '<geom type="mesh" mesh="t"/><site'),
            extra='<asset><mesh name="t" file="t.obj"/></asset>')}, "t.obj"),
    ],
)  # fmt: skip
def test_missing_files_and_loops_are_refused(tmp_path, files, words):
    for name, text in files.items():
        save(tmp_path, text, name)
    with pytest.raises(InputError, match=words):
        load_machine(tmp_path / "m.xml")


def test_every_file_that_is_read_is_named(tmp_path):
    sub = (
        '<asset><mesh name="u" file="u.obj"/></asset><worldbody><body name="cover">'
        '<geom type="mesh" mesh="u"/></body></worldbody>'
    )
    text = mjcf(
        mass_on_spring(4, 3e4, 7).replace(
            "</body>",
            '<attach model="s" prefix="s_" body="cover"/><geom type="mesh" mesh="t"/></body>',
            1,
        )
        + '<include file="part.xml"/>',
        extra='<compiler meshdir="shapes"/><asset><mesh name="t" file="t.obj"/>'
        '<model name="s" file="sub/s.xml"/></asset>',
    )
    wanted = [
        save(tmp_path, text),
        save(tmp_path, '<mujoco><include file="inner.xml"/></mujoco>', "part.xml"),
        save(tmp_path, PART.replace("<default/>", ""), "inner.xml"),
        save(tmp_path, TETRAHEDRON, "shapes/t.obj"),
        save(tmp_path, f"<mujoco>{sub}</mujoco>", "sub/s.xml"),
        save(tmp_path, TETRAHEDRON, "sub/u.obj"),
    ]  # fmt: skip
    save(tmp_path, "unused", "shapes/notes.txt")
    machine = load_machine(wanted[0])
    assert machine.coordinates == ("a_j", "b_j")
    assert mjcf_files(wanted[0]) == tuple(sorted(wanted))
    # A file counts only if it is read: without any one of them the machine cannot be loaded.
    for file in wanted[1:]:
        file.rename(file.with_suffix(".gone"))
        with pytest.raises(InputError):
            load_machine(wanted[0])
        file.with_suffix(".gone").rename(file)
    np.testing.assert_array_equal(load_machine(wanted[0]).mass, machine.mass)


def test_the_stations_meshes_are_among_its_files():
    files = mjcf_files(STATION)
    assert len(files) == 7
    assert [file for file in files if file.parent.name != "meshes"] == [STATION]
    assert [file.path for file in read_source_files(STATION)] == [STATION]


def test_mujoco_leaves_no_log_behind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = GOOD.replace("<compiler", '<compiler settotalmass="9"')
    (remark,) = load_machine(save(tmp_path, text)).remarks
    assert remark.startswith("MuJoCo warns: compiler attribute 'settotalmass' is deprecated")
    assert [file.name for file in tmp_path.iterdir()] == ["m.xml"]


def test_options_that_an_attached_model_loses_are_remarked(tmp_path):
    arm = mjcf(mass_on_spring(2, 1e4, 1, name="arm", node=7), gravity="0 0 -3")
    save(tmp_path, arm, "arm.xml")
    text = mjcf(
        mass_on_spring(4, 3e4, 7).replace(
            "<site", '<attach model="s" prefix="s_" body="arm"/><site'
        ),
        extra='<asset><model name="s" file="arm.xml"/></asset>',
    ).replace('<option gravity="0 0 0"/>', "")
    machine = load_machine(save(tmp_path, text))
    assert machine.gravity[2] == pytest.approx(-9.81)
    assert any("gravity" in text and "child has 0 0 -3" in text for text in machine.remarks)
    assert machine.layout.sensors == ("acc1", "s_acc7")


def test_a_prefix_of_an_attached_model_may_give_names_with_a_colon(tmp_path):
    save(tmp_path, GOOD, name="part.xml")
    asset = '<asset><model name="part" file="part.xml"/></asset>'
    attach = '<body><attach model="part" body="a" prefix="{}"/></body>'
    text = f"<mujoco>{asset}<worldbody>{attach}</worldbody></mujoco>"
    assert load_machine(save(tmp_path, text.format("left_"))).coordinates == ("left_a_j",)
    machine = load_machine(save(tmp_path, text.format("left:")))
    assert machine.layout.bodies == ("left:a",)
    assert machine.layout.parse("left:a:+tx") == Dof("left:a", "+tx")
