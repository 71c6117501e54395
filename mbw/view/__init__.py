"""``mbw view``: a machine at rest or in a mode, in MuJoCo's viewer or in a picture."""
