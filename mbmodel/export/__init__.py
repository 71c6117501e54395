"""The linear model as a state space, and its time response."""
