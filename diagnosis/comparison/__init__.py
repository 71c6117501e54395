"""Comparison of rival hypotheses on data that their fits did not see."""
