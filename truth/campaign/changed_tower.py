r"""Changes of the measured tower, made exactly in its measured matrix: known answers on real data.

With the receptance R of all three floors, Z = R^-1 is the measured dynamic stiffness. A change d(w)
at places b gives Z' = Z + d b b^T, whatever else the machine does (structural modification; Ewins
2000, ch. 6). Whatever the model lacks, the changed data lack as well.

Each changed test is a second visit: all stiffness differs by 0.2 %, which scales the frequencies of
Z, channels are mounted anew (gain 0.5 %, delay 10 us), hits have a gain of their own (0.5 %), and
noise is drawn again at the level of the third differences along frequency.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from truth.machine.springs import Complex, Real

_ROOT = Path(__file__).resolve().parents[2]
ASSET = next(  # in a clone, or within the wheel
    (f for f in (_ROOT / "assets/tower", _ROOT / "mbw/assets/tower") if f.is_dir()), _ROOT
)
KINDS = (
    "mass",
    "gain",
    "link",
    "appendage",
    "nothing",
    "leg",
    "sign",
    "two",
    "delay",
    "damper",
    "exchange",
    "common_gain",
    "hit_gain",
    "hit_delay",
)
_TOWER_BAND_HZ = (2.0, 60.0)
_STIFFNESS_SD, GAIN_SD, _DELAY_SD = 2e-3, 5e-3, 1e-5
_LEG_STIFFNESS = 52460.9  # N/m, as drawn
_MAX_GAIN = 3.2  # well below the 4.45 of pounds for newtons, which the check of units asks about
# Links that are no leg: between floors that no leg joins, and from the ground.
_LINKS = ((0, 2), (None, 1), (None, 2))


@dataclass
class TowerChange:
    """One change of the machine or of the test.

    Args:
        effect: as in verdict.json; ``stiffness`` for a leg.
        location: as there.
        sizes: what was drawn.
    """

    effect: str
    location: str
    sizes: dict[str, float] = field(default_factory=dict)


def read_tower() -> tuple[Real, Complex]:
    """Return frequencies [Hz] and the measured accelerance; (n_freq,), (n_freq, 3, 3)."""
    with np.load(ASSET / "accelerance.npz") as data:
        freq_hz, frf = data["freq_hz"], data["frf"].astype(complex)
    inside = (freq_hz > _TOWER_BAND_HZ[0]) & (freq_hz < _TOWER_BAND_HZ[1])
    return freq_hz[inside], frf[inside]


def draw_change(kind: str, rng: np.random.Generator, scale: float = 1.0) -> list[TowerChange]:
    """Draw a change of a kind, one of ``KINDS``; ``scale`` multiplies its size."""
    if kind == "two":
        kinds = rng.choice(["mass", "appendage", "link", "gain"], 2, replace=False).tolist()
        return [change for each in kinds for change in draw_change(each, rng, scale)]
    floor = int(rng.integers(3))

    def size(low: float, high: float) -> float:
        return float(scale * np.exp(rng.uniform(np.log(low), np.log(high))))

    def gain_above_one(low: float, high: float) -> float:
        return float(min(np.exp(size(low, high)), _MAX_GAIN))

    if kind == "hit_gain":
        gain = gain_above_one(0.05, 0.3) ** float(rng.choice([-1.0, 1.0]))
        return [TowerChange("hammer_gain", f"hammer:acc{floor + 1}", {"gain": gain})]
    if kind == "hit_delay":
        return [TowerChange("hammer_delay", f"hammer:acc{floor + 1}", {"delay": -size(2e-4, 2e-3)})]
    on_body, at_sensor = f"body:floor{floor + 1}", f"sensor:acc{floor + 1}"
    first, second = _LINKS[floor]
    pair = f"pair:{'world' if first is None else f'floor{first + 1}'}-floor{second + 1}"
    swapped = "+".join(f"acc{k + 1}" for k in sorted(rng.choice(3, 2, replace=False)))
    hung = {"mass": size(0.1, 1.0), "frequency": rng.uniform(8.0, 30.0), "damping": 0.02}
    leg = float(min(size(0.05, 0.3), 0.5) * _LEG_STIFFNESS * rng.choice([-1.0, 1.0]))
    drawn = {
        "mass": TowerChange("mass_error", on_body, {"mass": size(0.2, 2.0)}),
        "appendage": TowerChange("appendage", on_body, hung),
        "link": TowerChange("parallel_path", pair, {"stiffness": size(1e3, 2e4), "damping": 0.0}),
        "damper": TowerChange("parallel_path", pair, {"stiffness": 1.0, "damping": size(5.0, 1e2)}),
        "leg": TowerChange("stiffness", f"joint:floor{floor + 1}", {"stiffness": leg}),
        "gain": TowerChange("sensor_gain", at_sensor, {"gain": gain_above_one(0.05, 0.3)}),
        "common_gain": TowerChange(
            "hammer_gain", "hammer:default", {"gain": gain_above_one(0.05, 0.2)}
        ),
        "delay": TowerChange("sensor_delay", at_sensor, {"delay": size(2e-4, 2e-3)}),
        "sign": TowerChange("sensor_polarity", at_sensor),
        "exchange": TowerChange("sensor_swap", f"sensor:{swapped}"),
    }
    return [drawn[kind]] if kind in drawn else []


@dataclass
class Visit:
    """What differs of itself at a second visit.

    Args:
        stiffer: factor of all stiffness.
        gains: of the channels; (3,).
        late: delays of the channels [s]; (3,).
        hits: gains of the hits; (3,).
    """

    stiffer: float
    gains: Real
    late: Real
    hits: Real


def draw_visit(rng: np.random.Generator) -> Visit:
    """Draw what differs of itself at a second visit."""
    return Visit(
        1 + _STIFFNESS_SD * rng.standard_normal(),
        np.exp(GAIN_SD * rng.standard_normal(3)),
        _DELAY_SD * rng.standard_normal(3),
        np.exp(GAIN_SD * rng.standard_normal(3)),
    )


def change_tower(
    freq_hz: Real, frf: Complex, changes: Sequence[TowerChange], rng: np.random.Generator
) -> Complex:
    """Return the accelerance of a second visit to the tower after the changes.

    Args:
        freq_hz: lines of ``read_tower`` [Hz]; (n_freq,).
        frf: accelerance that was measured [m/s2/N]; (n_freq, 3, 3).
        changes: what is changed.
        rng: random numbers of the visit.
    """
    omega, visit = 2 * np.pi * freq_hz, draw_visit(rng)
    stiffness = _visit_again(freq_hz, frf, visit.stiffer)
    for change in changes:
        pull, places = _dynamic_change(change, omega)
        stiffness = stiffness + pull[:, None, None] * np.outer(places, places)
    values = -(omega[:, None, None] ** 2) * np.linalg.inv(stiffness)
    values = values * (visit.gains * np.exp(-1j * omega[:, None] * visit.late))[:, :, None]
    values = values * visit.hits
    noise = _noise_of(values)
    drawn = rng.standard_normal((2, *values.shape))
    values = values + noise * (drawn[0] + 1j * drawn[1]) / np.sqrt(2)
    for change in changes:
        values = _read(change, omega, values)
    return values


def _visit_again(freq_hz: Real, frf: Complex, stiffer: float) -> Complex:
    """Return (1 + e) Z(w / sqrt(1 + e)): all springs are stiffer by 1 + e."""
    measured = np.linalg.inv(-frf / (2 * np.pi * freq_hz[:, None, None]) ** 2)
    asked = freq_hz / np.sqrt(stiffer)
    again: Complex = np.empty_like(measured)
    for row in range(3):
        for column in range(3):
            again[:, row, column] = np.interp(asked, freq_hz, measured[:, row, column])
    return stiffer * again


def _dynamic_change(change: TowerChange, omega: Real) -> tuple[Complex, Real]:
    """Return what a change adds to the dynamic stiffness, and where; nothing for channels."""
    places, sizes = np.zeros(3), change.sizes
    where = change.location.partition(":")[2]
    pull = np.zeros(len(omega), complex)
    if change.effect in ("mass_error", "appendage"):
        places[int(where[-1]) - 1] = 1.0
        pull = -sizes["mass"] * omega**2 + 0j
    if change.effect == "appendage":
        resonance = 2 * np.pi * sizes["frequency"]
        spring = resonance**2 + 2j * sizes["damping"] * resonance * omega
        pull = pull * spring / (spring - omega**2)
    if change.effect == "parallel_path":
        for name, sign in zip(where.split("-"), (-1.0, 1.0), strict=True):
            if name != "world":
                places[int(name[-1]) - 1] = sign
        pull = sizes["stiffness"] + 1j * omega * sizes["damping"]
    if change.effect == "stiffness":
        number = int(where[-1]) - 1
        places[number] = 1.0
        if number:
            places[number - 1] = -1.0
        pull = pull + sizes["stiffness"]
    return pull, places


def _read(change: TowerChange, omega: Real, values: Complex) -> Complex:
    """Return what changed channels and hits make of the FRFs."""
    where, factor = change.location.partition(":")[2], np.ones((len(omega), 3), complex)
    if change.effect == "sensor_swap":
        first, second = (int(name[-1]) - 1 for name in where.split("+"))
        order = np.arange(3)
        order[[first, second]] = second, first
        return values[:, order]
    if change.effect in ("hammer_gain", "hammer_delay"):
        gain = change.sizes.get("gain", 1.0) * np.exp(-1j * omega * change.sizes.get("delay", 0.0))
        hits = slice(None) if where == "default" else slice(int(where[-1]) - 1, int(where[-1]))
        values[:, :, hits] *= gain[:, None, None]
        return values
    if change.effect in ("sensor_gain", "sensor_delay", "sensor_polarity"):
        row = int(where[-1]) - 1
        factor[:, row] = {
            "sensor_gain": change.sizes.get("gain", 1.0),
            "sensor_polarity": -1.0,
            "sensor_delay": np.exp(-1j * omega * change.sizes.get("delay", 0.0)),
        }[change.effect]
    return values * factor[:, :, None]


def _noise_of(values: Complex) -> Real:
    """Return the noise of each value by third differences along frequency, over 9 lines."""
    third = np.abs(np.diff(values, 3, axis=0)) / np.sqrt(20.0)
    padded = np.pad(third, ((1, 2), (0, 0), (0, 0)), mode="edge")
    around = np.pad(padded, ((4, 4), (0, 0), (0, 0)), mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(around, 9, axis=0)
    return np.asarray(np.median(windows, axis=-1))


def write_tower(
    folder: Path, model: Path, freq_hz: Real, values: Complex, before: Complex | None = None
) -> None:
    """Write a campaign of the tower, against a model.

    Args:
        folder: where the campaign is written.
        model: file of the model.
        freq_hz: lines of the FRFs [Hz]; (n_freq,).
        values: accelerance; (n_freq, 3, 3).
        before: accelerance before a change; None for a campaign without states.
    """
    folder.mkdir(parents=True, exist_ok=True)
    labels = '["acc1:+x", "acc2:+x", "acc3:+x"]'
    states = {"frf": values} if before is None else {"before": before, "after": values}
    text = f'model = "{model.as_posix()}"\n'
    for name, frf in states.items():
        np.savez(folder / f"{name}.npz", frf=frf.astype(np.complex64), freq_hz=freq_hz)
        text += f'\n[[test]]\nfile = "{name}.npz"\n'
        text += "" if before is None else f'state = "{name}"\n'
        text += f"channels = {labels}\nreferences = {labels}\n"
        text += 'quantity = "accelerance"\nunit = "m/s^2/N"\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
