"""The workbench: a live page on which a model is moved by hand beside its measurement."""
