# make test   everything that CI checks, in an environment of its own (.venv)
# make lint   the quick part of it
# make ratchet  accuracy on a reduced benchmark against tests/baseline.json (about 3 minutes)
# make demo   make a clip, follow the hand in it, say how far off the result is
# make clean  forget the environment and the caches

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed

.PHONY: test ratchet lint format demo clean

test: lint
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile -m 'not ratchet' --cov --cov-report=term:skip-covered --durations=10

ratchet: $(STAMP)
	$(BIN)/python -m pytest -m ratchet --no-cov tests/bench

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

demo: $(STAMP)
	$(BIN)/handtrack demo

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .coverage
	find . -name __pycache__ -prune -exec rm -rf {} +
