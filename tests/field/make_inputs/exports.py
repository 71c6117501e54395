"""Cases on what exporters state beside the values: axes of nodes, fields, widths, headings."""

import tempfile
from pathlib import Path

import meshio
import numpy as np
from identification_examples import Function, dataset

from tests.field.make_inputs.folder import (
    ARRAYS,
    CHANNELS,
    UNIVERSAL,
    array_files,
    campaign,
    identify,
    measured,
    modes_are,
    npz,
    write_case,
)
from tests.field.make_inputs.units import universal
from tests.field.virtual_machine import (
    FREQ_HZ,
    HEIGHT_M,
    SITES,
    field_machine,
    layout_text,
    model_text,
)


def write():
    """Write all cases of this module."""
    _axes_of_nodes()
    _fields_of_meshes()
    _lists_and_keys()
    _continuous_forces()
    _widths_and_headings()
    _absurd_sizes()


def _numbers(values, form="13.5E"):
    return "".join(f"{v:{form}}" for v in values)


def _node_lines(places, definition, displacement):
    """Return the lines of a dataset 15; one displacement system for all or one for each."""
    labels = np.broadcast_to(displacement, len(places))
    return [
        "".join(f"{f:10d}" for f in (n, definition, label, 11)) + _numbers(place)
        for n, (place, label) in enumerate(zip(places, labels, strict=True), start=1)
    ]


def _records(channels):
    """Return functions 58b of channels [(node, direction, values (n_freq, n_ref), coherence)]."""
    content = b""
    for node, direction, *parts in channels:
        for column, reference in enumerate(((1, 3), (3, 3))):
            common = {
                "x": FREQ_HZ,
                "rsp": (node, direction),
                "ref": reference,
                "order": "<",
                "single": True,
            }
            for values, kind, ordinate in zip(parts, (4, 6), (12, 0), strict=True):
                content += Function(
                    values[:, column], func=kind, ordinate=ordinate, **common
                ).content()
    return content


def _axes_of_nodes():
    values, coherence = measured()
    places = np.column_stack([SITES, np.full(len(SITES), HEIGHT_M)])
    right = modes_are(field_machine().modes()[0])
    test = f'layout = "geometry.unv"\n\n[[test]]\n{UNIVERSAL}\n'

    # Node 4 in a system whose x axis points down; the nodes are given from a corner.
    corner = np.array([0.5, -0.25, 0.1])
    down = [np.zeros(3), [0, 0, -1], [1, 0, 0]]  # origin, on +x, in the plane of +x and +z
    offset = [corner, *(corner + np.eye(3)[[0, 2]])]
    lines = [
        line
        for label, points in ((2, down), (3, offset))
        for line in (
            "".join(f"{f:10d}" for f in (label, 0, 0, 8, 1)),
            "",
            _numbers(np.ravel(points)[:6]),
            _numbers(np.ravel(points)[6:]),
        )
    ]
    rows = [(n, 3, values[:, n - 1], coherence[:, n - 1]) for n in (1, 2, 3, 5)]
    rows.append((4, 1, -values[:, 3], coherence[:, 3]))
    write_case(
        "exports/turned_node",
        "datasets 15 and 18: positions from a corner, and one node whose x axis points down",
        "positions moved and axes turned, with remarks that name both; a solid body",
        [
            identify(
                "--json",
                "r.json",
                says=["node 4", "system 2", "system 3", "it moves as a solid"],
                never=["wrong axes", "polarity"],
                value=right,
            )
        ],
        {
            "campaign.toml": test,
            "geometry.unv": dataset("    18", lines)
            + dataset("    15", _node_lines(places - corner, 3, [0, 0, 0, 2, 0])),
            "t.uff": _records(rows),
        },
    )

    # A cylinder about the world's x axis: radial and tangential directions lie in the plane of y
    # and z, and share the motion along z by the angle of each node.
    angle = np.arctan2(places[:, 2], places[:, 1])
    system = [f"{4:10d}{1:10d}{8:10d}", "drum"]
    system += [_numbers(row, "25.16E") for row in ((0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 0, 0))]
    rows = [
        (n + 1, direction, factor[n] * values[:, n], coherence[:, n])
        for n in range(len(places))
        for direction, factor in ((1, np.sin(angle)), (2, np.cos(angle)))
    ]
    content = b"".join(
        Function(
            part, x=FREQ_HZ, rsp=(node, direction), ref=(1, 2), order="<", single=True, **kinds
        ).content()
        for node, direction, frf, share in rows
        # The force along z at node 1 and the tangential force there differ by the cosine.
        for part, kinds in (
            (frf[:, 0] * np.cos(angle[0]), {"func": 4, "ordinate": 12}),
            (share[:, 0], {"func": 6, "ordinate": 0}),
        )
    )
    write_case(
        "exports/cylindrical_nodes",
        "datasets 2420 and 15 in the file of the measurement: radial and tangential channels",
        "the axes of each node, with a remark that names the system; a solid body",
        [
            identify(
                "--json",
                "r.json",
                says=["system 4 (cylindrical)", "it moves as a solid"],
                never=["never moves as a solid", "polarity"],
                value=right,
            )
        ],
        {
            "campaign.toml": test.replace("geometry.unv", "t.uff"),
            "t.uff": dataset("  2420", [f"{1:10d}", "Part1", *system])
            + dataset("    15", _node_lines(places, 0, 4))
            + content,
        },
    )


