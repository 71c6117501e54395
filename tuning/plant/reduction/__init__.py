"""Reduction of a state space with a bound of its error."""
