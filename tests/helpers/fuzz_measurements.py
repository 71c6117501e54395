"""Fuzz targets of measurement files and meshes: universal files, .mat, .npz, shapes, bodies."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import h5py
import meshio
import numpy as np
import scipy.io
from identification_examples import (
    EVEN,
    FIRST,
    HEAD,
    SECOND,
    TEST,
    THIRD,
    UNEVEN,
    Function,
    dataset,
    numbers,
    read_written,
    uff,
    units,
    write_campaign,
)
from text_files import labview

from identification.readers.array_files import load_arrays
from identification.readers.array_frfs import read_arrays
from identification.readers.array_records import holds_time_records, read_array_records
from identification.readers.layout import read_layout
from identification.readers.uff_modes import read_uff_modes
from identification.readers.uff_records import read_uff_records
from identification.shapes import read_shapes
from mbmodel.meshes.files import read_mesh
from mbmodel.meshes.mass_properties import mesh_mass_properties
from tests.helpers.fuzzing import FuzzTarget

CHILD_SHARE = 0.15  # of the mutations in a test: each starts a process
MATLAB_73 = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
LABELS = 'channels = "nodes 1..2, xy"\nreferences = ["11:x", "7:-z"]\n'
NODES = dataset(
    "  2411", [line for k in (1, 2, 7) for line in (f"{k:10d}" * 4, f"{k}.5D-01 2.0E+00 3.25")]
)


@dataclass(frozen=True)
class Campaigns:
    """Writer of campaigns, each in a folder of its own with one file of FRFs.

    Args:
        files: content, or a function that writes it, by name of the file.
    """

    files: dict[str, bytes | Callable[[Path], None]]

    def __call__(self, folder: Path) -> Sequence[Path]:
        """Write the campaigns and return their files."""
        paths = []
        for number, (name, content) in enumerate(self.files.items()):
            place = folder / str(number)
            place.mkdir()
            is_array = name.endswith((".mat", ".npz"))
            arrays_text = HEAD + f'[[test]]\nfile = "{name}"\n{LABELS}'
            text = arrays_text if is_array else TEST.replace("a.uff", name)
            write_campaign(place, text)
            if isinstance(content, bytes):
                (place / name).write_bytes(content)
            else:
                content(place / name)
            paths.append(place / name)
        return paths


def read_measurement(path: Path) -> object:
    """Read the campaign to which a file belongs."""
    return read_written(path.parent)


def arrays() -> dict[str, np.ndarray]:
    """FRFs, coherence and frequencies; out, in, freq."""
    rng = np.random.default_rng(8)
    values = rng.normal(size=(4, 2, 9)) + 1j * rng.normal(size=(4, 2, 9))
    return {"FRFs": values, "COHs": rng.uniform(0.1, 0.9, values.shape), "freqs": EVEN}


def hits() -> dict[str, np.ndarray]:
    """Time records of three hits at one of two references."""
    rng = np.random.default_rng(9)
    shapes = {"force": (2, 3, 64), "response": (2, 3, 4, 64)}
    records = {name: rng.normal(size=shape) for name, shape in shapes.items()}
    return records | {"rate_hz": np.array(512.0)}


def save_matlab73(path: Path, **options: object) -> None:
    """Write a file as MATLAB 7.3 does, with options of h5py's datasets."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays().items():
            if np.iscomplexobj(values):
                pairs = np.empty(values.T.shape, [("real", "f8"), ("imag", "f8")])
                pairs["real"], pairs["imag"] = values.T.real, values.T.imag
                file.create_dataset(name, data=pairs, **options)
            else:
                file.create_dataset(name, data=values.T, **options)
        file.create_group("#refs#")["a"] = 1.0
    with path.open("r+b") as stream:
        stream.write(MATLAB_73)


def write_frfs(**options: object) -> Callable[[Path], None]:
    """Return a writer of FRFs in .mat."""
    return lambda path: scipy.io.savemat(path, arrays() | {"note": "x", "c": {"a": 1}}, **options)


