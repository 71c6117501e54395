"""The machine in time: MuJoCo's integration from static equilibrium, with inputs and readings."""
