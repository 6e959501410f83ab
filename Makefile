# The commands of the README, and the longer studies.
VENV ?= .venv
PYTHON ?= python3
BIN = $(VENV)/bin
STAMP = $(VENV)/.installed
# each worker takes half of the tests in order, so that a module's results are computed once
WORKERS = -n 2 --dist worksteal
# modules are compiled when they are first used, and kept, whatever the shell says
export PYTHONDONTWRITEBYTECODE =

.PHONY: run test check docs fuzz coverage verify cases bench lint lock newest oldest clean

run: $(STAMP)-run
	$(BIN)/hkt run cases/examples/first_turbine.yaml --out results/first_turbine --force

# fast tests (under four minutes on two cores)
test: $(STAMP)-test
	$(BIN)/python -m pytest $(WORKERS) -m "not slow"

# slow tests: installed package, commands of the documentation, benchmarks in small; then lint
check: $(STAMP)-test lint
	$(BIN)/python -m pytest $(WORKERS) -m slow tests studies/benchmarks

# the documentation site in build/docs; a warning is an error, and the notebooks are run (a minute)
docs: $(STAMP)-docs
	$(BIN)/sphinx-build -W --keep-going -b html docs build/docs

# the properties among the tests with random seeds, ten times as often (about five minutes)
fuzz: $(STAMP)-test
	$(BIN)/python -m pytest $(WORKERS) -m hypothesis --hypothesis-profile=random

# branch coverage of every module by all tests, slow ones too, and by the processes that they start
# (half an hour on two cores): make coverage COVERED='tests/rotor'
COVERED ?=
coverage: $(STAMP)-dev
	$(BIN)/python -m pytest $(WORKERS) $(COVERED) --cov=hkt_mdo --cov-report=term:skip-covered

lint: $(STAMP)-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/numpydoc lint $$(find hkt_mdo -name '*.py')

# all ten cases of the paper with both optimizers, side by side (about two minutes on two cores)
cases: $(STAMP)-run
	$(BIN)/python scripts/run_all_cases.py --out results/cases

# the verification study or a PART of it, in hours; goes on where it was interrupted, and writes
# docs/studies/verification.md and results/verification/report.html: make verify PART=limits COUNT=20 SEED=0
verify: $(STAMP)-test
	$(BIN)/python -m studies.verification $(PART) $(COUNT:%=--count %) $(SEED:%=--seed %)
	$(BIN)/python studies/page_data.py verification

# speed and growth, against CCBlade, CasADi and SciPy; writes docs/dev/performance.md (about ten minutes)
bench: export OPENBLAS_NUM_THREADS = 1
bench: $(STAMP)-test
	mkdir -p results
	$(BIN)/python -m pytest studies/benchmarks --benchmark-enable \
	    --benchmark-columns=median,iqr,rounds --benchmark-json=results/benchmarks.json; \
	status=$$?; $(BIN)/python studies/benchmarks/report.py results/benchmarks.json; \
	$(BIN)/python studies/page_data.py performance; exit $$status

# the versions that everything above installs, in requirements: again as new as pyproject.toml allows
LOCK = .venv-lock/bin/uv pip compile --quiet --no-config --upgrade --universal --python-version 3.11 \
    --fork-strategy fewest --annotation-style line \
    --custom-compile-command 'make lock' pyproject.toml --group build
lock:
	$(PYTHON) -m venv .venv-lock
	.venv-lock/bin/pip install --quiet --upgrade uv
	$(LOCK) --extra dev --output-file requirements/dev.txt
	$(LOCK) --extra report --constraint requirements/dev.txt --output-file requirements/run.txt

# the fast tests with the newest and with the lowest versions that pyproject.toml allows
newest: RESOLUTION = highest
oldest: RESOLUTION = lowest-direct
newest oldest:
	$(PYTHON) -m venv --clear .venv-$@
	.venv-$@/bin/pip install --quiet uv
	.venv-$@/bin/uv pip install --quiet --no-config --python .venv-$@/bin/python \
	    --resolution $(RESOLUTION) --editable '.[test]'
	.venv-$@/bin/python -m pytest $(WORKERS) -m "not slow"

# a run and its report need little; tests bring their own packages, lint those of the developers;
# older releases of pip pin the packages of the build by the first variable, newer ones by the second
INSTALL = PIP_CONSTRAINT=$(1) PIP_BUILD_CONSTRAINT=$(1) $(BIN)/pip install --quiet --no-compile --editable

$(STAMP)-run: pyproject.toml requirements/run.txt
	$(PYTHON) -m venv $(VENV)
	$(call INSTALL,requirements/run.txt) '.[report]'
	touch $@

$(STAMP)-test $(STAMP)-dev $(STAMP)-docs: $(STAMP)-%: $(STAMP)-run requirements/dev.txt
	$(call INSTALL,requirements/dev.txt) '.[$*]'
	touch $@

clean:
	rm -rf $(VENV) .venv-lock .venv-newest .venv-oldest build results *.egg-info
