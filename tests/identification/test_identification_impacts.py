"""Impacts without a measured force: clocks, the moment of the impact, spectra, refusals."""

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.io

from identification.impacts import impact_spectra, read_impact, sliding_average, synchronise
from identification.words import Dof, InputError

CHANNELS = ("acc1_x", "acc1_y", "acc2_z", "acc3_-x")
POLES = 2 * np.pi * np.array([-0.9 + 31.0j, -1.4 + 47.0j, -2.0 + 83.0j])
RATE = 1260.0


@dataclass(frozen=True)
class Ringing:
    """A structure struck at 0.4 s, with residues for each channel and mode."""

    residues: np.ndarray
    noise: float
    seed: int = 1
    struck: float = 0.4
    seconds: float = 3.0

    def records(self):
        """Stamps and values of every channel, each sampled on its own."""
        random = np.random.default_rng(self.seed)
        found = {}
        for name, residue in zip(CHANNELS, self.residues, strict=True):
            steps = random.uniform(0.6, 1.4, int(self.seconds * RATE)) / RATE
            time = 5.0 + random.uniform(0, 1e-3) + np.cumsum(steps)
            since = time - 5.0 - self.struck
            # A rubber mallet: the force rises and falls within 5 ms.
            value = 2 * (residue * np.exp(np.outer(since, POLES))).real.sum(axis=1)
            value = np.where(
                since > 0, value * (1 - np.exp(-((np.maximum(since, 0) / 2e-3) ** 2))), 0
            )
            found[name] = time, value + self.noise * random.standard_normal(len(time))
        return found

    def write(self, path):
        arrays = {}
        for name, (time, value) in self.records().items():
            arrays |= {f"time_{name}": time, f"value_{name}": value}
        if path.suffix == ".mat":
            scipy.io.savemat(path, {key.replace("-", "_"): one for key, one in arrays.items()})
        else:
            np.savez(path, **arrays)
        return path


def residues(seed=3):
    random = np.random.default_rng(seed)
    shapes = random.standard_normal((len(CHANNELS), 3))
    return shapes * np.exp(1j * random.uniform(-np.pi, np.pi, 3)), shapes


def test_channels_with_clocks_of_their_own_come_to_one_clock(tmp_path):
    amplitudes, _ = residues()
    found = synchronise(read_impact(Ringing(amplitudes, 1e-4).write(tmp_path / "bow.npz")))
    assert found.dofs == tuple(
        Dof.parse(text) for text in ("acc1:+tx", "acc1:+ty", "acc2:+tz", "acc3:+tx")
    )
    assert found.start == pytest.approx(5.4, abs=5e-3)
    assert found.rate_hz == pytest.approx(RATE, rel=0.02)
    since = found.start - 5.4 + np.arange(found.after.shape[1]) / found.rate_hz
    sign = np.array([1, 1, 1, -1])[:, None]  # the last one was glued the other way round
    clean = sign * 2 * (amplitudes @ np.exp(np.outer(POLES, since))).real
    later = since > 0.01  # after the mallet has left
    error = np.abs(found.after - clean)[:, later]
    assert error.max() < 2e-3 * np.abs(clean).max()


def test_spectra_are_those_of_the_decaying_modes_and_the_noise_is_known(tmp_path):
    amplitudes, _ = residues()
    clean = synchronise(read_impact(Ringing(amplitudes, 1e-6).write(tmp_path / "clean.npz")))
    noisy = [
        synchronise(read_impact(Ringing(amplitudes, 0.05, seed=k).write(tmp_path / f"{k}.npz")))
        for k in range(8)
    ]
    found = impact_spectra([clean], (20.0, 100.0))
    length = 1 / (found.freq_hz[1] - found.freq_hz[0])
    shifted = amplitudes * np.exp(POLES * (clean.start - 5.4))
    omega = 2j * np.pi * found.freq_hz[:, None]
    ended = 1 - np.exp((POLES - omega) * length)
    twin = 1 - np.exp((POLES.conj() - omega) * length)
    exact = (ended / (omega - POLES)) @ shifted.T
    exact += (twin / (omega - POLES.conj())) @ shifted.conj().T
    exact[:, 3] *= -1
    error = np.abs(found.values[:, :, 0] - exact)
    # What lies between the impact and the end of the mallet's force is one short, smooth burst.
    assert error.max() < 0.05 * np.abs(exact).max()
    several = impact_spectra(noisy, (20.0, 100.0))
    assert several.values.shape[1:] == (4, 8)
    stated = several.variance.mean()
    expected = 0.05**2 / RATE * (1 / (several.freq_hz[1] - several.freq_hz[0]))
    assert stated == pytest.approx(expected, rel=0.25)  # a spline's noise is not quite white