def write_npz(compress: Callable[..., None], content: dict[str, np.ndarray]) -> Callable:
    """Return a writer of an archive of arrays."""
    names = {"FRFs": "frf", "COHs": "coherence", "freqs": "freq_hz"}
    return lambda path: compress(path, **{names.get(k, k): v for k, v in content.items()})


def write_array_records(folder: Path) -> Sequence[Path]:
    """Write time records as .mat and .npz."""
    paths = [folder / "hits.mat", folder / "hits.npz"]
    scipy.io.savemat(paths[0], hits())
    np.savez(paths[1], **hits())
    return paths


def read_recordings(path: Path) -> object:
    """Read the time records of a .mat or .npz file."""
    return read_array_records(
        path,
        load_arrays(path),
        channels="nodes 1..2, xy",
        references=["11:x", "7:-z"],
        quantity="accelerance",
        unit="g/N",
    )


def write_texts(folder: Path) -> Sequence[Path]:
    """Write FRFs and time records as text tables and as LabVIEW measurement files."""
    named = ["Frequency [Hz];re [g/N];im [g/N];coherence"]
    named += [f"{k};{k}.5;-0.25;1" for k in range(8)]
    plain = [f"{k} {value}" for k, value in enumerate(numbers(2, 8).tolist())]
    paths = [folder / name for name in ("a.csv", "b.txt", "c.lvm", "d.lvm")]
    paths[0].write_text("\n".join(named))
    paths[1].write_text("\n".join(plain))
    signals = np.real(numbers(3, 48)).reshape(2, 2, 12)
    paths[2].write_text(labview(signals, 256.0))
    paths[3].write_text(labview(signals, 256.0, x_columns="Multi", decimal=","))
    return paths


def read_texts(path: Path) -> object:
    """Read the FRFs or time records of a text file, with one channel."""
    options = {"channels": ["1:z"], "references": ["1:z"], "quantity": "accelerance", "unit": None}
    arrays = load_arrays(path)
    if holds_time_records(arrays):
        return read_array_records(path, arrays, **options)
    return read_arrays(path, **options)


def write_time_records(folder: Path) -> Sequence[Path]:
    """Write time records as universal files, ASCII and binary."""
    paths = []
    for order in ("", "<"):
        data = numbers(1, 48, real=True)
        force = Function(data, 0.01 * np.arange(48), (11, 3), (0, 0), 1, 13, order=order)
        motions = [replace(force, rsp=(7, k), ref=(11, 3), ordinate=12) for k in (1, 2)]
        paths.append(folder / f"hits{len(order)}.uff")
        paths[-1].write_bytes(uff(units(1.0, 1.0), force, *motions))
    return paths


def write_geometry(folder: Path) -> Sequence[Path]:
    """Write nodes and modes as datasets 2411, 15, 2420, 55 and 2414."""
    modes = []
    for kind, first in ((55, 3), (2414, 0)):
        values = [line for k in (1, 2, 7) for line in (f"{k:10d}", "".join(["  1.25E-01"] * 6))]
        kinds = "".join(f"{k:10d}" for k in (1, 3, 2, 8, 5, 3))
        rows = "".join(f"{v:13.5E}" for v in (-1.5, 61.6, 0.1, 123.2, 0.0, 0.0))
        head = ["NONE"] * 5 if first else [f"{1:10d}", "NONE", f"{1:10d}", *["NONE"] * 5]
        more = [f"{1:10d}" * 4] if first else [f"{1:10d}" * 8, f"{0:10d}" * 2, rows]
        modes.append(dataset(f"{kind:6d}", [*head, kinds, *more, rows, *values]))
    axes = ["1.0 0.0 0.0", "0.0 1.0 0.0", "0.0 0.0 1.0", "0.0 0.0 0.0"]
    systems = dataset("  2420", [f"{1:10d}", "part", f"{0:10d}" * 3, "global", *axes])
    plain = dataset("    15", [f"{k:10d}" * 4 + "  1.25E-01" * 3 for k in (1, 2, 7)])
    paths = [folder / "a.unv", folder / "b.unv"]
    paths[0].write_bytes(units(1.0, 1.0) + NODES + systems + modes[0])
    paths[1].write_bytes(plain + NODES + modes[1])
    return paths


