"""The diagnosis of a campaign: what the model lacks."""

from dataclasses import dataclass
from pathlib import Path

from diagnosis import Diagnosis, Verdict, build_verdict
from diagnosis import diagnose as diagnose_session
from mbworkbench.campaign import MeasuredCampaign
from mbworkbench.labels import AnyPath, as_path, check_count
from mbworkbench.model import MachineModel
from mbworkbench.sessions import open_together
from mbworkbench.tables import cell_text, html_table


@dataclass(frozen=True, eq=False)
class DiagnosisResult:
    """The verdict on a campaign, with everything that led to it.

    Attributes:
        campaign: name of the campaign.
        verdict: the content of ``verdict.json``.
        diagnosis: fits, scores, refits and evidence.
    """

    campaign: str
    verdict: Verdict
    diagnosis: Diagnosis

    def write(self, file: AnyPath) -> Path:
        """Write the verdict as JSON.

        Args:
            file: path of the file.

        Raises:
            OSError: the file cannot be written.
        """
        target = as_path(file)
        target.write_text(self.verdict.model_dump_json(indent=1) + "\n", encoding="utf-8")
        return target

    def __repr__(self) -> str:
        """Return verdict, gap, most probable causes and rest in at most ten lines."""
        verdict, gap = self.verdict, self.verdict.gap
        rest = [verdict.rest] if verdict.rest and verdict.rest.significant else []
        steps = {"nominal": gap.as_drawn, "re-tuned": gap.retuned, "with the cause": gap.after}
        return "\n".join(
            (
                f"{self.campaign}: {verdict.verdict}",
                *(
                    f"  {name}: error {cell_text(step.error)}, excess {cell_text(step.excess)}"
                    for name, step in steps.items()
                    if step.excess is not None
                ),
                *(
                    f"  {100 * cause.probability:.0f} % {cause.effect} at {cause.location} "
                    f"{cause.dof or ''}".rstrip()
                    for cause in verdict.causes[:3]
                ),
                *(
                    f"  rest: excess {cell_text(row.excess)}, model error "
                    f"{100 * row.model_error:.2g} %, {row.spread}"
                    for row in rest
                ),
            )
        )

    def _repr_html_(self) -> str:
        """Return the verdict and a table of its causes for a notebook."""
        header = ("effect", "location", "direction", "probability", "parameters")
        rows = [
            (
                cause.effect,
                cause.location,
                cause.dof,
                cause.probability,
                ", ".join(
                    f"{name} {_value_text(value)}" for name, value in cause.parameters.items()
                ),
            )
            for cause in self.verdict.causes
        ]
        return html_table(f"{self.campaign}: {self.verdict.verdict}", header, rows)


def diagnose(
    campaign: MeasuredCampaign | AnyPath,
    model: MachineModel | None = None,
    *,
    band: tuple[float, float] | None = None,
    jobs: int = 1,
) -> DiagnosisResult:
    """Find what the model lacks, where, and how far the gap shrinks once it is added.

    Args:
        campaign: from ``read_campaign``, or the path of its folder.
        model: the nominal model; the one that ``campaign.toml`` names if None.
        band: lowest and highest frequency [Hz]; the lines with coherence if None.
        jobs: number of processes; the verdict does not depend on it.

    Raises:
        InputError: campaign or model cannot be used.
        UsageError: arguments are exchanged or out of their range, or the band holds too few
            lines.
    """
    check_count("jobs", jobs)
    session = open_together(campaign, model, band)
    diagnosis = diagnose_session(session, jobs=jobs)
    return DiagnosisResult(session.campaign.name, build_verdict(diagnosis), diagnosis)


def _value_text(value: object) -> str:
    if isinstance(value, list | tuple):
        return "(" + ", ".join(cell_text(part) for part in value) + ")"
    return cell_text(value)
