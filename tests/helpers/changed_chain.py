"""Two masses on springs, tested before and after a change, beside a mass that no drawing has."""

import numpy as np

CHAIN = """
<mujoco model="chain">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="low">
      <joint name="low_tx" type="slide" axis="1 0 0" stiffness="50000" damping="20"/>
      <inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.1"/>
      <site name="acc1"/>
      <body name="high" pos="0 0 0.2">
        <joint name="high_tx" type="slide" axis="1 0 0" stiffness="60000" damping="20"/>
        <inertial pos="0 0 0" mass="4" diaginertia="0.1 0.1 0.1"/>
        <site name="acc2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
FREQ = np.linspace(4.0, 40.0, 241)
BEFORE, AFTER = (48000.0, 63000.0), (48000.0, 0.9 * 63000.0)  # N/m; the upper spring is softer


def chain_accelerance(stiffness, factor=1.0):
    """Accelerance of the chain with a mass on a spring at its top, which no drawing has."""
    omega = 2 * np.pi * FREQ
    low, high = (factor * k + 22j * omega for k in stiffness)
    hung = 0.4 * (2 * np.pi * 24.0) ** 2 * (factor + 0.02j)
    total = np.zeros((len(FREQ), 2, 2), complex)
    total[:, 0, 0], total[:, 1, 1] = low + high - 5.1 * omega**2, high - 4.05 * omega**2
    total[:, 0, 1] = total[:, 1, 0] = -high
    total[:, 1, 1] -= 0.4 * omega**2 * hung / (hung - 0.4 * omega**2)
    return -(omega[:, None, None] ** 2) * np.linalg.inv(total)


def write_chain(folder, after=AFTER, *, factor=1.0, references=2):
    """A campaign of two states; noise of 0.3 %."""
    folder.mkdir()
    (folder / "model.xml").write_text(CHAIN)
    text, random = 'model = "model.xml"\n', np.random.default_rng(7)
    for state, values in (
        ("before", chain_accelerance(BEFORE)),
        ("after", chain_accelerance(after, factor)),
    ):
        noise = 0.003 * np.abs(values)
        drawn = random.standard_normal((2, *values.shape))
        noisy = values + noise * (drawn[0] + 1j * drawn[1]) / np.sqrt(2)
        np.savez(
            folder / f"{state}.npz",
            frf=noisy[..., :references],
            freq_hz=FREQ,
            variance=noise[..., :references] ** 2,
        )
        labels = ["acc1:+x", "acc2:+x"]
        text += (
            f'[[test]]\nfile = "{state}.npz"\nstate = "{state}"\nchannels = {labels}\n'
            f'references = {labels[:references]}\nquantity = "accelerance"\nunit = "m/s^2/N"\n'
        )
    (folder / "campaign.toml").write_text(text)
    return folder


def write_visits(folder, after=AFTER, *, factor=1.0, names=("before", "after")):
    """Both states as two campaigns; the campaign of both is in the folder ``whole``."""
    whole, labels = write_chain(folder / "whole", after, factor=factor), ["acc1:+x", "acc2:+x"]
    for state, name in zip(("before", "after"), names, strict=True):
        place = folder / name
        place.mkdir()
        (place / "model.xml").write_text(CHAIN)
        (place / "frf.npz").write_bytes((whole / f"{state}.npz").read_bytes())
        (place / "campaign.toml").write_text(
            f'model = "model.xml"\n[[test]]\nfile = "frf.npz"\nchannels = {labels}\n'
            f'references = {labels}\nquantity = "accelerance"\nunit = "m/s^2/N"\n'
        )
    return tuple(folder / name for name in names)
