# What a person or CI does with a checkout.  `make help` lists the targets.
PYTHON := .venv/bin/python
SHELL := /bin/bash

.DEFAULT_GOAL := help
.PHONY: help demo test test-all test-fast faults hostile lint golden assets pictures docs web wheel tag clean setup

help:  ## this list
	@sed -nE 's/^([a-z-]+):.*## (.*)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 16

setup:
	@.ci/setup.sh

demo: setup  ## set up what is missing and open the demo scan (without a display: pictures in out/demo)
	@.venv/bin/pointglass demo

test: setup  ## set up what is missing, check the code, run the tests
	@.ci/test.sh

test-all: setup  ## as test, and the larger forms of some tests (mark long)
	@TEST_LONG=1 .ci/test.sh

test-fast: setup  ## unit tests of the rooms that differ from the last commit (ROOMS="readers grid" for others)
	@.ci/test_fast.sh $(ROOMS)

faults: setup  ## interrupts, kills, full disks, little memory: 200 of each interrupt (hours; ARGS="--times 20" for fewer)
	@$(PYTHON) -m tests.faults $(ARGS)

hostile: setup  ## mutants of every file that is read, for a minute (ARGS="--minutes 60 --seed 7" for more)
	@$(PYTHON) -m tests.hostile $(ARGS)

lint: setup  ## ruff and pyright
	@$(PYTHON) -m ruff check .
	@$(PYTHON) -m pyright --warnings

assets: setup  ## generate the demo scan and its cameras again (a minute or two)
	@$(PYTHON) -m pointglass.model.synth.demo assets/demo.laz

pictures: setup  ## render the README's picture and animation again (a minute)
	@PYTHONPATH=. $(PYTHON) .ci/readme_pictures.py
	@xvfb-run -a $(PYTHON) .ci/tool_pictures.py

golden: setup  ## render the golden pictures of the demo again (tests/gl/test_golden.py compares with them)
	@PYTHONPATH=. $(PYTHON) tests/golden/demo_pictures.py

web:  ## build the page of `pointglass publish` from its TypeScript (needs node)
	@.ci/web.sh

wheel: setup  ## build the wheel into dist/
	@$(PYTHON) -m build --wheel --no-isolation

docs: setup  ## build the documentation site into out/site (installs mkdocs)
	@$(PYTHON) -m pip install -q -c .ci/constraints.txt -e '.[docs]'
	@$(PYTHON) -m mkdocs build --strict -q -f .ci/mkdocs.yml && echo "out/site/index.html"

tag: setup  ## tag this commit as the version of the wheel, if the changelog begins with it
	@tag=$$($(PYTHON) .ci/release.py) && $(PYTHON) .ci/release.py $$tag && git tag -a $$tag -m $$tag && echo $$tag

clean:  ## remove everything generated: environment, outputs, tool caches
	rm -rf .venv out dist build .pytest_cache .ruff_cache .hypothesis *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
