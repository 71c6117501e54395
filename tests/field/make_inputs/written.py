"""Cases on models that the workbench writes: they are the machine that was tuned."""

from tests.field.make_inputs.folder import write_case

SPRING = 'stiffness="3e5" damping="50"'
ARM = """<robot name="arm"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 -0.4" rpy="0 0 0"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="10" velocity="1"/><dynamics damping="0.02"/></joint>
</robot>
"""
U_PROFILE = [(0, 0), (1, 0), (1, 1), (0.9, 1), (0.9, 0.1), (0.1, 0.1), (0.1, 1), (0, 1)]


def write():
    """Write all cases of this module."""
    _tuned()
    _mesh()


def _machine(spring=SPRING, before="", compiler=""):
    """Return two stages on slides, 10 and 4 kg as their geoms have them."""
    box = '<geom type="box" size=".2 .1 .05" mass="{}" contype="0" conaffinity="0"/>'
    return (
        f'<mujoco>{before}{compiler}<option gravity="0 0 0"/><worldbody><body name="base">'
        f'<joint name="bx" type="slide" axis="1 0 0" {spring}/>{box.format(10)}<site name="acc1"/>'
        '<body name="stage" pos="0 0 .1"><joint name="sx" type="slide" axis="1 0 0" '
        f'stiffness="2e5" damping="30"/>{box.format(4)}<site name="acc2"/></body></body>'
        "</worldbody></mujoco>\n"
    )


def _tune(model, freq_hz, *priors):
    """Return the runs that tune a model to frequencies and predict the modes of tuned.xml."""
    value = {"path": "modes.*.frequency", "near": freq_hz, "tolerance": 5e-3}
    options = [word for prior in priors for word in ("--prior", prior)]
    tune = ["tune", "--modes", "modes.csv", model, "--out", "t", "--no-pictures", *options]
    predict = ["predict", "t/tuned.xml", "--out", "p", "--json", "r.json", "--no-pictures"]
    return [{"command": tune}, {"command": predict, "value": [value]}]


def _tuned():
    masses = ("*.mass=0.3", "*.stiffness=0.01")
    table = "frequency,damping/%\n20,2.5\n50,2\n"
    cases = {
        "springs_by_frequency": (
            "the joints of a class state springdamper in place of stiffness",
            {"m.xml": _machine('springdamper="0.02 0.03"')},
            "m.xml", [30.0, 200.0], ("*.mass=0",),
        ),
        "total_mass_in_an_included_file": (
            "an included file states settotalmass",
            {
                "m.xml": _machine(before='<include file="c.xml"/>'),
                "c.xml": '<mujoco><compiler settotalmass="28"/></mujoco>\n',
            },
            "m.xml", [20.0, 50.0], masses,
        ),
        "a_urdf": ("the model is a URDF", {"m.urdf": ARM}, "m.urdf", [0.7], ("*.com_z=0.3",)),
    }  # fmt: skip
    for name, (situation, files, model, freq_hz, priors) in cases.items():
        rows = table if len(freq_hz) == 2 else "frequency\n"
        if freq_hz[0] != 20.0:
            rows = "frequency\n" + "".join(f"{value}\n" for value in freq_hz)
        write_case(
            f"written/{name}",
            situation,
            f"tuned.xml has the frequencies of the table, {freq_hz} Hz",
            _tune(model, freq_hz, *priors),
            {**files, "modes.csv": rows},
        )


def _mesh():
    corners = [(0.1 * x, 0.1 * y, z) for z in (0.0, 0.2) for x, y in U_PROFILE]
    caps = [(0, 5, 7), (5, 6, 7), (0, 1, 5), (1, 4, 5), (1, 2, 4), (2, 3, 4)]
    faces = [(a, c, b) for a, b, c in caps] + [(a + 8, b + 8, c + 8) for a, b, c in caps]
    for k in range(8):
        n = (k + 1) % 8
        faces += [(k, n, n + 8), (k, n + 8, k + 8)]
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in corners]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    model = (
        '<mujoco><option gravity="0 0 0"/><asset><mesh name="u" file="u.obj"/></asset><worldbody>'
        '<body name="a"><joint name="j" type="slide" axis="1 0 0" stiffness="1e5"/>'
        '<geom type="mesh" mesh="u" density="2700"/><site name="acc1"/></body></worldbody>'
        "</mujoco>\n"
    )
    value = {"path": "modes.*.frequency", "near": [40.93], "tolerance": 1e-3}
    write_case(
        "written/mass_of_a_profile",
        "MuJoCo's default gives a U profile another mass than its volume has",
        "the mode of the exact mass, with a remark that names both masses",
        [
            {
                "command": ["predict", "m.xml", "--out", "p", "--json", "r.json"],
                "says": ["1.512 kg, the exact volume", "MuJoCo's default gives"],
                "value": [value],
            }
        ],
        {"m.xml": model, "u.obj": "\n".join(lines) + "\n"},
    )