def test_ratios_of_channels_are_signed_and_free_of_the_impact(tmp_path):
    amplitudes, shapes = residues()
    other = amplitudes * np.array([0.3, 2.0, -1.1])  # struck elsewhere
    impacts = [
        synchronise(read_impact(Ringing(one, 1e-5, seed=k).write(tmp_path / f"{k}.npz")))
        for k, one in enumerate((amplitudes, other))
    ]
    found = impact_spectra(impacts, (20.0, 100.0))
    for mode in range(3):
        line = int(np.argmin(np.abs(found.freq_hz - POLES[mode].imag / 2 / np.pi)))
        sign = np.array([1, 1, 1, -1])
        for k in range(2):
            ratio = found.values[line, :, k] / found.values[line, 0, k]
            wanted = sign * shapes[:, mode] / shapes[0, mode]
            large = np.abs(wanted) > 0.5
            assert (np.sign(ratio.real[large]) == np.sign(wanted[large])).all()


@pytest.mark.parametrize("ending", ["npz", "mat", "csv"])
def test_a_record_is_the_same_from_every_kind_of_file(tmp_path, ending):
    amplitudes, _ = residues()
    one = Ringing(amplitudes[:, :], 1e-3, seconds=0.8)
    path = tmp_path / f"bow.{ending}"
    if ending == "csv":
        rows = ["channel,time,value"]
        for name, (time, value) in one.records().items():
            rows += [
                f"{name},{t!r},{v!r}" for t, v in zip(time.tolist(), value.tolist(), strict=True)
            ]
        path.write_text("\n".join(rows))
    else:
        one.write(path)
    found = {str(c.dof.positive): c for c in read_impact(path).channels}
    time, value = one.records()["acc2_z"]
    np.testing.assert_array_equal(found["acc2:+tz"].time, time)
    np.testing.assert_array_equal(found["acc2:+tz"].value, value)
    assert len(found) == 4


def spoiled(tmp_path, change):
    amplitudes, _ = residues()
    arrays = {}
    for name, (time, value) in Ringing(amplitudes, 1e-3).records().items():
        arrays |= {f"time_{name}": time, f"value_{name}": value}
    change(arrays)
    np.savez(tmp_path / "bow.npz", **arrays)
    return tmp_path / "bow.npz"


def backwards(arrays):
    arrays["time_acc1_y"][100:] -= 0.05


def silent(arrays):
    arrays["value_acc2_z"][:] = 0.2


def deaf(arrays):
    value = arrays["value_acc2_z"]
    value[:] = 1e-3 * np.random.default_rng(4).standard_normal(len(value))


def quiet(arrays):
    for name in CHANNELS:
        random = np.random.default_rng(4)
        arrays[f"value_{name}"][:] = random.standard_normal(len(arrays[f"value_{name}"]))


def pausing(arrays):
    keep = np.ones(len(arrays["time_acc1_x"]), bool)
    keep[1000:1100] = False
    for what in ("time", "value"):
        arrays[f"{what}_acc1_x"] = arrays[f"{what}_acc1_x"][keep]


def later(arrays):
    arrays["time_acc1_x"] += 100.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (backwards, r"the clock of acc1_y does not go forward at sample 101"),
        (silent, r"acc2:\+tz is silent after the impact"),
        (deaf, r"acc2:\+tz is silent after the impact"),
        (quiet, r"holds no impact"),
        (pausing, r"acc1:\+tx pauses from"),
        (later, r"no time in common"),
        (lambda a: a.pop("value_acc1_x"), r"acc1_x has only stamps or only values"),
        (lambda a: a.update(time_acc1_x=a["time_acc1_x"][:-1]), r"acc1_x has \d+ stamps for"),
        (lambda a: a.update(value_acc1_x=a["value_acc1_x"] * np.nan), r"values that are no num"),
        (lambda a: a.clear(), r"has no channels"),
        (lambda a: a.update(time_wheel=a["time_acc1_x"], value_wheel=a["time_acc1_x"]), r"no axis"),
        (
            lambda a: a.update(
                {"time_acc1_-x": a["time_acc1_x"], "value_acc1_-x": a["value_acc1_x"]}
            ),
            r"acc1:\+tx twice",
        ),
    ],
)
def test_records_that_cannot_be_used_are_refused_by_name(tmp_path, change, said):
    with pytest.raises(InputError, match=said):
        synchronise(read_impact(spoiled(tmp_path, change)))


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(InputError, match="is not there"):
        read_impact(tmp_path / "none.npz")
    (tmp_path / "bad.npz").write_text("no")
    with pytest.raises(InputError, match=r"bad\.npz cannot be read .* save it again"):
        read_impact(tmp_path / "bad.npz")
    (tmp_path / "bad.csv").write_text("channel,time,value\nacc1_x,0.1,zero\n")
    with pytest.raises(InputError, match=r"row 2: 'acc1_x,0.1,zero' is not"):
        read_impact(tmp_path / "bad.csv")


