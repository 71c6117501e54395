"""Bodies of the requests of the workbench's page."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from mbw.workbench.desk import Desk
from mbw.workbench.edits import MachineEdit
from mbw.workbench.jobs import JobQueue, Verb
from mbw.workbench.state import Action


class _Request(BaseModel):
    model_config = ConfigDict(extra="forbid")


class ActRequest(_Request):
    """An action of a browser that shows a revision."""

    revision: int
    action: Action


class PreviewRequest(_Request):
    """Changes that are shown before they count."""

    values: dict[str, FiniteFloat] = {}
    edit: MachineEdit | None = None


class JobRequest(_Request):
    """A request to add, cancel, resume or show a job."""

    do: Literal["add", "cancel", "resume", "show"]
    verb: Verb = "tune"
    partner: Annotated[str, Field(max_length=4096)] = ""
    number: int = 0

    def run(self, jobs: JobQueue, desk: Desk) -> list[str]:
        """Carry out the request, and return sentences for the page.

        Args:
            jobs: all jobs.
            desk: whose state a new job takes.

        Raises:
            WorkbenchError: what is asked for cannot be.
        """
        if self.do == "add":
            job = jobs.add(self.verb, desk.subject, desk.state, self.partner)
            return [f"job {job.number}: mbw {job.verb} waits for its turn", *job.remarks]
        if self.do == "cancel":
            jobs.cancel(self.number)
            return [f"job {self.number} is cancelled"]
        if self.do == "show":
            jobs.show(self.number)
            return [f"the result of job {self.number} is shown"]
        jobs.resume(self.number)
        return [f"job {self.number} goes on"]


def describe_wrong_request(error: ValidationError) -> tuple[int, str]:
    """Return status and sentence for a request that cannot be: a size, or what no page sends.

    Args:
        error: of its body.
    """
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    place = [str(part) for part in first["loc"]]
    if "edit" in place and place[-1] != "edit":
        what = first["msg"].removeprefix("Input ").removesuffix(".")
        size = place[-1] if len(place[-1]) > 1 else f"{place[-2]} {'xyz'[int(place[-1])]}"
        return 422, f"{size}: the value {what}"
    return 400, "the request is none of this version's page: open the page again"
