"""How good a fit is: held-out lines, gap, intervals of parameters and FRFs, further tests."""
