"""``mbw place``: places that distinguish modes, and modes that a layout confuses."""

import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from identification.matching import shapes_at_channels
from identification.readers.layout import read_layout, read_sites
from identification.shapes import distinguish_modes, read_shapes
from mbw.command import app
from mbw.match.place import PlacementRequest, format_sites_table, propose_channels

SHAPES = Path(__file__).parents[2] / "assets" / "gondola" / "shapes.vtu"
BAND = ("--band", 15, 95)


def called(*arguments):
    return CliRunner().invoke(app, ["place", *map(str, arguments)])


def test_proposed_channels_tell_all_modes_and_are_some_way_apart(tmp_path):
    target = tmp_path / "places.csv"
    done = called(SHAPES, *BAND, "--channels", 12, "--apart", 0.3, "--out", target)
    assert done.exit_code == 0, done.output
    assert "no two modes are confused" in done.output
    layout, dofs = read_sites(target)
    assert len(dofs) == 12
    apart = np.linalg.norm(layout.positions[:, None] - layout.positions, axis=2)
    assert apart[~np.eye(len(apart), dtype=bool)].min() > 0.3 - 1e-9
    shapes = read_shapes(SHAPES).select(np.arange(6, 12))
    assert (
        distinguish_modes(shapes_at_channels(shapes, layout, dofs))
        .mac[~np.eye(6, dtype=bool)]
        .max()
        < 0.3
    )
    # No more is known of the amplitudes from twelve channels in random places.
    at = shapes_at_channels(shapes, layout, dofs)
    best = np.linalg.slogdet(at @ at.T)[1]
    random = np.random.default_rng(1)
    for _ in range(20):
        points = random.choice(len(shapes.points), 12, replace=False)
        some = shapes.vectors[:, points, random.integers(3, size=12)]
        assert np.linalg.slogdet(some @ some.T)[1] < best
    again = called(SHAPES, *BAND, "--check", target)
    assert again.exit_code == 0
    assert "12 channels at" in again.output


def test_a_table_is_read_as_it_was_written(tmp_path):
    shapes = read_shapes(SHAPES).select(np.arange(6, 10))
    layout, dofs = propose_channels(shapes, PlacementRequest(9, None, None))
    (tmp_path / "t.csv").write_text(format_sites_table(layout, dofs))
    seen, channels = read_sites(tmp_path / "t.csv")
    assert seen.points == layout.points
    assert seen.positions == pytest.approx(layout.positions, rel=1e-5)
    assert set(channels) == set(dofs)


def test_a_layout_is_looked_at_with_three_axes_at_every_site():
    done = called(SHAPES, *BAND, "--check", SHAPES.parent / "layout.toml")
    assert done.exit_code == 0, done.output
    assert re.search(r"(\d+) channels at", done.output)[1] == str(
        3 * len(read_layout(SHAPES.parent / "layout.toml").points)
    )


def test_confused_modes_of_a_layout_are_named_with_the_channels_that_differ(tmp_path):
    table = tmp_path / "few.csv"
    table.write_text("site,x,y,z,axes\na,0.7,-0.8,1.2,y\nb,0.8,-0.8,1,y\nc,0,0,1.2,x\n")
    done = called(SHAPES, *BAND, "--check", table)
    assert done.exit_code == 0, done.output
    assert "are confused; they differ most at" in done.output
    table.write_text("site,x,y,z,axes\nlow,0.7,-0.8,0.02,z\n")
    assert "hardly moves at these channels" in called(SHAPES, *BAND, "--check", table).output


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("site,x,y\n", "the first row must be site,x,y,z,axes"),
        ("site,x,y,z,axes\na,0,0,1,q\n", "row 2 is not a site"),
        ("site,x,y,z,axes\na,0,zero,1,x\n", "row 2 is not a site"),
        ("site,x,y,z,axes\na,0,0,1,x\na,0,0,1.2,x\n", "row 3: a is there twice"),
        ("site,x,y,z,axes\na,0,0,1,\n", "has no axis"),
        ("site,x,y,z,axes\n", "has no site"),
        ("site,x,y,z,axes\nfar,9,0,1,x\n", "far at (9, 0, 1) m is"),
    ],
)
def test_a_table_that_is_wrong_is_refused(tmp_path, text, said):
    table = tmp_path / "t.csv"
    table.write_text(text)
    done = called(SHAPES, *BAND, "--check", table)
    assert done.exit_code == 3
    assert said in " ".join(done.output.split())


def test_too_few_channels_and_empty_bands_are_refused():
    few = called(SHAPES, *BAND, "--channels", 4)
    assert few.exit_code == 2
    assert "cannot tell 6 modes apart" in " ".join(few.output.split())
    none = called(SHAPES, "--band", 1, 5)
    assert none.exit_code == 3
    assert "no mode between 1 and 5 Hz" in " ".join(none.output.split())
    assert called(SHAPES, "--check", SHAPES.parent / "nothing.csv").exit_code == 3
