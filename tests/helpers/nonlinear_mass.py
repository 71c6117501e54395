"""One mass on six springs whose vertical spring is nonlinear, hit by a hammer at several levels.

The motion along z is integrated by SciPy at tight tolerances, and transformed line by line: nothing
of it is shared with ``diagnosis.levels``. All other directions are linear.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test
from mbmodel import Evaluator, FrfRequest, Model, as_drawn, load_machine
from tuning import Session, build_toleranced_model, parametrise

MASS_KG, DAMPING = 40.0, 900.0  # the motion ends within a record
STIFFNESS = MASS_KG * (2 * np.pi * 67.9) ** 2
FREQ_HZ = np.arange(20.0, 140.01, 1.0)
SPACING_HZ = 1.0
PULSE_S = 6e-3
MJCF = f"""
<mujoco model="mass">
  <compiler angle="radian"/>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="block">
      <inertial pos="0 0 0" mass="{MASS_KG}" diaginertia="0.8 0.9 1.0"/>
      <joint name="block_tx" type="slide" axis="1 0 0" stiffness="3e6" damping="200"/>
      <joint name="block_ty" type="slide" axis="0 1 0" stiffness="4e6" damping="250"/>
      <joint name="block_tz" type="slide" axis="0 0 1" stiffness="{STIFFNESS}" damping="{DAMPING}"/>
      <joint name="block_rx" type="hinge" axis="1 0 0" stiffness="1e5" damping="6"/>
      <joint name="block_ry" type="hinge" axis="0 1 0" stiffness="1.2e5" damping="7"/>
      <joint name="block_rz" type="hinge" axis="0 0 1" stiffness="1.4e5" damping="8"/>
      <site name="acc1" pos="0.2 0.1 0.1"/>
      <site name="acc2" pos="-0.2 0.15 0.1"/>
      <site name="acc3" pos="0.05 -0.2 0.12"/>
    </body>
  </worldbody>
</mujoco>
"""
Force = Callable[[float], float]


def nonlinear_block(folder: Path) -> Model:
    """Write the mass as MJCF and return its linear model."""
    path = folder / "mass.xml"
    path.write_text(MJCF, encoding="utf-8")
    return as_drawn(load_machine(path))


def session_of(model: Model, campaign: Campaign) -> Session:
    """Return a campaign and its model with all tolerances, ready to be tuned or diagnosed."""
    whole = build_toleranced_model(model.machine, campaign)
    return Session(Path("mass"), whole, campaign, parametrise(whole, campaign.tolerance))


def half_sine(time: float, peak: float) -> float:
    """Force of a hit [N]."""
    return peak * np.sin(np.pi * time / PULSE_S) if 0 <= time <= PULSE_S else 0.0


def vertical_accelerance(force: Force, peak: float) -> np.ndarray:
    """Accelerance along z through the centre of mass; (n_freq,).

    Args:
        force: of the nonlinear spring, beside the linear one [N].
        peak: of the hit [N].
    """

    def rates(time: float, state: np.ndarray) -> list[float]:
        stretch, speed = state
        spring = STIFFNESS * stretch + DAMPING * speed + force(stretch)
        return [speed, (half_sine(time, peak) - spring) / MASS_KG]

    seconds = 1 / SPACING_HZ
    times = np.linspace(0, seconds, 8_001)
    path = solve_ivp(
        rates,
        (0, seconds),
        [0.0, 0.0],
        t_eval=times,
        rtol=1e-8,
        atol=1e-15,
        max_step=5e-4,
        method="DOP853",
    )
    stretch = path.y[0]
    hammer = np.array([half_sine(time, peak) for time in times])
    kernel = np.exp(-2j * np.pi * FREQ_HZ[:, None] * times)
    weights = np.full(len(times), times[1])
    weights[[0, -1]] /= 2
    spectrum, pulse = kernel @ (weights * stretch), kernel @ (weights * hammer)
    return -((2 * np.pi * FREQ_HZ) ** 2) * spectrum / pulse


def drifting_campaign(
    folder: Path, levels: tuple[float, ...], factors: tuple[float, ...]
) -> Campaign:
    """Tests of linear machines whose vertical spring differs from one visit to a level to the next.

    Args:
        folder: in which the machines are written.
        levels: peak of the hits of each visit [N].
        factors: of the vertical stiffness at each visit.
    """
    tests: list[Test] = []
    for number, (level, factor) in enumerate(zip(levels, factors, strict=True)):
        path = folder / f"visit{number}.xml"
        path.write_text(MJCF.replace(f'"{STIFFNESS}"', f'"{factor * STIFFNESS}"'), encoding="utf-8")
        machine = as_drawn(load_machine(path))
        visit = level_campaign(machine, None, (level,), seed=number + 1)
        tests += [
            replace(test, condition=replace(test.condition, test=f"visit {number}"))
            for test in visit.tests
        ]
    return Campaign("mass", machine.machine.layout, tuple(tests))


def level_campaign(
    model: Model, force: Force | None, levels: tuple[float, ...], noise: float = 0.01, seed: int = 1
) -> Campaign:
    """Three hammer directions at each level; the noise rises where the hits' spectrum falls.

    Args:
        model: the linear machine.
        force: of the nonlinear spring along z; None for none.
        levels: peaks of the hits [N].
        noise: relative to the largest channel.
        seed: of the noise.
    """
    random = np.random.default_rng(seed)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 4) for axis in range(3))
    references = tuple(Dof.of("block", axis) for axis in range(3))
    linear = Evaluator(model, FrfRequest(FREQ_HZ, outputs, references)).at(model.drawn).values
    laplace = 2j * np.pi * FREQ_HZ
    plain = laplace**2 / (MASS_KG * laplace**2 + DAMPING * laplace + STIFFNESS)
    tests = []
    for level in levels:
        values = linear.copy()
        if force is not None:
            values[:, 2::3, 2] += (vertical_accelerance(force, level) - plain)[:, None]
        for column, reference in enumerate(references):
            true = values[:, :, column : column + 1]
            size = noise * np.sqrt((np.abs(true) ** 2).mean(axis=0, keepdims=True))
            fade = np.abs(np.sinc(FREQ_HZ * PULSE_S - 0.5) + np.sinc(FREQ_HZ * PULSE_S + 0.5))
            size = np.maximum(size, noise * size.max()) * (fade[0] / fade)[:, None, None]
            parts = random.standard_normal((2, *true.shape)) / np.sqrt(2)
            noisy = true + size * (parts[0] + 1j * parts[1])
            frf = Frf(FREQ_HZ, noisy, outputs, (reference,), "accelerance")
            measured = np.ones(noisy.shape[1:], bool)
            estimate = FrfEstimate(frf, size**2, "coherence", measured, averages=10)
            condition = Condition(f"{level:g}N", reference, level_n=level)
            tests.append(Test(condition, estimate))
    return Campaign("mass", model.machine.layout, tuple(tests))
