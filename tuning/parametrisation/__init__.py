"""Which parameters vary, in which coordinates, and what the user specifies of them."""