def _fields_of_meshes():
    x, y = np.meshgrid(np.linspace(0, 1.2, 9), np.linspace(0, 0.7, 6), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    corner = np.array([6 * i + j for i in range(8) for j in range(5)])
    cells = [("quad", corner[:, None] + np.array([0, 6, 7, 1]))]
    data = {}
    for number, (m, n) in enumerate(((1, 1), (2, 1), (1, 2)), start=7):
        deflection = np.sin(m * np.pi * points[:, 0] / 1.2) * np.sin(n * np.pi * points[:, 1] / 0.7)
        shape = np.column_stack([0 * deflection, 0 * deflection, deflection])
        slopes = np.gradient(deflection.reshape(x.shape), x[:, 0], y[0])
        rotation = np.column_stack([slopes[1].ravel(), -slopes[0].ravel(), 0 * deflection])
        for name, values in (
            ("U{} real", np.cos(0.4) * shape),
            ("U{} imag", np.sin(0.4) * shape),
            ("UR{}", rotation),
            ("RF{}", 1e4 * shape),
        ):
            data[f"{name.format(number)} ({7.5 * number:g} Hz)"] = values
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plate.vtu"
        meshio.Mesh(points, cells, point_data=data).write(path)
        mesh = path.read_bytes()
    write_case(
        "exports/fields_of_a_mesh",
        "a mesh with U (real and imaginary), UR and RF of modes 7 to 9",
        "three modes with their numbers; the other fields are named and left out",
        [
            {
                "command": ["place", "plate.vtu", "--json", "r.json"],
                "says": ["UR7 (52.5 Hz)", "RF7 (52.5 Hz)", "left out", "complex modes"],
                "value": [{"path": "modes.*.mode", "equals": [7, 8, 9]}],
            }
        ],
        {"plate.vtu": mesh},
    )


def _lists_and_keys():
    values, coherence = measured()
    write_case(
        "exports/range_in_list",
        "a list of channels that holds a range and a label",
        "the modes",
        [identify("--json", "r.json", value=modes_are(field_machine().modes()[0]))],
        array_files(
            values,
            coherence,
            ARRAYS.replace(CHANNELS, 'channels = ["nodes 1..4, z", "acc5:+z"]'),
        ),
    )
    write_case(
        "exports/misspelt_key",
        "a key of [[test]] and one of the layout that are misspelt",
        "exit 3 and the key that was meant",
        [
            identify(exit_code=3, says=["test.1.refrences", "did you mean references?"]),
            {
                "command": ["identify", "layout", "--out", "out"],
                "exit_code": 3,
                "says": ["site.acc1.positon", "did you mean position?"],
            },
        ],
        {
            "campaign.toml": campaign(ARRAYS.replace("references =", "refrences =")),
            "layout.toml": layout_text(),
            "layout/campaign.toml": campaign(ARRAYS),
            "layout/layout.toml": layout_text().replace("position", "positon", 1),
        },
    )


def _continuous_forces():
    random = np.random.default_rng(8)
    rate_hz, n_sample = 128.0, 2048
    time = np.arange(n_sample) / rate_hz
    forces = {
        "random_force": (
            "random force without rest",
            random.normal(size=n_sample),
            ["neither repeats nor rests", "Hann windows"],
        ),
        "burst_force": (
            "a force of random bursts",
            random.normal(size=n_sample) * (time % 4.0 < 1.0),
            ["bursts, 4 blocks"],
        ),
    }
    for name, (situation, force, words) in forces.items():
        response = random.normal(size=(5, n_sample)) * 0.01 + force
        write_case(
            f"exports/{name}",
            situation,
            "exit 0: continuous excitation becomes FRFs, and its blocks are said",
            [identify(exit_code=0, says=[*words, "No mode was identified"])],
            {
                "campaign.toml": campaign(f'file = "t.npz"\n{CHANNELS}\nreferences = ["1:+z"]'),
                "layout.toml": layout_text(),
                "t.npz": npz(
                    force=force.astype(np.float32),
                    response=response.astype(np.float32),
                    rate_hz=rate_hz,
                ),
            },
        )


def _widths_and_headings():
    values, coherence = measured()
    count = len(FREQ_HZ)
    narrow = universal(values[:, :1], order="")
    write_case(
        "exports/double_width",
        "a universal file that states double precision, with values of 13 characters",
        "exit 3 and both",
        [identify(exit_code=3, says=["record 1 states double precision", "13 characters wide"])],
        {
            "campaign.toml": campaign(UNIVERSAL),
            "layout.toml": layout_text(),
            "t.uff": narrow.replace(f"{5:10d}{count:10d}".encode(), f"{6:10d}{count:10d}".encode()),
        },
    )
    write_case(
        "exports/decibels",
        "magnitudes in dB instead of FRFs",
        "exit 3: the phase is missing",
        [identify(exit_code=3, says=["decibels", "phase"])],
        array_files(20 * np.log10(np.abs(values)), coherence),
    )
    freq, damping = field_machine().modes()
    rows = "".join(f"{f:.6g},{z:.6g}\n" for f, z in zip(freq, damping, strict=True))
    write_case(
        "exports/ratio_under_per_cent",
        "damping ratios under the heading damping/%",
        "the heading is doubted",
        [
            {
                "command": ["tune", "--modes", "modes.csv", "model.xml", "--out", "out"],
                "says": ["damping/%", "if the values are ratios"],
            }
        ],
        {"model.xml": model_text(), "modes.csv": f"frequency/Hz,damping/%\n{rows}"},
    )


def _absurd_sizes():
    copies = '<replicate count="1e7" offset="0 0 1"><site/></replicate>'
    field = '<asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset>'
    write_case(
        "exports/absurd_sizes",
        "a model that replicates a site 1e7 times, and one with a height field of 9e8 points",
        "exit 3 at once, naming the element",
        [
            {
                "command": ["predict", f"{name}.xml", "--modes"],
                "exit_code": 3,
                "says": [f"<{name}", words],
            }
            for name, words in (("replicate", "1e+07 elements"), ("hfield", "9e+08 points"))
        ],
        {
            "replicate.xml": model_text().replace("<worldbody>", f"<worldbody>{copies}"),
            "hfield.xml": model_text().replace("<worldbody>", f"{field}<worldbody>"),
        },
        limit_s=20,
    )
