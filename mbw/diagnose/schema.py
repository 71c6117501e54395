"""``diagnosis.json``: names and labels that the page of a diagnosis needs beside the verdict."""

from pydantic import BaseModel, ConfigDict

from identification.words import Quantity, VarianceSource
from mbw.identify.schema import FaultRow
from tuning.files.schema import InputRow

Point = tuple[float, float, float]


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class TestRow(_Row):
    """One reference of one file.

    Args:
        label: what the page calls it.
        file, reference, level, setup, averages: as the campaign states them.
        variance_from: where the noise's variance comes from.
    """

    __test__ = False  # the field's word, not a case for pytest

    label: str
    file: str
    reference: str
    level: float | None
    setup: str | None
    averages: int | None
    variance_from: VarianceSource


class ChannelRow(_Row):
    """One output of one test.

    Args:
        output: its label.
        body: that it sits on.
        test: number of its test.
    """

    output: str
    body: str
    test: int


class MeshRow(_Row):
    """A surface, whose vertices, triangles and edges are so many in the arrays."""

    stage: str | None
    colour: tuple[float, float, float, float] | None
    vertices: int
    triangles: int
    edges: int


class LineRow(_Row):
    """A piece of a tendon; one stage a point."""

    name: str
    stages: list[str | None]
    colour: tuple[float, float, float, float] | None


class MachineRow(_Row):
    """Bodies, points and what they look like; ``body_of`` numbers the body of each point."""

    bodies: list[str]
    points: list[str]
    body_of: list[int]
    surfaces: list[MeshRow]
    lines: list[LineRow]
    boxed: list[str]


class PlaceRow(_Row):
    """Where a location of the verdict is: its bodies, and points [m] in world axes."""

    bodies: list[str]
    points: list[Point]


class CentresRow(_Row):
    """A step of the gap at the centres of mass, each direction of each body a channel.

    Args:
        name: of the step.
        error, excess: as of the channels; null where a number does not exist.
        channels: how many.
    """

    name: str
    error: float | None
    excess: float | None
    channels: int


class StepsRow(_Row):
    """95 % intervals of the steps of the gap; null where no lines could be held out.

    Args:
        as_drawn, retuned, after: of excess.
        noise: of the error that the noise alone makes.
    """

    as_drawn: tuple[float, float] | None = None
    retuned: tuple[float, float] | None = None
    after: tuple[float, float] | None = None
    noise: tuple[float, float] | None = None


class ShownFile(_Row):
    """diagnosis.json.

    Args:
        campaign, model: names.
        quantity: of all FRFs.
        band: first and last line [Hz].
        lines: how many.
        block: lines that are held out together; null where the band is too narrow.
        tests: of the campaign.
        channels: columns of the arrays.
        corrected: channels whose measurement the effect corrects, in the arrays' order.
        centres: the gap at the centres of mass, with the covariance of the reduction, step by step.
        steps: intervals of the gap, step by step.
        means: what each cause of the verdict is, in the catalogue's words; empty where it has none.
        solid: what the spare channels of each body say, in words.
        taken_out: faults that they prove; their channels took no part in the search.
        doubted: bodies that bend: their channels counted with so much doubt.
        remarks: what a reader of any result must know.
        machine: to draw it.
        places: every location that the verdict or the evidence names.
        inputs: files that were read.
        not_held_by_mjcf: what augmented.xml does not hold, and why.
    """

    campaign: str
    model: str
    quantity: Quantity
    band: tuple[float, float]
    lines: int
    block: int | None
    tests: list[TestRow]
    channels: list[ChannelRow]
    corrected: list[int]
    steps: StepsRow = StepsRow()
    centres: list[CentresRow]
    means: list[str]
    solid: list[str]
    taken_out: list[FaultRow]
    doubted: list[str]
    remarks: list[str]
    machine: MachineRow
    places: dict[str, PlaceRow]
    inputs: list[InputRow]
    not_held_by_mjcf: list[str]
