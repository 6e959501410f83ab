# The two commands of the README, and the longer studies.
VENV ?= .venv
PYTHON ?= python3
BIN = $(VENV)/bin

.PHONY: run test cases bench lint clean

run: $(VENV)/.installed
	$(BIN)/hkt run cases/sine_limited_quadratic.yaml --out results/sine_limited_quadratic --force

test: $(VENV)/.installed
	$(BIN)/python -m pytest -n 2

# all ten cases of the paper with both optimizers, side by side (about two minutes on two cores)
cases: $(VENV)/.installed
	$(BIN)/python scripts/run_all_cases.py --out results/cases

lint: $(VENV)/.installed
	$(BIN)/pip install --quiet --editable '.[dev]'
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable '.[test]'
	touch $@

clean:
	rm -rf $(VENV) build results *.egg-info

# speed and growth, against CCBlade, CasADi and SciPy; writes docs/performance.md (about ten minutes)
bench: export OPENBLAS_NUM_THREADS = 1
bench: $(VENV)/.installed
	$(BIN)/pip install --quiet --editable '.[dev]'
	mkdir -p results
	$(BIN)/python -m pytest tests/benchmarks --override-ini addopts= -q \
	    --benchmark-columns=median,iqr,rounds --benchmark-json=results/benchmarks.json; \
	status=$$?; $(BIN)/python tests/benchmarks/report.py results/benchmarks.json; exit $$status
