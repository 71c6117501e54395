"""The command ``mbw VERB``: options in, exit codes out."""

import math
import sys
from pathlib import Path
from typing import Annotated

import typer
from threadpoolctl import threadpool_limits

from identification.modal import Tolerances, Wishes
from identification.shapes import How
from identification.words import UsageError
from mbw import demo as demo_verb
from mbw import report as report_verb
from mbw.blind import verb as blind_verb
from mbw.diagnose import verb as diagnose_verb
from mbw.identify import verb as identify_verb
from mbw.match import place as place_verb
from mbw.match import verb as match_verb
from mbw.messages import SCREEN, guarded
from mbw.predict import verb as predict_verb
from mbw.tune import verb as tune_verb
from mbw.tune.modes import parse_residuals
from tuning import GAUSS_NEWTON

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
Mesh = Annotated[Path, typer.Argument(help="Mesh with shapes as point data.")]
Frequencies = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Frequencies, one a row, of the shapes.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Errors only.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the random starts.")]
_TOLERANCES = Tolerances()


def _ordered(band: tuple[float, float] | None) -> None:
    if band is not None and band[0] >= band[1]:
        raise UsageError(f"--band {band[0]:g} {band[1]:g}: give the lower frequency first")


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
def identify(  # noqa: PLR0913  # one for each option
    campaign: Annotated[Path, typer.Argument(help="Folder with a campaign.toml.")],
    *,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results; default: <campaign>-modes.")
    ] = None,
    json: Json = None,
    band: Band = None,
    frequency_tolerance: Annotated[
        float, typer.Option(min=0, metavar="RATIO", help="Poles of one mode: relative difference.")
    ] = _TOLERANCES.frequency,
    damping_tolerance: Annotated[
        float, typer.Option(min=0, metavar="RATIO", help="The same of their damping ratios.")
    ] = _TOLERANCES.damping,
    mac_tolerance: Annotated[
        float, typer.Option(min=0, max=1, metavar="MAC", help="Least MAC of their participation.")
    ] = _TOLERANCES.participation,
    persistence: Annotated[
        float, typer.Option(min=0, max=1, help="Least share of model orders that hold a mode.")
    ] = _TOLERANCES.persistence,
    highest_damping: Annotated[
        float, typer.Option(min=0, max=100, metavar="PERCENT", help="Poles with more are no modes.")
    ] = 100 * _TOLERANCES.highest_damping,
    collinearity: Annotated[
        float, typer.Option(min=0, max=1, metavar="MPC", help="Least phase collinearity of modes.")
    ] = _TOLERANCES.collinearity,
    phase_deviation: Annotated[
        float, typer.Option(min=0, metavar="DEGREES", help="Greatest mean phase deviation.")
    ] = 180.0,
    add: Annotated[
        list[float] | None, typer.Option(metavar="HZ", help="Start a mode there; repeatable.")
    ] = None,
    drop: Annotated[
        list[float] | None, typer.Option(metavar="HZ", help="Leave out that mode; repeatable.")
    ] = None,
    force: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HZ,PERCENT",
            help="Keep a mode of this frequency and damping in per cent; repeatable.",
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Universal file of shapes to compare with."),
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="Write the full matrix of FRFs.")] = False,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Write them.")] = True,
    quiet: Quiet = False,
) -> None:
    """Identify the measured modal model: poles, damping, shapes, with standard deviations."""
    SCREEN.quiet = quiet
    _ordered(band)
    tolerances = Tolerances(
        frequency=frequency_tolerance,
        damping=damping_tolerance,
        participation=mac_tolerance,
        persistence=persistence,
        highest_damping=highest_damping / 100,
        collinearity=collinearity,
        phase_deviation=math.radians(phase_deviation),
    )
    forced = identify_verb.parse_forced(force or [])
    wishes = Wishes(add=tuple(add or ()), drop=tuple(drop or ()), force=forced)
    targets = identify_verb.Targets(out, json, pictures, full)
    choices = identify_verb.Choices(tolerances, wishes, against)
    identify_verb.run(campaign, targets, choices, band)


