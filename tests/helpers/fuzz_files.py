"""Fuzz targets of all files that are no measurement: settings, tables, models and own results."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from unittest.mock import patch

import meshio
import numpy as np
from typer.testing import CliRunner

from identification.impacts import read_impacts
from identification.readers.layout import read_layout, read_sites
from identification.shapes import fe_file, read_shapes
from identification.shapes.fe_mesh import read_fe_mesh
from mbmodel import load_machine
from mbw.command import app
from mbw.report.verb import run as report
from tests.helpers.campaign_folder import write_folder
from tests.helpers.diagnosed import diagnosed
from tests.helpers.fuzzing import FuzzTarget
from tests.helpers.small_machine import MJCF
from tests.helpers.virtual_gondola import Trial, read_structure, write_impacts
from tuning import open_session
from tuning.fitting.checkpoint import Checkpoint
from tuning.solvers.nlopt_solver import Minimum

MESH_OF_SHAPES = cache(read_fe_mesh)
GONDOLA = Path(__file__).parents[2] / "assets" / "gondola"
STRIKES = ("bow2", "bow3")
LAYOUT = """\
[body.base]
centre = [0.0, 0.1, 0.2]
[body.head]
[site.acc1]
position = [0.1, 0.2, 0.3]
body = "base"
[site.acc2]
position = [0.4, 0.5, 0.6]
body = "head"
turn = [0.0, 0.0, 1.57]
"""
CORRECTIONS = """
spindle_speed = 12.5
setup = "a"
[sensor.acc2]
flip = ["x"]
turn = [0.0, 0.1, 0.0]
[tolerance]
mass = 0.02
sensor_angle = 0.01745
[tuning]
free = ["head_ty.stiffness"]
prior = { "base*.damping" = 0.3 }
bounds = { "head_tx.stiffness" = [1e3, 1e9] }
"""


def write_campaign(folder: Path) -> Sequence[Path]:
    """Write a small campaign with many keys."""
    write_folder(folder, lines=40)
    path = folder / "campaign.toml"
    path.write_text(path.read_text() + CORRECTIONS)
    return [path]


def write_layout(folder: Path) -> Sequence[Path]:
    """Write a layout of two bodies."""
    path = folder / "layout.toml"
    path.write_text(LAYOUT)
    return [path]


def write_impact_campaign(folder: Path) -> Sequence[Path]:
    """Write a campaign of two impacts, one of them as a table of few channels."""
    structure = read_structure(GONDOLA / "truths.npz", 11)
    trial = Trial(39_100, seconds=2.5, quiet=0.5)
    write_impacts(folder, structure, trial, STRIKES, GONDOLA / "layout.toml")
    settings = folder / "campaign.toml"
    text = settings.read_text()
    for point in STRIKES:
        text = text.replace(f"{point}.npz", f"{point}.csv")
        with np.load(folder / f"{point}.npz") as arrays:
            rows = [
                f"{name},{time!r},{value!r}"
                for name in [key.removeprefix("time_") for key in arrays if key < "time_acc3"][:3]
                for time, value in zip(
                    arrays[f"time_{name}"].tolist(), arrays[f"value_{name}"].tolist(), strict=True
                )
            ]
        (folder / f"{point}.csv").write_text("\n".join(["channel,time,value", *rows]) + "\n")
    settings.write_text(text)
    return [folder / "bow2.csv", settings]


def write_sites(folder: Path) -> Sequence[Path]:
    """Write a table of sites."""
    path = folder / "sites.csv"
    path.write_text("site,x,y,z,axes\nacc1,0.1,0.2,-0.3,xyz\nacc2,1e-1,0,0.25,z\nacc3,1,2,3,xz\n")
    return [path]


def write_frequencies(folder: Path) -> Sequence[Path]:
    """Write a mesh with three shapes, and a table of their frequencies."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    shapes = {f"mode{k}": np.roll(points, k, axis=1) for k in range(3)}
    mesh = meshio.Mesh(points, [("tetra", [[0, 1, 2, 3]])], point_data=shapes)
    mesh.write(folder / "shapes.vtk")
    path = folder / "frequencies.txt"
    path.write_text("# mode, frequency in Hz\n1, 10.5\n2, 20.25\n3, 30\n")
    return [path]


