# The two commands of the README, and the longer studies.
VENV ?= .venv
PYTHON ?= python3
BIN = $(VENV)/bin

.PHONY: run test cases lint clean

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
