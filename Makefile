# make demo      find, teach, label and draw; tells where the results are
# make test      all tests; real recordings are used where MOTIONARY_DATA names them
# make quick     the fast part of them, without recordings: under a minute
# make coverage  all tests, and the lines that none of them runs; coverage.xml
# make lint      types, style, layers, workflows
# make bench     speed beside other packages, medians
# make docs      the documentation, into docs/_build/html
# make docs-pictures  its pictures anew, from real recordings
# make evidence  the tables and figures behind the claims
# make fuzz      damaged files of every format, opened for FUZZ_SECONDS=600, from where it ended
# make clean     remove what these commands made
#
# The first command makes .venv; later ones install again when pyproject.toml changes.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CHECK := $(BIN)/check-jsonschema --quiet --builtin-schema
FORMS := $(filter-out %/config.yml,$(wildcard .github/ISSUE_TEMPLATE/*.yml))
# Modules are compiled when they are first imported: most of what is installed never is.
PIP := $(BIN)/python -m pip install -qq --disable-pip-version-check --no-compile

# MOTIONARY_DATA= (empty) runs without recordings.
DATA := $(abspath $(wildcard ../shared/data))
ifneq ($(DATA),)
export MOTIONARY_DATA ?= $(DATA)
endif

.PHONY: help demo test quick coverage lint bench docs docs-pictures evidence fuzz clean

help:
	@sed -n 's/^# \(make .*\)/\1/p' Makefile

demo: $(VENV)/.base
	@$(BIN)/motionary demo

test: $(VENV)/.base
	$(BIN)/python -m pytest -q -n 2 --dist worksteal

# What takes a second or more is shown at the end: mark it slow.
quick: $(VENV)/.base
	$(BIN)/python -m pytest -q -n 2 -m "not slow and not recordings" \
		--hypothesis-profile=quick --durations=5 --durations-min=1

coverage: $(VENV)/.coverage
	$(BIN)/python -m pytest -q -n 2 --hypothesis-profile=thorough \
		--cov --cov-report=term --cov-report=xml

lint: $(VENV)/.lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(CHECK) vendor.github-workflows .github/workflows/*.yml
	$(CHECK) vendor.dependabot .github/dependabot.yml
	$(CHECK) vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
	$(CHECK) vendor.github-issue-forms $(FORMS)
	$(CHECK) vendor.citation-file-format CITATION.cff

bench: $(VENV)/.bench
	$(BIN)/python bench/run.py

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

docs-pictures: $(VENV)/.base
	$(BIN)/python docs/pictures.py

evidence: $(VENV)/.bench
	@test -f evidence/run.py || { echo "there are no evidence scripts yet"; exit 1; }
	$(BIN)/python evidence/run.py

FUZZ_SECONDS ?= 600

fuzz: $(VENV)/.base
	$(BIN)/python -m evidence.fuzz --seconds $(FUZZ_SECONDS)

clean:
	rm -rf $(VENV) build dist docs/_build demo-output .fuzz
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	rm -rf .coverage .coverage.* coverage.xml
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/pyvenv.cfg:
	$(PYTHON) -m venv $(VENV)

# A stamp is written when its installation is complete.
$(VENV)/.base: pyproject.toml | $(VENV)/pyvenv.cfg
	@echo "installing into $(VENV), once"
	@$(PIP) -e '.[fast,test]'
	@touch $@

$(VENV)/.coverage $(VENV)/.lint $(VENV)/.docs $(VENV)/.bench: $(VENV)/.%: pyproject.toml $(VENV)/.base
	@echo "installing what 'make $*' needs, once"
	@$(PIP) -e '.[$*]'
	@touch $@