def write_checkpoint(folder: Path) -> Sequence[Path]:
    """Write two finished steps."""
    checkpoint = Checkpoint(folder / "kept.json", "of these inputs")
    for name in ("start 0", "fold 1"):
        checkpoint.keep(name, Minimum(np.arange(3) / 7, 1.25, 17, "converged", ""))
    return [folder / "kept.json"]


def write_model(folder: Path) -> Sequence[Path]:
    """Write the MJCF of a small machine."""
    path = folder / "model.xml"
    path.write_text(MJCF)
    return [path]


@dataclass(frozen=True)
class ResultWriter:
    """Writer of the result of a verb.

    Args:
        verb: verb and its options, after a small campaign.
        names: files of the result that ``mbw report`` reads.
    """

    verb: tuple[str, ...]
    names: tuple[str, ...]

    def __call__(self, folder: Path) -> Sequence[Path]:
        """Run the verb on a small campaign and return the files of its result."""
        campaign, out = write_folder(folder / "campaign"), folder / "result"
        done = CliRunner().invoke(
            app, [self.verb[0], str(campaign), "--out", str(out), *self.verb[1:]]
        )
        assert done.exit_code == 0, done.output
        return [out / name for name in self.names]


def write_diagnosis(folder: Path) -> Sequence[Path]:
    """Diagnose a small campaign."""
    result = diagnosed("explained", folder)
    names = ("verdict.json", "evidence.json", "diagnosis.json", "diagnosis.npz")
    return [result / name for name in names]


def write_match(folder: Path) -> Sequence[Path]:
    """Match a short virtual test of a gondola."""
    structure = read_structure(GONDOLA / "truths.npz", 11)
    points = ("bow2", "bow3", "stern2")
    write_impacts(
        folder / "test", structure, Trial(71_703, seconds=6.0), points, GONDOLA / "layout.toml"
    )
    words = ["match", str(GONDOLA / "shapes.vtu"), str(folder / "test"), "--quiet"]
    done = CliRunner().invoke(app, [*words, "--out", str(folder / "out")])
    assert done.exit_code == 0, done.output
    return [folder / "out" / name for name in ("match.json", "match.npz")]


def read_page(path: Path) -> object:
    """Write the page of the result to which a file belongs."""
    return report(path.parent, None)


def read_with_frequencies(path: Path) -> object:
    """Read shapes with a table of frequencies; their mesh is read once."""
    with patch.object(fe_file, "read_fe_mesh", MESH_OF_SHAPES):
        return read_shapes(path.parent / "shapes.vtk", path)


FILE_TARGETS = (
    FuzzTarget("campaign.toml", write_campaign, lambda path: open_session(path.parent)),
    FuzzTarget("layout.toml", write_layout, read_layout),
    FuzzTarget("impacts", write_impact_campaign, lambda path: read_impacts(path.parent).spectra()),
    FuzzTarget("table of sites", write_sites, read_sites),
    FuzzTarget(
        "table of frequencies",
        write_frequencies,
        read_with_frequencies,
    ),
    FuzzTarget(
        "checkpoint",
        write_checkpoint,
        lambda path: Checkpoint(path, "of these inputs", resume=True),
    ),
    FuzzTarget("MJCF", write_model, load_machine),
    FuzzTarget(
        "result of tune",
        ResultWriter(("tune", "--quiet"), ("tuned.json", "frf.npz")),
        read_page,
    ),
    FuzzTarget(
        "result of identify",
        ResultWriter(("identify", "--quiet"), ("modes.json", "modes.npz")),
        read_page,
    ),
    FuzzTarget("result of diagnose", write_diagnosis, read_page),
    FuzzTarget("result of match", write_match, read_page),
)
