"""Universal files by a small writer of our own, a layout with no symmetry, campaigns on disk."""

import io
import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from identification import correct_layout, read_campaign, read_settings
from identification.words import Campaign, Dof, Frf, FrfEstimate, Layout

MARK = b"    -1"
EVEN = 0.75 + 0.25 * np.arange(9)  # exact in binary and in E13.5
UNEVEN = np.array([0.5, 0.75, 1.25, 1.5, 2.25, 3.0, 3.125, 4.5, 7.0])


def numbers(seed: int, shape=9, *, real: bool = False) -> np.ndarray:
    """No two alike, of magnitudes from 1e-3 to 1e3."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-3, 3, shape)
    return size * rng.choice([-1, 1], shape) if real else size * np.exp(6j * rng.random(shape))


def dataset(kind: str, lines: list[str], *, newline: bytes = b"\n") -> bytes:
    """Any ASCII dataset between its marks; ``kind`` fills columns 1 to 6 and what follows."""
    return newline.join([MARK, kind.encode(), *(line.encode() for line in lines), MARK, b""])


def units(length: float, force: float, *, newline: bytes = b"\n") -> bytes:
    """Dataset 164, with the D exponents of Fortran."""
    first = "".join(f"{f:25.16E}" for f in (length, force, 1.0)).replace("E", "D")
    lines = [f"{9:10d}{'user':>20}{1:10d}", first, f"{273.15:25.16E}".replace("E", "D")]
    return dataset("   164", lines, newline=newline)


@dataclass(frozen=True)
class Function:
    """One dataset 58 or 58b; nodes and directions as in the file."""

    data: np.ndarray
    x: np.ndarray = field(default_factory=lambda: EVEN)
    rsp: tuple[int, int] = (7, 1)
    ref: tuple[int, int] = (11, 3)
    func: int = 4
    ordinate: int = 12
    even: bool = True
    single: bool = False
    order: str = ""  # "<" or ">" for 58b, ASCII otherwise
    newline: bytes = b"\n"
    announced_bytes: int | None = None
    announced_values: int | None = None
    float_format: int = 2
    tail: bytes = b"\n"  # between binary data and end mark
    title: bytes = b"NONE"
    motion_unit: str = "NONE"  # labels of ordinate and its denominator
    force_unit: str = "NONE"

    def content(self) -> bytes:
        """The dataset, marks included."""
        payload = self._binary() if self.order else self._ascii()
        kind = f"{58:6d}"
        if self.order:
            announced = len(payload) if self.announced_bytes is None else self.announced_bytes
            ordering = 1 if self.order == "<" else 2
            kind += f"b{ordering:6d}{self.float_format:6d}{11:12d}{announced:12d}"
            kind += f"{0:6d}{0:6d}{0:12d}{0:12d}"
        head = [MARK, kind.encode(), self.title, *[b"NONE"] * 4, *self._header()]
        tail = self.tail if self.order else b""
        return self.newline.join([*head, b""]) + payload + tail + MARK + self.newline

    def _header(self) -> list[bytes]:
        ordinate_type = {(0, 1): 2, (0, 0): 4, (1, 1): 5, (1, 0): 6}[
            int(np.iscomplexobj(self.data)), int(self.single)
        ]
        count = len(self.data) if self.announced_values is None else self.announced_values
        start, step = (self.x[0], self.x[1] - self.x[0]) if self.even else (0.0, 0.0)
        lines = [
            f"{self.func:5d}{0:10d}{0:5d}{0:10d} {'NONE':10}{self.rsp[0]:10d}{self.rsp[1]:4d}"
            f" {'NONE':10}{self.ref[0]:10d}{self.ref[1]:4d}",
            f"{ordinate_type:10d}{count:10d}{int(self.even):10d}{start:13.5E}{step:13.5E}{0:13.5E}",
        ]
        for kind, label, unit in (
            (18, "Frequency", "NONE"),
            (self.ordinate, "NONE", self.motion_unit),
            (13, "Force", self.force_unit),
            (0, "NONE", "NONE"),
        ):
            lines.append(f"{kind:10d}{0:5d}{0:5d}{0:5d} {label:20} {unit:20}")
        return [line.encode() for line in lines]

    def _columns(self) -> np.ndarray:
        parts = [] if self.even else [self.x]
        parts += [self.data.real, self.data.imag] if np.iscomplexobj(self.data) else [self.data]
        return np.column_stack(parts)

    def _binary(self) -> bytes:
        flat = self._columns().ravel()
        return struct.pack(f"{self.order}{flat.size}{'f' if self.single else 'd'}", *flat)

    def _ascii(self) -> bytes:
        flat = self._columns().ravel()
        if self.single:
            widths = [(13, 5)] * 6
        elif self.even:
            widths = [(20, 12)] * 4
        elif np.iscomplexobj(self.data):
            widths = [(13, 5), (20, 12), (20, 12)]
        else:
            widths = [(13, 5), (20, 12)] * 2
        lines = []
        for start in range(0, flat.size, len(widths)):
            row = zip(flat[start : start + len(widths)], widths, strict=False)
            lines.append("".join(f"{v:{w}.{d}E}" for v, (w, d) in row).encode())
        return self.newline.join([*lines, b""])


def a_layout() -> Layout:
    """Two bodies, four sensors at skew axes, a hammer point at node 11, a site without number."""
    rng = np.random.default_rng(17)
    points = ("acc1", "acc2", "acc7", "acc11", "hit11", "focus")
    return Layout(
        bodies=("low", "top"),
        centres=rng.normal(size=(2, 3)),
        points=points,
        body_of=np.array([0, 0, 1, 1, 1, 1]),
        positions=rng.normal(size=(6, 3)),
        axes=Rotation.random(6, random_state=3).as_matrix(),
    )


def random_layout(seed: int, *, n_body: int, n_sensor: int) -> Layout:
    """Sensors p<body>_<k> at random places within some 0.3 m of the centre, axes at random."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(n_body, 3))
    total = n_body * n_sensor
    body_of = np.repeat(np.arange(n_body), n_sensor)
    return Layout(
        bodies=tuple(f"body{k}" for k in range(n_body)),
        centres=centres,
        points=tuple(f"p{body}_{k}" for body in range(n_body) for k in range(n_sensor)),
        body_of=body_of,
        positions=centres[body_of] + 0.3 * rng.normal(size=(total, 3)),
        axes=Rotation.random(total, random_state=seed % 2**31).as_matrix(),
    )


