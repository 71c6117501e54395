"""The command ``python -m truth.grade``: grade a folder of cases.

Each of its folders is a case: ``verdict.json``, ``answer.toml``, if they were made ``refit.json``
and ``oracle.json``, and the campaign in ``campaign/`` or beside them.
"""

from pathlib import Path
from typing import Annotated

import typer

from truth.grade.cases import CaseFiles
from truth.grade.report import grade, to_json
from truth.grade.text_tables import tables

BAD_INPUT = 3

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


def cases_in(folder: Path) -> list[CaseFiles]:
    """Return the cases of a folder, by the names of their folders."""
    cases = []
    for case_folder in sorted(child for child in folder.iterdir() if child.is_dir()):
        refit, oracle, campaign = (
            case_folder / name for name in ("refit.json", "oracle.json", "campaign")
        )
        cases.append(
            CaseFiles(
                name=case_folder.name,
                campaign=campaign if campaign.is_dir() else case_folder,
                verdict=case_folder / "verdict.json",
                answer=case_folder / "answer.toml",
                refit=refit if refit.exists() else None,
                oracle=oracle if oracle.exists() else None,
            )
        )
    return cases


@app.command()
def judge(
    folder: Annotated[Path, typer.Argument(help="Holds one folder for each case.")],
    *,
    json: Annotated[Path | None, typer.Option(help="Where the report goes as JSON.")] = None,
    baselines: Annotated[bool, typer.Option(help="Judge the baselines, too.")] = True,
) -> None:
    """Grade the verdicts of a folder of cases against their sealed answers."""
    try:
        cases = cases_in(folder)
        if not cases:
            typer.echo(f"truth.grade: {folder}: holds no folder of a case", err=True)
            raise typer.Exit(BAD_INPUT)
        report = grade(cases, baselines=baselines)
        if json is not None:
            json.write_text(to_json(report), encoding="utf-8")
    except OSError as error:
        typer.echo(f"truth.grade: {error}", err=True)
        raise typer.Exit(BAD_INPUT) from error
    typer.echo(tables(report), nl=False)


if __name__ == "__main__":
    app(prog_name="python -m truth.grade")
