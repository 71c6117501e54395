"""The linear model as a state space and in time."""
