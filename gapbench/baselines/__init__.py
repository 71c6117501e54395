"""Three baselines with one refit: nothing but the refit, classical rankings, a latent force.

``python -m gapbench.baselines NAME FOLDER`` prints the answer for a campaign; NAME is one of
``refit_only``, ``ranking`` and ``latent_force``. They read a campaign as any entry does and tune
with the public functions of ``tuning``; nothing of a diagnosis is used. All constants were chosen
on the set of seed 940000, before any other entry was run on the bundled set.
"""
