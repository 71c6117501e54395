"""Options of ``mbw predict``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import (
    Closed,
    Json,
    Key,
    Overwrite,
    Pictures,
    Quiet,
    Seed,
    SingleJob,
    SoftEqualities,
    Without,
    out_option,
)

# Frequency lines of FRFs: at 200 Hz one every 0.2 mHz, and a few hundred MB for each FRF.
MAX_FREQUENCY_LINES = 1_000_000
MAX_SAMPLES = 100_000  # of the posterior: each has its FRFs and state space in one file


def predict(  # noqa: PLR0913  # one for each option
    model: Annotated[
        Path,
        typer.Argument(
            help="MJCF of a machine, the folder of mbw tune or mbw diagnose, or a campaign."
        ),
    ],
    *,
    modes: Annotated[
        bool, typer.Option("--modes", help="Print natural frequencies and damping ratios.")
    ] = False,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Compare FRFs of the state space, by python-control, with the model's at all "
            "centres of mass.",
        ),
    ] = False,
    frf: Annotated[bool, typer.Option("--frf", help="Write FRFs as CSV to stdout.")] = False,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="LABEL",
            help="acc11:+tx, floor:+tx, a motor, joint:ty_tx, a-b:+tx; repeatable.",
        ),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            metavar="LABEL",
            help="hexapod:+rz, a MuJoCo sensor, joint:ty_tx, a-b:+tx; repeatable.",
        ),
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            help="receptance, mobility or accelerance; default: accelerance, or receptance where "
            "all outputs are joints and sensors by name."
        ),
    ] = None,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LOW HIGH", help="Frequency band [Hz]; default: 0 to 200 Hz."),
    ] = None,
    lines: Annotated[
        int,
        typer.Option(min=2, max=MAX_FREQUENCY_LINES, help="Number of frequency lines of the FRFs."),
    ] = 801,
    statespace: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write A, B, C, D and names as .npz or .mat."),
    ] = None,
    spin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=RATE",
            help="Hinge that spins at this constant rate [rad/s], or at those of FROM:TO:N; "
            "repeatable.",
        ),
    ] = None,
    poses: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=FROM:TO:N",
            help="Predict along a stroke, or at the poses of a CSV with a joint over each column; "
            "repeatable: a grid. With --budget the margins of its loops.",
        ),
    ] = None,
    mount: Annotated[
        Path | None,
        typer.Option(metavar="STAGE.xml", help="MJCF of a stage that --at puts on the machine."),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="BODY:PLACE",
            help="Body that carries the stage, and a site of it, or x,y,z [m] from its centre of "
            "mass in world axes.",
        ),
    ] = None,
    add_mass: Annotated[
        list[str] | None,
        typer.Option(
            metavar="BODY=KG@x,y,z",
            help="Point mass at x,y,z [m] from the body's centre of mass, in world axes; "
            "repeatable.",
        ),
    ] = None,
    loss_factor: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=ETA",
            help="Loss factor of a joint, tendon or stage: k (1 + i eta); repeatable.",
        ),
    ] = None,
    delay: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=SECONDS",
            help="Delay of a spring that is a control loop: k exp(-s tau); repeatable.",
        ),
    ] = None,
    maxwell: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=RATIO@SECONDS",
            help="Maxwell branch: k (1 + ratio s tau / (1 + s tau)); repeatable.",
        ),
    ] = None,
    bands: Annotated[
        bool,
        typer.Option(
            "--bands",
            help="Write the FRFs with their 95 % intervals to bands.npz; of a tuning or diagnosis.",
        ),
    ] = False,
    diagnosed: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of mbw diagnose: its causes widen the bands of a tuning as alternatives.",
        ),
    ] = None,
    samples: Annotated[
        int,
        typer.Option(
            min=0,
            max=MAX_SAMPLES,
            help="Samples of the posterior of the fit: parameters, FRFs and state spaces, in "
            "samples.npz.",
        ),
    ] = 0,
    seed: Seed = 0,
    uncertain: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the uncertain plant F_u(M, Delta) of a fit as .npz or .mat.",
        ),
    ] = None,
    weight: Annotated[
        int | None,
        typer.Option(
            metavar="ORDER",
            help="Write a filter of this order that bounds the held-out error of the fit at the "
            "inputs, to weight.npz and weight.mat.",
        ),
    ] = None,
    reduction: Annotated[
        str | None,
        typer.Option(
            "--reduce",
            metavar="METHOD",
            help="Reduce the state space: balanced or modal truncation.",
        ),
    ] = None,
    order: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="States of the reduced state space; default: what the intervals of a tuning can "
            "tell, else an error of 1e-3.",
        ),
    ] = None,
    delays: Annotated[
        list[str] | None,
        typer.Option(
            "--input-delay",
            metavar="[INPUT=]SECONDS",
            help="Delay of the plant's inputs; exact with --discrete, else stated in the file; "
            "repeatable.",
        ),
    ] = None,
    period_s: Annotated[
        float | None,
        typer.Option(
            "--discrete",
            metavar="SECONDS",
            help="Sampling period of the state space, by a zero-order hold.",
        ),
    ] = None,
    budget: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Error budget of the sources, errors and loops of a budget.toml; shown in "
            "plant.html.",
        ),
    ] = None,
    before: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL.xml",
            help="Machine that stands beside in the budget; default: the nominal one of a "
            "tuning, the tuned one of a diagnosis.",
        ),
    ] = None,
    struts: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Tendon or joint with integral force feedback, such as leg*: gain, damping and "
            "decoupling frames; repeatable.",
        ),
    ] = None,
    key: Key = None,
    closed: Closed = None,
    out: Annotated[Path | None, out_option("<model>-predicted beside it")] = None,
    pictures: Pictures = True,
    json: Json = None,
    jobs: SingleJob = 1,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Print a model's modes, FRFs and state space, and show them in predict.html."""
    del jobs
    run_verb("mbw.predict.verb", **locals())
