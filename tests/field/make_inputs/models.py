"""Cases on MJCF: elements that were misread, or are refused by name."""

from tests.field.make_inputs.folder import write_case

BOX = '<geom type="box" size=".1 .1 .1" mass="10" contype="0" conaffinity="0"/>'
SLIDE = '<joint name="j" type="slide" axis="0 0 1" stiffness="4000" damping="2"/>'
ONE_MODE_HZ = 3.18310  # sqrt(4000 / 10) / (2 pi)
TWO_MODES_HZ = [3.18310, 4.77465]  # sqrt(9000 / 10) / (2 pi) as well
CUBE = """v 0 0 0
v .1 0 0
v .1 .1 0
v 0 .1 0
v 0 0 .1
v .1 0 .1
v .1 .1 .1
v 0 .1 .1
"""
FACES = "1 4 3 2,5 6 7 8,1 2 6 5,2 3 7 6,3 4 8 7,4 1 5 8"


def write():
    """Write all cases of this module."""
    _read()
    _refused()
    _meshes()


def one_body(inside="", *, joint=SLIDE, before="", after="", option=""):
    """Return a machine of one body of 10 kg on a spring of 4 kN/m."""
    return (
        f"<mujoco>{option}<worldbody>{before}"
        f'<body name="a" pos="0 0 1">{joint}{BOX}<site name="acc1"/>{inside}</body>'
        f"</worldbody>{after}</mujoco>\n"
    )


def predict(**run):
    """Return the run that predicts the modes of ``model.xml``."""
    return {"command": ["predict", "model.xml", "--out", "out", "--json", "r.json"], **run}


def _modes(freq_hz):
    return [{"path": "modes.*.frequency", "near": freq_hz, "tolerance": 1e-4}]


TWO_SLIDES = (
    '<joint name="x" type="slide" axis="1 0 0" stiffness="4000" damping="2"/>'
    '<joint name="y" type="slide" axis="0 1 0" stiffness="9000" damping="2"/>'
)
TWO_BODIES = (
    '<body name="a"><joint name="ja" type="slide" axis="1 0 0" stiffness="4000" damping="2"/>'
    f'{BOX}<site name="acc1"/></body>'
    '<body name="b" pos="0 1 0"><joint name="jb" type="slide" axis="1 0 0" stiffness="9000" '
    f'damping="2"/>{BOX}<site name="acc2"/></body>'
)


def _read():
    one = [ONE_MODE_HZ]
    cases = {
        "two_motors_one_site": (
            "a motor at a joint numbered beyond the sites",
            TWO_MODES_HZ,
            one_body(
                joint=TWO_SLIDES,
                after='<actuator><motor name="mx" joint="x"/><motor name="my" joint="y"/>'
                "</actuator>",
            ),
        ),
        "mocap_without_mass": (
            "a massless mocap body",
            one,
            one_body(
                before='<body name="target" mocap="true" pos="0 0 2"><geom type="sphere" '
                'size=".02" contype="0" conaffinity="0" mass="0"/></body>'
            ),
        ),
        "anchors_like_sensors": (
            "tendon anchors that end in the number of a sensor",
            [3.55881],  # sqrt((4000 + 1000) / 10) / (2 pi)
            one_body(
                '<site name="leg1"/>',
                before='<site name="base1" pos="0 0 0"/>',
                after='<tendon><spatial name="t" stiffness="1000" springlength="1">'
                '<site site="base1"/><site site="leg1"/></spatial></tendon>',
                option='<option gravity="0 0 0"/>',
            ),
        ),
        "constraint_off_by_flag": (
            "a weld that a flag switches off",
            TWO_MODES_HZ,
            f'<mujoco><option><flag equality="disable"/></option><worldbody>{TWO_BODIES}'
            '</worldbody><equality><weld body1="a" body2="b"/></equality></mujoco>\n',
        ),
        "constraint_not_active": (
            "a weld that is not active",
            TWO_MODES_HZ,
            f"<mujoco><worldbody>{TWO_BODIES}</worldbody>"
            '<equality><weld body1="a" body2="b" active="false"/></equality></mujoco>\n',
        ),
        "gear": (
            "a gear (equality of two joints)",
            [3.55881],  # sqrt((4 * 4000 + 9000) / (4 * 10 + 10)) / (2 pi)
            f"<mujoco><worldbody>{TWO_BODIES}</worldbody><equality>"
            '<joint joint1="ja" joint2="jb" polycoef="0 2 0 0 0"/></equality></mujoco>\n',
        ),
        "discardvisual": (
            "a compiler that discards what is only seen",
            None,
            '<mujoco><compiler discardvisual="true"/><asset>'
            '<mesh name="seen" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/>'
            '<mesh name="body" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset><worldbody>'
            f'<body name="a">{SLIDE}<geom type="mesh" mesh="body"/>'
            '<geom type="mesh" mesh="seen" contype="0" conaffinity="0"/><site name="acc1"/></body>'
            "</worldbody></mujoco>\n",
        ),
        "one_name_twice": (
            "one name for a body, its joint and its motor",
            one,
            one_body(
                joint=SLIDE.replace('"j"', '"a"'),
                after='<actuator><motor name="a" joint="a"/></actuator>',
            ),
        ),
    }
    for name, (situation, freq, text) in cases.items():
        run = predict(value=_modes(freq)) if freq else predict()
        write_case(f"models/{name}", situation, "the modes", [run], {"model.xml": text})