def test_impacts_must_be_read_by_the_same_channels(tmp_path):
    amplitudes, _ = residues()
    whole = synchronise(read_impact(Ringing(amplitudes, 1e-3).write(tmp_path / "bow.npz")))

    def without(arrays):
        arrays.pop("time_acc2_z")
        arrays.pop("value_acc2_z")

    (tmp_path / "other").mkdir()
    part = synchronise(read_impact(spoiled(tmp_path / "other", without)))
    with pytest.raises(InputError, match=r"differ in acc2:\+tz"):
        impact_spectra([whole, part], (20.0, 100.0))
    with pytest.raises(InputError, match="above half of"):
        impact_spectra([whole], (20.0, 900.0))


def test_a_sliding_average_is_that_of_its_lines():
    random = np.random.default_rng(6)
    values, freq = random.uniform(size=(50, 2)), 10 + 0.25 * np.arange(50)
    found = sliding_average(values, freq, 1.0)
    for line in range(50):
        inside = np.abs(freq - freq[line]) <= 0.5
        np.testing.assert_allclose(found[line], values[inside].mean(axis=0))
    np.testing.assert_allclose(sliding_average(values, freq, 0.1), values)


def test_a_long_sway_below_the_band_does_not_make_the_spectra_long(tmp_path):
    amplitudes, _ = residues()
    one = Ringing(amplitudes, 1e-3, seconds=20.0)
    arrays = {}
    for name, (time, value) in one.records().items():
        since = np.maximum(time - 5.4, 0.0)
        sway = 0.5 * np.exp(-0.05 * since) * np.sin(2 * np.pi * 0.4 * since)
        arrays |= {f"time_{name}": time, f"value_{name}": value + sway}
    np.savez(tmp_path / "bow.npz", **arrays)
    struck_once = synchronise(read_impact(tmp_path / "bow.npz"))
    plain = synchronise(read_impact(one.write(tmp_path / "plain.npz")))
    swaying, still = (impact_spectra([which], (20.0, 95.0)) for which in (struck_once, plain))
    assert len(swaying.freq_hz) < 1.5 * len(still.freq_hz)


def test_a_chirp_is_the_slow_sum(tmp_path):
    amplitudes, _ = residues()
    one = synchronise(read_impact(Ringing(amplitudes, 1e-3).write(tmp_path / "bow.npz")))
    spectra = impact_spectra([one], (20.0, 95.0), finer=3)
    spacing = spectra.freq_hz[1] - spectra.freq_hz[0]
    count = int(1 / spacing / 3 * one.rate_hz)
    value = one.after[:, :count] - one.before.mean(axis=1, keepdims=True)
    weights = np.r_[0.5, np.ones(count - 1)] / one.rate_hz
    kernel = np.exp(-2j * np.pi * np.outer(spectra.freq_hz, np.arange(count) / one.rate_hz))
    slow = kernel @ (weights * value).T
    np.testing.assert_allclose(spectra.values[:, :, 0], slow, atol=1e-9 * np.abs(slow).max())


def test_a_spike_of_one_channel_is_no_impact(tmp_path):
    amplitudes, _ = residues()

    def spike(arrays):
        arrays["value_acc1_y"][200] += 500.0  # at 0.16 s, ahead of the impact

    plain = synchronise(read_impact(Ringing(amplitudes, 1e-3).write(tmp_path / "plain.npz")))
    assert synchronise(read_impact(spoiled(tmp_path, spike))).start == pytest.approx(
        plain.start, abs=3e-3
    )