def read_geometry(path: Path) -> object:
    """Read the modes and the nodes of a file."""
    return read_uff_modes(path), read_layout(path)


def write_shapes(folder: Path) -> Sequence[Path]:
    """Write the modes of a plate in three formats."""
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    corner = np.array([3 * i + j for i in range(3) for j in range(2)])
    cells = [("quad", corner[:, None] + np.array([0, 3, 4, 1]))]
    rng = np.random.default_rng(6)
    data = {f"mode{k}({10 * k}.5Hz)": rng.normal(size=points.shape) for k in (1, 2, 3)}
    paths = [folder / f"plate.{ending}" for ending in ("vtu", "med", "vtk")]
    for path in paths:
        meshio.Mesh(points, cells, point_data=data).write(path)
    return paths


def write_meshes(folder: Path) -> Sequence[Path]:
    """Write a box as STL, OBJ, MSH and VTU, in text and binary."""
    points = np.array([(x, y, z) for x in (0, 0.2) for y in (0, 0.1) for z in (0, 0.05)])
    quads = np.array(
        [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    )
    halves = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    surface = meshio.Mesh(points, {"triangle": halves})
    solid = meshio.Mesh(points, {"hexahedron": [[0, 4, 6, 2, 1, 5, 7, 3]]})
    paths = [folder / name for name in ("a.stl", "b.stl", "a.obj", "a.msh", "b.msh", "c.msh")]
    surface.write(paths[0], binary=False)
    surface.write(paths[1], binary=True)
    surface.write(paths[2])
    solid.write(paths[3], file_format="gmsh", binary=True)
    solid.write(paths[4], file_format="gmsh", binary=False)
    solid.write(paths[5], file_format="gmsh22", binary=False)
    solid.write(folder / "a.vtu")
    surface.write(folder / "b.vtu", binary=False)
    return [*paths, folder / "a.vtu", folder / "b.vtu"]


FIELD_FILES: dict[str, bytes | Callable[[Path], None]] = {
    "a.uff": uff(units(1e3, 1.0), FIRST, SECOND, THIRD),
    "b.uff": uff(NODES, *(replace(f, order="<") for f in (FIRST, SECOND)), THIRD),
    "c.uff": uff(replace(FIRST, x=UNEVEN, even=False), replace(SECOND, x=UNEVEN, even=False)),
    "d.uff": uff(*(replace(f, x=UNEVEN, even=False, order=">") for f in (FIRST, SECOND))),
    "e.uff": uff(replace(FIRST, single=True), replace(FIRST, func=6, data=np.full(9, 0.5))),
}
MEASUREMENT_TARGETS = (
    FuzzTarget("universal file", Campaigns(FIELD_FILES), read_measurement),
    FuzzTarget("universal time records", write_time_records, read_uff_records),
    FuzzTarget("universal nodes and modes", write_geometry, read_geometry),
    FuzzTarget(
        "mat",
        Campaigns(
            {
                "a.mat": write_frfs(),
                "b.mat": write_frfs(do_compression=True),
            }
        ),
        read_measurement,
    ),
    FuzzTarget(
        "npz",
        Campaigns(
            {
                "a.npz": write_npz(np.savez, arrays()),
                "b.npz": write_npz(np.savez_compressed, arrays()),
            }
        ),
        read_measurement,
    ),
    FuzzTarget("time records in mat and npz", write_array_records, read_recordings),
    FuzzTarget("text", write_texts, read_texts),
    FuzzTarget(
        "mat 7.3",
        Campaigns(
            {
                "a.mat": save_matlab73,
                "b.mat": partial(save_matlab73, compression="gzip", shuffle=True),
            }
        ),
        read_measurement,
        CHILD_SHARE,
    ),
    FuzzTarget("mesh of shapes", write_shapes, read_shapes, CHILD_SHARE),
)
MESH_TARGETS = (
    FuzzTarget(
        "mesh of a body", write_meshes, lambda path: mesh_mass_properties(read_mesh(path), 2700.0)
    ),
)