@app.command()
@guarded
def match(  # noqa: PLR0913  # one for each option
    shapes: Mesh,
    campaign: Annotated[Path, typer.Argument(help="Folder with a campaign.toml of impacts.")],
    *,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results; default: <campaign>-matched.")
    ] = None,
    frequencies: Frequencies = None,
    mass: Annotated[
        float | None, typer.Option(metavar="KG", help="What the structure weighs, within 5 %.")
    ] = None,
    nearest: Annotated[
        bool, typer.Option("--nearest", help="Shapes of the nearest node; default: interpolated.")
    ] = False,
    width: Annotated[
        float, typer.Option(min=0, metavar="HZ", help="Of the sliding average of amplitudes.")
    ] = 0.3,
    json: Json = None,
    quiet: Quiet = False,
) -> None:
    """Say which finite-element mode each measured one is: few sensors, no force."""
    SCREEN.quiet = quiet
    how: How = "nearest" if nearest else "interpolated"
    simulated = match_verb.Simulated(shapes, frequencies, mass, how)
    match_verb.run(simulated, campaign, out, json, width)


@app.command()
@guarded
def place(
    shapes: Mesh,
    *,
    frequencies: Frequencies = None,
    channels: Annotated[
        int | None, typer.Option(min=1, help="How many; default: three for each mode.")
    ] = None,
    apart: Annotated[
        float | None, typer.Option(min=0, metavar="METRES", help="Of two places at least.")
    ] = None,
    check: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Table site,x,y,z,axes or layout.toml to look at."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Where the table goes; default: stdout.")
    ] = None,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LOW HIGH", help="Modes to tell apart [Hz]; default: all elastic."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Say where few sensors tell finite-element modes apart, and which modes they confuse."""
    SCREEN.quiet = quiet
    _ordered(band)
    wanted = place_verb.Wanted(channels, band, apart)
    place_verb.run(match_verb.Simulated(shapes, frequencies), wanted, check, out)


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
def tune(  # noqa: PLR0913  # one for each option
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
    residual: Annotated[
        str,
        typer.Option(
            metavar="log|modal|modal,log",
            help="What is fitted: the FRFs' logarithm; frequencies, damping and shapes of modes; "
            "modes first and FRFs then.",
        ),
    ] = "log",
    algorithm: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Of the first stages: GAUSS_NEWTON, or an algorithm of NLopt such as LD_LBFGS.",
        ),
    ] = GAUSS_NEWTON,
    from_modes: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Modes that mbw identify wrote, not identified anew."),
    ] = None,
    at_bodies: Annotated[
        bool,
        typer.Option(
            "--at-bodies",
            help="FRFs count at the centres of mass, with the covariance of their reduction.",
        ),
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on where an interrupted run of this call ended.")
    ] = False,
    information: Annotated[
        bool,
        typer.Option(
            "--information", help="Say which further hammer point or sensor would tell most."
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Tune a model to a campaign, and say how sure that is and what gap remains."""
    SCREEN.quiet = quiet
    _ordered(band)
    tune_verb.run(
        campaign,
        out=out,
        json=json,
        band=band,
        starts=starts,
        seed=seed,
        jobs=jobs,
        search=tune_verb.Search(
            parse_residuals(residual), algorithm, "bodies" if at_bodies else "sensors", from_modes
        ),
        resume=resume,
        inform=information,
    )


@app.command()
@guarded
def diagnose(  # one for each option
    campaign: Annotated[Path, typer.Argument(help="Folder with a campaign.toml.")],
    *,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results; default: <campaign>-diagnosed.")
    ] = None,
    json: Json = None,
    band: Band = None,
    jobs: Jobs = 1,
    explain: Annotated[
        bool, typer.Option("--explain", help="Print what was tried, and why the rest fell.")
    ] = False,
    seed: Seed = 0,
    quiet: Quiet = False,
) -> None:
    """Say what the model lacks, where, and how far the gap shrinks with it.

    Nothing of it is drawn at random: any --seed gives the same verdict.
    """
    del seed
    SCREEN.quiet = quiet
    _ordered(band)
    diagnose_verb.run(campaign, out=out, json=json, band=band, jobs=jobs, explain=explain)


@app.command()
@guarded
def blind(  # one for each option
    model: Annotated[str, typer.Argument(help="MJCF of a machine, or trees: random machines.")],
    *,
    cases: Annotated[int, typer.Option(min=1, help="Campaigns to draw and judge.")] = 43,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Results; default: <model>-blind.")
    ] = None,
    seed: Seed = 0,
    jobs: Jobs = 1,
    band: Band = None,
    json: Json = None,
    quiet: Quiet = False,
) -> None:
    """Score the diagnosis on campaigns whose answers it cannot see; the same call goes on."""
    SCREEN.quiet = quiet
    _ordered(band)
    blind_verb.run(blind_verb.Wish(model, cases, seed, jobs, out, json, band))


@app.command()
@guarded
def report(
    result: Annotated[
        Path, typer.Argument(help="Folder that mbw tune, identify, diagnose or match wrote.")
    ],
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
