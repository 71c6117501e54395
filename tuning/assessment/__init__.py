"""Assessment of a fit: gap, held-out lines, intervals, and the value of further tests."""
