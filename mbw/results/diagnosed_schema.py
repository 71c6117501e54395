"""Content of ``diagnosis.json``: names and labels of the page, in addition to the verdict."""

from identification.readers.result_files import ResultFile, StrictRow
from identification.solid import Fault
from identification.words import Quantity, VarianceSource
from tuning.files.plant_folder import PlantRow
from tuning.files.schema import InputRow

Point = tuple[float, float, float]


class DiagnosedTestRow(StrictRow):
    """One test: a reference in a file.

    Args:
        label: name of the test on the page.
        file, reference, level, setup, averages: as the campaign states them.
        variance_from: source of the noise's variance.
    """

    label: str
    file: str
    reference: str
    level: float | None
    setup: str | None
    averages: int | None
    variance_from: VarianceSource


class ChannelRow(StrictRow):
    """One output of one test.

    Args:
        output: label of the output.
        body: body of the sensor.
        test: index of the test.
    """

    output: str
    body: str
    test: int


class MeshRow(StrictRow):
    """Surface of a body, with the numbers of its vertices, triangles and edges in the arrays."""

    stage: str | None
    colour: tuple[float, float, float, float] | None
    vertices: int
    triangles: int
    edges: int


class LineRow(StrictRow):
    """Piece of a tendon, with the stage of each of its points."""

    name: str
    stages: list[str | None]
    colour: tuple[float, float, float, float] | None


class MachineRow(StrictRow):
    """Bodies, points and geometry of a machine; ``body_of`` is the body's index of each point."""

    bodies: list[str]
    points: list[str]
    body_of: list[int]
    surfaces: list[MeshRow]
    lines: list[LineRow]
    boxed: list[str]


class PlaceRow(StrictRow):
    """Bodies of a location of the verdict, with its points.

    Args:
        bodies: bodies that the location concerns.
        points: places [m] in world axes.
        line: both ends of a link [m] in world axes: the centres of mass of its bodies; else empty.
        axis: direction along which a link is stiffest, a unit vector in world axes; null for all
            other locations, and for a link that is alike in all directions.
    """

    bodies: list[str]
    points: list[Point]
    line: list[Point] = []
    axis: Point | None = None


class CentresRow(StrictRow):
    """Gap at the centres of mass in one step of the diagnosis; a channel is a body's direction.

    Args:
        name: name of the step.
        error, excess: relative error, and error over noise; null if unknown.
        channels: number of channels.
    """

    name: str
    error: float | None
    excess: float | None
    channels: int


class StepsRow(StrictRow):
    """95 % intervals of the gap in each step; null if no frequency lines could be held out.

    Args:
        as_drawn, retuned, after: intervals of the excess.
        noise: interval of the error that the noise alone causes.
    """

    as_drawn: tuple[float, float] | None = None
    retuned: tuple[float, float] | None = None
    after: tuple[float, float] | None = None
    noise: tuple[float, float] | None = None


class EstablishedRow(StrictRow):
    """Established cause.

    Args:
        cause: index of its row among the causes of the verdict.
        closed: part of the gap that it closes; null if no model holds it.
    """

    cause: int
    closed: float | None


class ShownFile(ResultFile, StrictRow):
    """Content of ``diagnosis.json``.

    Args:
        campaign, model: names of the campaign and of the machine.
        quantity: quantity of all FRFs.
        band: first and last frequency line [Hz].
        lines: number of frequency lines.
        block: mean number of neighbouring lines that are held out together; null if the band is too
            narrow.
        tests: tests of the campaign.
        channels: columns of the arrays.
        corrected: channels whose measurement the effect corrects, in the order of the arrays.
        centres: gap at the centres of mass in each step, with the covariance of the reduction.
        steps: intervals of the gap in each step.
        means: meaning of each cause by the catalogue; empty for a cause without one.
        established: established causes, with the part of the gap that each closes.
        solid: results of the rigid-body checks, one sentence for each body.
        taken_out: faults that redundant channels prove; the search leaves their channels out.
        remarks: findings on the data and on the fits.
        machine: bodies, points and geometry for the picture.
        places: every location that the verdict or the evidence names.
        inputs: input files with their hashes.
        not_held_by_mjcf: parameters that augmented.xml does not hold, with reasons.
        not_held_error: relative change of the FRFs without them, over the channels.
        mjcf_difference: how augmented.xml, read back, differs from the machine in memory in what
            an MJCF can hold; empty if it does not.
        plant: what augmented.xml is as a plant, with its doubts and alternatives; null in files of
            earlier versions.
    """

    campaign: str
    model: str
    quantity: Quantity
    band: tuple[float, float]
    lines: int
    block: int | None
    tests: list[DiagnosedTestRow]
    channels: list[ChannelRow]
    corrected: list[int]
    steps: StepsRow = StepsRow()
    centres: list[CentresRow]
    means: list[str]
    established: list[EstablishedRow] = []
    solid: list[str]
    taken_out: list[Fault]
    remarks: list[str]
    machine: MachineRow
    places: dict[str, PlaceRow]
    inputs: list[InputRow]
    not_held_by_mjcf: list[str]
    not_held_error: float | None = None
    mjcf_difference: str = ""
    plant: PlantRow | None = None