def read_by_hand(layout: Layout, dof: Dof, motion: np.ndarray) -> np.ndarray:
    """What a channel reads, from v + theta x r alone; motion (..., 6 n_body, n_in)."""
    k = layout.points.index(dof.point)
    body = layout.body_of[k]
    arm = layout.positions[k] - layout.centres[body]
    velocity = np.moveaxis(motion[..., 6 * body : 6 * body + 3, :], -2, -1)
    theta = np.moveaxis(motion[..., 6 * body + 3 : 6 * body + 6, :], -2, -1)
    axis = layout.axes[k][:, dof.axis % 3] * dof.sign
    return (theta if dof.is_rotation else velocity + np.cross(theta, arm)) @ axis


def an_estimate(values, outputs, inputs, *, variance=None, measured=None, freq_hz=None):
    """An estimate around values; (n_freq, n_out, n_in)."""
    values = np.asarray(values, complex)
    freq = np.arange(1.0, len(values) + 1) if freq_hz is None else freq_hz
    frf = Frf(freq, values, tuple(outputs), tuple(inputs), "accelerance")
    return FrfEstimate(
        frf=frf,
        variance=np.ones(values.shape) if variance is None else variance,
        variance_source="differences",
        measured=np.ones(values.shape[1:], bool) if measured is None else measured,
    )


def write_campaign(folder: Path, text: str, files: dict[str, bytes] | None = None) -> Path:
    """campaign.toml and its files."""
    for name, content in (files or {}).items():
        (folder / name).write_bytes(content)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder


def read_written(folder: Path, layout: Layout | None = None) -> Campaign:
    """Read a campaign folder on a layout in place of its model's."""
    path, settings = read_settings(folder)
    return read_campaign(path, settings, correct_layout(path, settings, layout or a_layout()))


HEAD = 'model = "model.xml"\n'
TEST = HEAD + '[[test]]\nfile = "a.uff"\naverages = 10\n'
FIRST = Function(numbers(1), rsp=(7, 1), ref=(11, 3))
SECOND = Function(numbers(2), rsp=(2, -2), ref=(11, 3))
THIRD = Function(numbers(3), rsp=(7, 1), ref=(1, 2))
ARRAY_TEST = (
    HEAD + '[[test]]\nfile = "b.npz"\nchannels = "nodes 1..2, xy"\nreferences = ["11:x", "7:-z"]\n'
)


def uff(*functions):
    return b"".join(f if isinstance(f, bytes) else f.content() for f in functions)


def npz(**arrays):
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def read_small(folder: Path, text=TEST, layout=None, **files) -> Campaign:
    """Write a campaign around the small layout, and read it.

    Args:
        folder: where.
        text: of campaign.toml.
        layout: in place of the small one.
        files: contents, by name with an underscore for the dot.
    """
    contents = {"a.uff": uff(FIRST, SECOND, THIRD)}
    contents |= {name.replace("_", "."): content for name, content in files.items()}
    write_campaign(folder, text, contents)
    return read_written(folder, layout)