def _refused():
    refused = {
        "infinity": (
            "a stiffness of infinity",
            one_body(joint=SLIDE.replace("4000", "infinity")),
            ["stiffness"],
        ),
        "huge": ("a mass of 1e308", one_body().replace('mass="10"', 'mass="1e308"'), ["mass"]),
        "not_a_number": (
            "a damping of nan(1)",
            one_body(joint=SLIDE.replace('damping="2"', 'damping="nan(1)"')),
            ["damping"],
        ),
        "missing_include": (
            "an included file that does not exist",
            one_body(option='<include file="elsewhere.xml"/>'),
            ["elsewhere.xml"],
        ),
        "cut": ("an MJCF that ends early", one_body()[:150], ["model.xml"]),
        "empty": ("an empty file", "", ["model.xml"]),
    }
    for name, (situation, text, says) in refused.items():
        write_case(
            f"models/{name}",
            situation,
            "exit 3, naming the element",
            [
                {
                    **predict(exit_code=3, says=says),
                    "command": ["predict", "model.xml", "--out", "o"],
                }
            ],
            {"model.xml": text},
        )
    write_case(
        "models/latin_1",
        "a name in latin-1",
        "exit 3, naming the encoding",
        [predict(exit_code=3, says=["model.xml"])],
        {"model.xml": one_body().replace('"a"', '"\xe4"').encode("latin-1")},
    )
    write_case(
        "models/keyframe",
        "a keyframe that is not called home",
        "the modes at rest, and a remark on the keyframe",
        [predict(says=["key"], value=_modes([ONE_MODE_HZ]))],
        {"model.xml": one_body(after='<keyframe><key name="folded" qpos="0.1"/></keyframe>')},
    )


def _obj(*, texture):
    """Return a cube, with more texture points than points if asked."""
    faces = [face.split() for face in FACES.split(",")]
    if not texture:
        return CUBE + "".join(f"f {' '.join(face)}\n" for face in faces)
    points = "".join(f"vt 0.{n:02d} 0.5\n" for n in range(24))
    lines = [
        "f " + " ".join(f"{corner}/{4 * n + m + 1}" for m, corner in enumerate(face))
        for n, face in enumerate(faces)
    ]
    return CUBE + points + "\n".join(lines) + "\n"


def _meshes():
    text = (
        '<mujoco><compiler angle="radian"/><asset><mesh name="m" file="part.obj"/></asset>'
        '<worldbody><body name="a"><joint name="j" type="slide" axis="0 0 1" stiffness="4000" '
        'damping=".1"/><geom type="mesh" mesh="m" density="2700" contype="0" conaffinity="0"/>'
        '<site name="acc1"/></body></worldbody></mujoco>\n'
    )
    hz = 6.12588  # sqrt(4000 / 2.7) / (2 pi): a cube of 0.1 m of 2700 kg/m^3
    for name, texture in (("obj", False), ("obj_with_texture", True)):
        write_case(
            f"models/{name}",
            f"an OBJ with {'more texture points than' if texture else 'nothing but'} points",
            "the mass of the cube",
            [predict(value=_modes([hz]))],
            {"model.xml": text, "part.obj": _obj(texture=texture)},
        )
    write_case(
        "models/broken_obj",
        "an OBJ whose face names a point that does not exist",
        "exit 3, naming the file",
        [predict(exit_code=3, says=["part.obj"])],
        {"model.xml": text, "part.obj": _obj(texture=False).replace("f 1 4", "f 1 400")},
    )
