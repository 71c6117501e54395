r"""A virtual test of a gondola: struck with a mallet, read by accelerometers with their own clocks.

Of a structure free modes are known, normalised by mass, at sensors and struck points (made by
``assets/gondola``). A half-sine force of some milliseconds gives each mode

    q'' + 2 zeta w q' + w^2 q = psi_a F(t),   y = sum psi_s q''

(eq. 7 and 9), integrated exactly for a force that is linear between fine steps; rigid modes sway on
soft ropes. Each channel is then read at moments of its own, 1260 a second on average, with noise.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import cont2discrete, lfilter

Real = NDArray[np.float64]
RATE = 1260.0
BAND = 15.0, 95.0  # Hz
_FINE = 8  # steps of the force and the motion per sample
_ROPES = 0.4  # Hz: the rigid modes, as it hangs
_JITTER = 0.3  # of a sample
_DAMPING = (0.016, 0.044)
_PULSE = (3e-3, 6e-3)  # s
_FORCE = (100.0, 400.0)  # N


@dataclass(frozen=True, eq=False)
class Structure:
    """What is tested.

    Args:
        frequencies: (n_mode,) [Hz], the rigid ones zero.
        shapes: at places; (n_mode, n_place, 3) [kg^-1/2].
        places: names of sensors and struck points; n_place.
        axes: that each is read or struck along, of ``xyz``.
        pairs: mode of the drawing that each mode is, -1 for none; (n_mode,).
    """

    frequencies: Real
    shapes: Real
    places: tuple[str, ...]
    axes: tuple[str, ...]
    pairs: NDArray[np.intp]


def read_structure(path: Path, seed: int, pairs: str = "pairs") -> Structure:
    """One of the structures of ``truths.npz``; ``pairs`` names the model of its pairs."""
    with np.load(path) as kept:
        return Structure(
            kept[f"frequencies_{seed}"],
            kept[f"shapes_{seed}"].astype(float),
            tuple(kept["places"].tolist()),
            tuple(kept["axes"].tolist()),
            kept[f"{pairs}_{seed}"].astype(np.intp),
        )


@dataclass(frozen=True)
class Trial:
    """How it is tested.

    Args:
        seed: of damping, forces, clocks and noise.
        seconds: of a record.
        quiet: before the impact [s].
        noise: of a channel [m/s2].
        tick: of the clocks that stamp samples [s]; 0 for stamps without rounding.
        step: of the converter [m/s2]; 0 for values without rounding.
    """

    seed: int
    seconds: float = 20.0
    quiet: float = 1.0
    noise: float = 0.02
    tick: float = 0.0
    step: float = 0.0


def damping_of(structure: Structure, trial: Trial) -> Real:
    """Damping ratio of each mode of a structure in a trial; (n_mode,)."""
    damping = np.random.default_rng(trial.seed).uniform(*_DAMPING, len(structure.frequencies))
    damping[structure.frequencies < 1.0] = 0.02
    return damping


def strike(structure: Structure, trial: Trial, point: str) -> dict[str, tuple[Real, Real]]:
    """Stamps and values of every channel for one impact, by names such as ``acc1_x``."""
    own = structure.places.index(point)
    random = np.random.default_rng([trial.seed, own])
    damping = damping_of(structure, trial)
    fine = 1 / (_FINE * RATE)
    time = np.arange(0.0, trial.seconds + 2 / RATE, fine)
    force = _half_sine(time - trial.quiet, random.uniform(*_PULSE)) * random.uniform(*_FORCE)
    axis = "xyz".index(structure.axes[own])
    omega = 2 * np.pi * np.maximum(structure.frequencies, _ROPES)
    motions = np.array(
        [
            _accelerated(force * shape[own, axis], w, zeta, fine)
            for shape, w, zeta in zip(structure.shapes, omega, damping, strict=True)
        ]
    )
    found = {}
    for place, axes, shapes in zip(
        structure.places, structure.axes, structure.shapes.transpose(1, 2, 0), strict=True
    ):
        if not place.startswith("acc"):
            continue
        for letter in axes:
            value = shapes["xyz".index(letter)] @ motions
            stamps = _rounded(_stamps(random, trial.seconds), trial.tick)
            read = make_interp_spline(time, value, k=3)(stamps)
            noise = trial.noise * random.standard_normal(len(stamps))
            found[f"{place}_{letter}"] = stamps, _rounded(read + noise, trial.step)
    return found


def _half_sine(since: Real, width: float) -> Real:
    inside = (since >= 0) & (since <= width)
    return np.where(inside, np.sin(np.pi * since / width), 0.0)


def _accelerated(force: Real, omega: float, zeta: float, step: float) -> Real:
    """Acceleration of one mode, by the exact response to a force that is linear between steps."""
    states = np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]])
    system = (states, np.array([[0.0], [1.0]]), states[1:], np.array([[1.0]]))
    a, b, c, d, _ = cont2discrete(system, step, method="foh")
    trace, product = np.trace(a), np.linalg.det(a)
    # Of a system of two states: y = (C adj(z - A) B + D det) / det.
    first = float((c @ b).item()) - float(d.item()) * trace
    second = float((c @ (a - trace * np.eye(2)) @ b).item()) + float(d.item()) * product
    found: Real = lfilter([float(d.item()), first, second], [1.0, -trace, product], force)
    return found


def _stamps(random: np.random.Generator, seconds: float) -> Real:
    count = int(seconds * RATE) - 1
    even = (np.arange(count) + random.uniform(0.3, 0.7)) / RATE
    found: Real = even + random.uniform(-_JITTER, _JITTER, count) / RATE
    return found


def _rounded(values: Real, step: float) -> Real:
    return np.round(values / step) * step if step else values


def write_impacts(
    folder: Path,
    structure: Structure,
    trial: Trial,
    points: tuple[str, ...],
    layout: Path,
    kind: type = float,
) -> None:
    """A campaign of impacts: records, layout, campaign.toml.

    Args:
        folder: made if it is not there.
        structure: what is struck.
        trial: how.
        points: where, one impact each.
        layout: of the sensors, which is copied.
        kind: of the numbers in the records.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / layout.name).write_text(layout.read_text("utf-8"), encoding="utf-8")
    lines = [f'layout = "{layout.name}"', f"band = [{BAND[0]}, {BAND[1]}]"]
    for point in points:
        arrays: dict[str, Real] = {}
        for name, (time, value) in strike(structure, trial, point).items():
            arrays |= {f"time_{name}": time.astype(kind), f"value_{name}": value.astype(kind)}
        np.savez_compressed(folder / f"{point}.npz", allow_pickle=False, **arrays)
        lines += ["", "[[impact]]", f'file = "{point}.npz"']
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
