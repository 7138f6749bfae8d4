# Everything a person or CI does with a checkout.  `make help` lists the targets.
PYTHON := .venv/bin/python
SHELL := /bin/bash

.DEFAULT_GOAL := help
.PHONY: help demo test lint assets figures wheel clean setup

help:  ## this list
	@sed -nE 's/^([a-z]+):.*## (.*)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 16

setup:
	@.ci/setup.sh

demo: setup  ## set up what is missing and open the demo scan (without a display: pictures in out/demo)
	@.venv/bin/pointglass demo

test: setup  ## set up what is missing, check the code, run every test
	@$(PYTHON) -m ruff check .
	@$(PYTHON) -m pyright --warnings
	@$(PYTHON) -m pytest -q

lint: setup  ## ruff and pyright
	@$(PYTHON) -m ruff check .
	@$(PYTHON) -m pyright --warnings

assets: setup  ## make the demo scan and its cameras again (a minute or two)
	@$(PYTHON) -m model.synth.demo assets/demo.laz

figures: setup  ## run the benches into out/bench and renew the README's figures from them (an hour)
	@$(PYTHON) -m viewer.bench.figures
	@$(PYTHON) -m viewer.bench.readme
	@$(PYTHON) -m viewer.bench.readme_picture

wheel: setup  ## build the wheel into dist/
	@$(PYTHON) -m build --wheel --no-isolation

clean:  ## remove what was made here: environment, outputs, tool caches
	rm -rf .venv out dist build .pytest_cache .ruff_cache .hypothesis *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
