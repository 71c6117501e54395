"""The command ``mbw VERB``: options in, exit codes out."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from threadpoolctl import threadpool_limits

from mbw import demo as demo_verb
from mbw import identify as identify_verb
from mbw import predict as predict_verb
from mbw import report as report_verb
from mbw import tune as tune_verb
from mbw.messages import SCREEN, guarded

app = typer.Typer(
    name="mbw",
    help="Closes the gap between the multi-body model of a machine and its hammer test.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Band = Annotated[
    tuple[float, float] | None,
    typer.Option(metavar="LOW HIGH", help="Band [Hz]; default: the lines with coherence."),
]
Json = Annotated[Path | None, typer.Option(metavar="FILE", help="Result as JSON; - is stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Errors only.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the random starts.")]


@app.callback()
def common(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks.")] = False,
) -> None:
    """Close the gap between the multi-body model of a machine and its hammer test."""
    SCREEN.debug = debug


@app.command()
@guarded
def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where results go.")] = Path("mbw-demo"),
    jobs: Jobs = 2,
    quiet: Quiet = False,
) -> None:
    """Run the whole line on the built-in station and end with the address of a report."""
    SCREEN.quiet = quiet
    demo_verb.run(out, jobs)


@app.command()
@guarded
def identify(
    campaign: Annotated[Path, typer.Argument(help="Folder with a campaign.toml.")],
    *,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results; default: <campaign>-modes.")
    ] = None,
    json: Json = None,
    band: Band = None,
    quiet: Quiet = False,
) -> None:
    """Identify the measured modal model: poles, damping, shapes, with standard deviations."""
    SCREEN.quiet = quiet
    identify_verb.run(campaign, out=out, json=json, band=band)


@app.command()
@guarded
def predict(  # noqa: PLR0913  # one for each option
    model: Annotated[Path, typer.Argument(help="MJCF of a machine.")],
    *,
    modes: Annotated[bool, typer.Option("--modes", help="Natural frequencies, damping.")] = False,
    frf: Annotated[bool, typer.Option("--frf", help="FRFs as CSV to stdout.")] = False,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input", metavar="LABEL", help="acc11:+tx, floor:+tx or a motor; repeatable."
        ),
    ] = None,
    outputs: Annotated[
        list[str] | None, typer.Option("--output", metavar="LABEL", help="hexapod:+rz; repeatable.")
    ] = None,
    quantity: Annotated[str, typer.Option(help="receptance, mobility, accelerance.")] = (
        "accelerance"
    ),
    band: Band = None,
    lines: Annotated[int, typer.Option(min=2, help="Frequency lines of the FRFs.")] = 801,
    statespace: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A, B, C, D and names as .npz or .mat.")
    ] = None,
    spin: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=RATE", help="A hinge that turns [rad/s]; repeatable."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Pictures; default: <model>-predicted.")
    ] = None,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Write them.")] = True,
    json: Json = None,
    quiet: Quiet = False,
) -> None:
    """Say a model's modes, FRFs and state space, and show them in predict.html."""
    SCREEN.quiet = quiet
    wish = predict_verb.Wish(
        inputs=tuple(inputs or ()),
        outputs=tuple(outputs or ()),
        quantity=quantity,
        band=band,
        lines=lines,
    )
    targets = predict_verb.Targets(modes, frf, statespace, json, pictures, out)
    predict_verb.run(model, wish, targets, spin or ())


@app.command()
@guarded
def tune(
    campaign: Annotated[Path, typer.Argument(help="Folder with a campaign.toml.")],
    *,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results; default: <campaign>-tuned.")
    ] = None,
    json: Json = None,
    band: Band = None,
    starts: Annotated[int, typer.Option(min=1, help="The drawing, then random starts.")] = 1,
    seed: Seed = 0,
    jobs: Jobs = 1,
    quiet: Quiet = False,
) -> None:
    """Tune stiffness and damping to a campaign and say what gap remains."""
    SCREEN.quiet = quiet
    tune_verb.run(campaign, out=out, json=json, band=band, starts=starts, seed=seed, jobs=jobs)


@app.command()
@guarded
def report(
    result: Annotated[Path, typer.Argument(help="Folder that mbw tune wrote.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder or .html; default: beside the result."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write one self-contained HTML file of a result."""
    SCREEN.quiet = quiet
    report_verb.run(result, out)


def main() -> None:
    """Run the command with one BLAS thread: more gain nothing here and sometimes cost dearly."""
    arguments = sys.argv[1:]
    if "--debug" in arguments:  # wherever it stands
        arguments.remove("--debug")
        arguments.insert(0, "--debug")
    with threadpool_limits(1):
        app(arguments, prog_name="mbw")
