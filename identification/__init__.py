"""The measured side: hits to FRFs, solid bodies, modal model."""
