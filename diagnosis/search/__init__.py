"""The search for causes: score test, free forces, refits, a second effect."""
