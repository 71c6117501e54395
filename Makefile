# `make demo` and `make test` are all a newcomer needs: both make their own virtual environment.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet
OUT ?= mbw-demo
GAPBENCH = PATH="$(CURDIR)/$(BIN):$$PATH" python -m gapbench run --out tests/bench/results/gapbench
SEALED ?= ../shared/campaigns/sealed

.PHONY: demo test long quick check docs figures pictures bench gapbench field gallery same versions sealed measured station gondola gondola-campaign gondola-frames demo-campaign two-bodies clean

demo: $(VENV)/.installed
	$(BIN)/mbw demo --out $(OUT)

test: check docs
	PART=usual $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# The tests that `make test` leaves out: whole diagnoses, for the most part.
long: $(VENV)/.installed-test
	PART=long $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# The quick tests of each room, for an inner loop.
quick: $(VENV)/.installed-test
	$(BIN)/ruff check .
	PART=quick $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

check: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest tests/test_imports.py

# Builds the pages into build/site; a warning is an error, and nothing is loaded from a network.
docs: $(VENV)/.installed-docs
	$(BIN)/python -m tests.docs.build_site

# Writes what is generated in README and docs: figures of the benches, options of the command.
figures: $(VENV)/.installed-test
	$(BIN)/python -m tests.docs

# Remakes the pictures of the docs: pages by Chromium, machines of the gallery by MuJoCo.
pictures: $(VENV)/.installed-test
	$(BIN)/python -m tests.docs.workbench_picture
	$(BIN)/python -m tests.docs.live_picture
	$(BIN)/python -m tests.docs.gallery_pictures
	$(BIN)/python -m tests.docs.page_pictures

bench: $(VENV)/.installed-bench
	$(BIN)/python -m tests.bench $(ONLY)

# Runs the entries of GapBench on the bundled set; cases that are answered stay.
gapbench: $(VENV)/.installed-test
	for name in refit_only ranking latent_force; do $(GAPBENCH)/$$name.jsonl -- \
		python -m gapbench.baselines $$name || exit 1; done
	$(GAPBENCH)/ours.jsonl -- python gapbench/examples/ours.py

# Runs inputs that users' reports showed, and prints expected, got and right of each.
field: $(VENV)/.installed-test
	$(BIN)/python -m tests.field $(ONLY)

# Shows that this tree computes what the commit BASE did, by every verb: numbers, arrays, models.
same: $(VENV)/.installed-test
	$(BIN)/python -m tests.regression $(BASE) $(if $(ONLY),--only $(ONLY))

# Machines of the gallery: draws, tunes, diagnoses and predicts what is missing of them.
gallery: $(VENV)/.installed-test
	$(BIN)/python -m tests.gallery $(ONLY)

# Wheel and sdist in empty environments of each Python at hand, README's lines, the demo's beginning.
versions: $(VENV)/.installed-test
	$(BIN)/python -m tests.versions

# Verdicts on campaigns whose answers nobody here knows: made once, committed, never tuned to.
sealed: $(VENV)/.installed
	mkdir -p tests/bench/results/sealed
	for name in $(SEALED)/*; do $(BIN)/mbw diagnose $$name --out $(OUT)-sealed/$$(basename $$name) \
		--json tests/bench/results/sealed/$$(basename $$name).json || exit 1; done

# Verdicts on real machines that others measured; AGAIN=1 makes those anew that are committed.
measured: $(VENV)/.installed-bench
	$(BIN)/python -m tests.bench measured

# Remakes the meshes of the station, byte for byte, what they weigh in its MJCF, its tuned model.
station: $(VENV)/.installed
	$(BIN)/python assets/microstation/make_station.py
	$(BIN)/python assets/microstation/make_identified.py

# Remakes the gondola's shapes; needs CalculiX (Debian: calculix-ccx).
gondola: $(VENV)/.installed
	$(BIN)/python assets/gondola/make_gondola.py

# Remakes the gondola of three frames on pins, after the gondola; needs CalculiX.
gondola-frames: $(VENV)/.installed
	PYTHONPATH=. $(BIN)/python assets/gondola/make_frames.py

# Remakes the gondola's campaign of impacts from its seed and from truths.npz.
gondola-campaign: $(VENV)/.installed
	PYTHONPATH=. $(BIN)/python assets/gondola/make_campaign.py

# Remakes assets/demo from its seed; the last digits of its answer depend on the machine.
demo-campaign: $(VENV)/.installed
	$(BIN)/python -m truth assets/microstation/station.xml assets/demo --seed 20261121 --node 11 --effect appendage --ratio 4 --overwrite

# Remakes the tutorial's campaign of two bodies from its seed.
two-bodies: $(VENV)/.installed
	$(BIN)/python -m truth assets/two_bodies.xml assets/two_bodies --seed 20261126 --node 5 --effect appendage --place body:stage --ratio 8 --overwrite

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	$(PIP) --editable '.[test]'
	touch $@

$(VENV)/.installed-docs: $(VENV)/.installed
	$(PIP) --editable '.[docs]'
	touch $@

# pyFBS without what it depends on (Qt, VTK, Ansys): the bench needs its LSCF alone.
$(VENV)/.installed-bench: $(VENV)/.installed-test
	$(PIP) --no-deps pyFBS==1.0.7
	touch $@

clean:
	rm -rf $(VENV) dist build .same
	git worktree prune
