"""Conjugated FRFs, wrong quantities and delays are told from a reversed hammer, with their keys."""

import numpy as np
import pytest

from identification import correct_layout, read_campaign, read_layout, read_settings
from identification.words import InputError

FREQ = np.arange(0.5, 120.0, 0.5)
LAPLACE = 2j * np.pi * FREQ
MODES_HZ, DAMPING = np.array([20.0, 35.0, 52.0, 80.0]), np.array([0.01, 0.015, 0.008, 0.02])
ORDERS = {"receptance": 0, "mobility": 1, "accelerance": 2}
SITES = 6


def receptance(seed):
    """Receptances of six points hit at the first: four modes with random shapes and masses."""
    random = np.random.default_rng(seed)
    shapes = random.normal(size=(4, SITES))
    shapes[:, 0] = random.uniform(0.4, 1.5, 4)
    omega = 2 * np.pi * MODES_HZ * random.uniform(0.9, 1.1, 4)
    poles = omega**2 + LAPLACE[:, None] ** 2 + 2 * DAMPING * omega * LAPLACE[:, None]
    return np.einsum("ri,r,lr->li", shapes, shapes[:, 0] / 50.0, 1 / poles)


@pytest.fixture
def read(tmp_path):
    """Return a function that writes FRFs with noise as a campaign and reads it."""

    def build(frf, stated="", freq_hz=FREQ, noisy=True):
        random = np.random.default_rng(0)
        deviation = 0.003 * noisy * np.abs(frf).mean(axis=0)
        noise = random.normal(size=(2, *frf.shape)) * deviation
        np.savez(
            tmp_path / "t.npz", frf=(frf + noise[0] + 1j * noise[1])[:, :, None], freq_hz=freq_hz
        )
        layout = "".join(
            f"[site.acc{k}]\nposition = [{0.1 * k}, {0.03 * k**2}, 0]\n"
            for k in range(1, SITES + 1)
        )
        (tmp_path / "layout.toml").write_text(layout, "utf-8")
        (tmp_path / "campaign.toml").write_text(
            'layout = "layout.toml"\n[[test]]\nfile = "t.npz"\n'
            f'channels = "nodes 1..{SITES}, z"\nreferences = ["1:+z"]\n{stated}',
            "utf-8",
        )
        path, settings = read_settings(tmp_path)
        drawn = read_layout(tmp_path / "layout.toml")
        return read_campaign(path, settings, correct_layout(path, settings, drawn))

    return build


def accelerance(seed):
    return receptance(seed) * LAPLACE[:, None] ** 2


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("quantity", ORDERS)
def test_right_frfs_of_any_quantity_give_no_remark(read, seed, quantity):
    frf = receptance(seed) * LAPLACE[:, None] ** ORDERS[quantity]
    assert read(frf, f'quantity = "{quantity}"\n').remarks == ()


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("quantity", ORDERS)
def test_conjugated_frfs_are_refused_with_the_key(read, quantity, sign):
    frf = sign * receptance(1) * LAPLACE[:, None] ** ORDERS[quantity]
    stated = f'quantity = "{quantity}"\n'
    with pytest.raises(InputError, match=r't\.npz: .* set time_sign = "-" in its'):
        read(frf.conj(), stated)
    mended = read(frf.conj(), f'{stated}time_sign = "-"\n')
    assert len(mended.remarks) == (sign < 0)
    with pytest.raises(InputError, match=r'set time_sign = "\+" in its'):
        read(frf, f'{stated}time_sign = "-"\n')


def test_without_a_drive_point_the_direction_of_time_shows_too(read):
    frf = accelerance(2)
    frf[:, 0] = 0.0
    with pytest.raises(InputError, match="responses precede the force"):
        read(frf.conj())


@pytest.mark.parametrize("delay_s", [0.01, -0.01])
def test_a_delay_is_no_direction_of_time(read, delay_s):
    delayed = accelerance(3) * np.exp(-LAPLACE * delay_s)[:, None]
    (remark,) = read(delayed).remarks
    assert f"the motion {'lags' if delay_s > 0 else 'leads'} the force by 10 ms" in remark
    assert "opposite sign" in remark


@pytest.mark.parametrize("seed", range(6))
def test_a_reversed_hammer_is_called_so(read, seed):
    (remark,) = read(-accelerance(seed)).remarks
    assert "reads with the opposite sign" in remark


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    ("held", "stated"),
    [(a, b) for a in ORDERS for b in ORDERS if a != b],
)
def test_another_quantity_is_named_with_its_key(read, seed, held, stated):
    frf = receptance(seed) * LAPLACE[:, None] ** ORDERS[held]
    (remark,) = read(frf, f'quantity = "{stated}"\n').remarks
    assert f'set quantity = "{held}" in its [[test]]' in remark


def test_noise_has_no_direction_of_time(read):
    random = np.random.default_rng(3)
    noise = random.normal(size=(2, len(FREQ), SITES))
    read(noise[0] + 1j * noise[1])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scale", [8.0, 1 / 90.0])  # modes above the band, or below it
@pytest.mark.parametrize("noise", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("quantity", ORDERS)
def test_away_from_all_modes_noise_is_no_sign(read, seed, scale, noise, quantity):
    random = np.random.default_rng(seed)
    shapes = random.normal(size=(4, SITES))
    omega = 2 * np.pi * MODES_HZ * scale
    poles = omega**2 + LAPLACE[:, None] ** 2 + 2 * DAMPING * omega * LAPLACE[:, None]
    frf = np.einsum("ri,r,lr->li", shapes, shapes[:, 0], LAPLACE[:, None] ** 2 / poles)
    error = random.normal(size=(2, *frf.shape)) * noise * np.median(np.abs(frf), axis=0)
    frf = (frf + error[0] + 1j * error[1]) * LAPLACE[:, None] ** (ORDERS[quantity] - 2)
    remarks = read(frf, f'quantity = "{quantity}"\n').remarks
    assert not [remark for remark in remarks if "drive point" in remark]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
def test_conjugated_frfs_of_uneven_lines_are_told_at_the_drive_point(read, seed, quantity):
    # Without an even axis there is no impulse response: the drive point alone can tell.
    random = np.random.default_rng(seed)
    frf = receptance(seed) * LAPLACE[:, None] ** ORDERS[quantity]
    lines = np.sort(random.choice(len(FREQ), len(FREQ) * 3 // 4, replace=False))
    (remark,) = read(frf[lines].conj(), f'quantity = "{quantity}"\n', FREQ[lines]).remarks
    assert 'set time_sign = "-" in its [[test]]' in remark
    (remark,) = read(-frf[lines], f'quantity = "{quantity}"\n', FREQ[lines]).remarks
    assert "reads with the opposite sign" in remark


def test_magnitudes_without_phase_are_refused(read):
    frf = np.abs(accelerance(1))
    with pytest.raises(InputError, match=r"t\.npz: .* such as magnitudes .* export complex"):
        read(frf, noisy=False)
