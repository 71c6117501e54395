"""Places of a verdict on its page: rows for all, links as lines, frames of positions."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from browser import CHROMIUM, GL, browse, data_of
from diagnosed import diagnosed, plain

from diagnosis.verdict.schema import CauseRow
from diagnosis.verdict.sentences import place_name
from mbmodel import load_machine
from mbw.diagnose.effect_parameters import parameter_words
from mbw.diagnose.link_axis import axis_words, link_axis, principal_axis
from mbw.diagnose.page import render
from mbw.results.diagnosed_files import list_linked, place_row, read_result
from mbw.results.diagnosed_schema import PlaceRow

ROOT = Path(__file__).resolve().parents[2]
LINK = "pair:stage1-stage3"
PROBE = """<script>
addEventListener("load", () => setTimeout(() => {
  const link = () => byId("picture").data.find(t => t.name === "link");
  const line = () => [link().x, link().y, link().z];
  const found = {drawn, chosen: byId("chosen").textContent, faults: FAULTS};
  if (drawn) found.ends = line();
  byId("where").emit("plotly_click", {points: [{pointNumber: 1}]});
  setTimeout(() => {
    if (drawn) found.other = line();
    document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
  }, 800);
}, 1500));
</script>"""


@pytest.fixture(scope="module")
def explained(tmp_path_factory):
    return read_result(diagnosed("explained", tmp_path_factory.mktemp("places")))


def cause(effect, location, **parameters):
    return CauseRow(
        effect=effect, location=location, dof=None, probability=0.9, parameters=parameters,
        interval={}, excess_after=1.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def linked(explained):
    """The diagnosis as if it had found a link, with a confounded cause elsewhere."""
    rows = [
        cause("parallel_path", LINK, stiffness=4.5e5, damping=50.0),
        cause("mass_error", "body:stage2", mass=3.0, position=(0.1, 0.0, -0.02)),
    ]
    verdict = explained.verdict.model_copy(
        update={
            "causes": rows,
            "where": [explained.verdict.where[0].model_copy(update={"location": LINK})],
            "twins": [(f"parallel_path@{LINK}", "joint_coupling@joint:stage3")],
        }
    )
    ends = [(0.0, 0.1, 0.5), (-0.2, 0.0, 1.9)]
    place = PlaceRow(bodies=["stage1", "stage3"], points=[(-0.1, 0.05, 1.2)], line=ends)
    places = {**explained.shown.places, LINK: place.model_copy(update={"axis": (0.0, 0.6, 0.8)})}
    shown = explained.shown.model_copy(update={"means": ["", ""], "places": places})
    return replace(explained, verdict=verdict, shown=shown)


def test_every_place_that_a_verdict_names_has_a_row(linked):
    rows = [row["name"] for row in data_of(render(linked))["places"]]
    assert rows[:3] == [place_name(LINK), "body stage2", "joint stage3"]
    assert len(rows) == len(set(rows))


def test_a_link_says_its_ends_and_its_axis(linked):
    page = render(linked)
    (row,) = [row for row in data_of(page)["places"] if row["line"]]
    assert row["line"] == [[0.0, 0.1, 0.5], [-0.2, 0.0, 1.9]]
    assert row["note"] == (
        "link between the centres of mass of stage1 and stage3; it is stiffest along "
        "(0.00, 0.60, 0.80), in world axes"
    )
    assert "along (0.00, 0.60, 0.80), world axes</td>" in page


def test_positions_say_their_frame(linked):
    page = plain(render(linked))
    frame = "from the body's centre of mass as drawn, in world axes"
    assert frame.replace("'", "&#x27;") in page
    words = parameter_words("mass_error", None, "position", (0.1, 0.0, -0.02))
    assert words == f"position (100, 0, -20) mm {frame}"
    assert parameter_words("mass_error", None, "mass", 3.0) == "mass 3 kg"


def test_the_axis_of_a_link_is_that_of_its_largest_stiffness():
    # A stiff spring along y, turned towards -x, and a soft one along z.
    named = {"x": 0.0, "y": 5e4, "z": 1e3, "yz": 0.0, "xz": 0.0, "xy": -0.75}
    assert principal_axis(named) == pytest.approx((-0.6, 0.8, 0.0), abs=1e-9)
    assert principal_axis(dict.fromkeys("xyz", 3.0)) is None
    assert axis_words(None) == "alike in several directions"
    names = [
        f"pair0-2.link3.{kind}_{entry}" for kind in ("stiffness", "damping") for entry in named
    ]
    model = SimpleNamespace(
        parameters=[SimpleNamespace(name=name) for name in names], locations=[LINK] * len(names)
    )
    gap = SimpleNamespace(
        refit=SimpleNamespace(session=SimpleNamespace(model=model)),
        theta=np.array([*named.values(), *[7.0] * 6]),
    )
    diagnosis = SimpleNamespace(after=gap, parameters=None)
    assert link_axis(diagnosis, LINK) == pytest.approx((-0.6, 0.8, 0.0), abs=1e-9)
    assert link_axis(diagnosis, "body:stage1") is None


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_picture_draws_a_link_as_a_line(linked, tmp_path):
    found = browse(render(linked), tmp_path, *GL, probe=PROBE)
    assert found["faults"] == []
    assert found["chosen"].startswith("pair stage1-stage3: link between")
    if found["drawn"]:
        assert found["ends"] == [[0.0, -0.2], [0.1, 0.0], [0.5, 1.9]]
        assert found["other"] == [[], [], []]


def test_a_link_to_the_ground_has_a_row_without_a_line(explained):
    machine = load_machine(ROOT / "assets" / "two_bodies.xml")
    body = machine.layout.bodies[-1]
    row = place_row(f"pair:world-{body}", machine)
    assert row.bodies == [body]
    assert row.line == []
    assert row.points == [pytest.approx(tuple(machine.layout.centres[-1]))]
    place = f"pair:world-{body}"
    verdict = explained.verdict.model_copy(
        update={"causes": [cause("parallel_path", place, stiffness=4.5e5, damping=50.0)]}
    )
    shown = explained.shown.model_copy(
        update={"means": [""], "places": {**explained.shown.places, place: row}}
    )
    page = render(replace(explained, verdict=verdict, shown=shown))
    assert place_name(place) in [drawn_row["name"] for drawn_row in data_of(page)["places"]]


def test_a_link_to_the_ground_stands_at_its_body():
    bodies = ("base-plate", "head")
    assert list_linked("base-plate-head", bodies) == ["base-plate", "head"]
    assert list_linked("world-head", bodies) == ["head"]
    assert list_linked("world-base-plate", bodies) == ["base-plate"]
    assert list_linked("head-world", bodies) == []
