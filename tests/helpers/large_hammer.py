"""A hammer test of many channels, references and lines as a campaign on disk, with its modes."""

from pathlib import Path

import numpy as np

N_MODES, AVERAGES, NOISE = 25, 10, 0.01  # noise: share of each FRF's rms over the band
HIGHEST_HZ = 400.0
AXES = "xyz"


def write_large_test(folder: Path, n_out: int, n_in: int, lines: int, *, seed: int = 1):  # type: ignore[no-untyped-def]
    """Write campaign.toml, layout.toml and FRFs in single precision with their coherence.

    Returns:
        Natural frequencies [Hz] and damping ratios; (n_mode, 2).
    """
    rng = np.random.default_rng(seed)
    freq_hz = np.linspace(0.0, HIGHEST_HZ, lines + 1)[1:]
    modes_hz, damping = np.sort(rng.uniform(15, 380, N_MODES)), rng.uniform(0.005, 0.03, N_MODES)
    omega, omega_r = 2 * np.pi * freq_hz[:, None], 2 * np.pi * modes_hz
    responses = -(omega**2) / (omega_r**2 - omega**2 + 2j * damping * omega_r * omega)
    shapes = rng.normal(size=(N_MODES, n_out)) / 10  # unit mass
    drives = np.sort(rng.choice(n_out, n_in, replace=False))
    shape = (lines, n_out, n_in)
    frf, coherence = np.empty(shape, np.complex64), np.empty(shape, np.float32)
    for column, drive in enumerate(drives):
        clean = responses @ (shapes * shapes[:, [drive]])
        power = np.abs(clean) ** 2
        variance = NOISE**2 * power.mean(axis=0)
        error = rng.normal(size=(2, *clean.shape)) * np.sqrt(variance / 2)
        frf[:, :, column] = clean + error[0] + 1j * error[1]
        coherence[:, :, column] = 1 / (1 + (AVERAGES - 1) * variance / power)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / "test.npz", frf=frf, coherence=coherence, freq_hz=freq_hz)
    places = rng.uniform(-1, 1, (-(-n_out // 3), 3)).round(4).tolist()
    sites = [f"[site.acc{node}]\nposition = {place}\n" for node, place in enumerate(places, 1)]
    (folder / "layout.toml").write_text("".join(sites), encoding="utf-8")
    labels = [f"{channel // 3 + 1}:+{AXES[channel % 3]}" for channel in range(n_out)]
    (folder / "campaign.toml").write_text(
        'layout = "layout.toml"\n[[test]]\nfile = "test.npz"\nquantity = "accelerance"\n'
        f'unit = "m/s^2/N"\naverages = {AVERAGES}\n'
        f"channels = {labels}\nreferences = {[labels[drive] for drive in drives]}\n",
        encoding="utf-8",
    )
    return np.column_stack([modes_hz, damping])
