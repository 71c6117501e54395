"""A machine of many stages as MJCF: six springs and dampers between each stage and its parent."""

import numpy as np

DIRECTIONS = {
    "tx": ("slide", "1 0 0"),
    "ty": ("slide", "0 1 0"),
    "tz": ("slide", "0 0 1"),
    "rx": ("hinge", "1 0 0"),
    "ry": ("hinge", "0 1 0"),
    "rz": ("hinge", "0 0 1"),
}


def large_mjcf(n_body: int, *, sensors: int = 4, seed: int = 0) -> str:
    """A random tree, each stage on one of the three before it, with sensors of three axes."""
    rng = np.random.default_rng(seed)
    parents = [-1] + [int(rng.integers(max(0, k - 3), k)) for k in range(1, n_body)]
    nodes = iter(range(1, n_body * sensors + 1))

    def place(size: float) -> str:
        return " ".join(f"{value:.6g}" for value in rng.uniform(-size, size, 3))

    def joint(body: int, direction: str) -> str:
        kind, axis = DIRECTIONS[direction]
        stiffness, damping = 10 ** rng.uniform(7, 8.5), 10 ** rng.uniform(3.5, 4.5)
        return (
            f'<joint name="b{body}_{direction}" type="{kind}" axis="{axis}" '
            f'stiffness="{stiffness:.9g}" damping="{damping:.9g}"/>'
        )

    def body(number: int) -> str:
        joints = "".join(joint(number, direction) for direction in DIRECTIONS)
        sites = "".join(
            f'<site name="acc{next(nodes)}" pos="{place(0.3)}"/>' for _ in range(sensors)
        )
        children = "".join(body(child) for child in range(n_body) if parents[child] == number)
        return (
            f'<body name="b{number}" pos="{place(0.3)}"><inertial pos="{place(0.05)}" '
            f'mass="{rng.uniform(50, 300):.9g}" diaginertia="10 11 12"/>{joints}{sites}{children}'
            "</body>"
        )

    return f'<mujoco><option gravity="0 0 0"/><worldbody>{body(0)}</worldbody></mujoco>'
