"""Damping by integral force feedback, and frames that decouple struts."""
