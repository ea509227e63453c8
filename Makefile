# Needs git, make and python3 (3.11 to 3.13) with its venv module; nothing else.
.DELETE_ON_ERROR:
.NOTPARALLEL:
.SUFFIXES:
.DEFAULT_GOAL := help

PYTHON ?= python3
PAPER ?=
QUICK ?=
PARAMS ?=

# One thread per library: the runs of a study share the processors, not its matrices.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
# Nothing is read from or written to a home directory; there may be none.
export MPLCONFIGDIR := $(CURDIR)/build/home/matplotlib
export IPYTHONDIR := $(CURDIR)/build/home/ipython
export JUPYTER_CONFIG_DIR := $(CURDIR)/build/home/jupyter/config
export JUPYTER_DATA_DIR := $(CURDIR)/build/home/jupyter/data
export JUPYTER_RUNTIME_DIR := $(CURDIR)/build/home/jupyter/runtime
export PYTHONNOUSERSITE := 1
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV SEANAV_RESULTS SEANAV_PROGRESS

VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])' 2>/dev/null)
ENVIRONMENT := .venv/.built-$(VERSION)
BIN := .venv/bin
SEANAV := $(BIN)/python -m seanav

# A paper is a notebook. Its stamp says when its full run began; what the notebook
# imports is noted beside the stamp by that run. Results that went missing run again.
PAPERS := $(patsubst notebooks/%.ipynb,%,$(wildcard notebooks/*.ipynb))
CHOSEN := $(if $(PAPER),$(filter $(PAPER) $(PAPER)_%,$(PAPERS)),$(PAPERS))
STAMPS := $(CHOSEN:%=build/stamps/%)
LOST := $(foreach p,$(CHOSEN),$(if $(wildcard paper_figures/$p/claims.json),,build/stamps/$p))
-include $(PAPERS:%=build/stamps/%.d)

.PHONY: help figures notebooks test lint format lock lockcheck bench book clean .venv FORCE

help: ## list the targets
	@echo "make TARGET [PYTHON=python3.12]"
	@sed -n 's/^\([a-z.]*\):.*## /  \1\t/p' Makefile | expand -t 14

ifneq ($(PAPER),)
ifeq ($(CHOSEN),)
$(error no paper $(PAPER); there are: $(PAPERS))
endif
endif

ifneq ($(strip $(QUICK)$(PARAMS)),)
figures: $(ENVIRONMENT)
	@$(SEANAV) run $(if $(PAPER),--paper $(PAPER)) $(if $(QUICK),--quick) $(if $(PARAMS),--param $(foreach word,$(PARAMS),'$(word)'))
else
figures: $(STAMPS) ## all results into paper_figures/; [PAPER=5] [QUICK=1] [PARAMS="runs=200 seed=7"]: into build/
endif

$(STAMPS): build/stamps/%: notebooks/%.ipynb requirements.lock | $(ENVIRONMENT)
	@$(SEANAV) run --paper $*
$(LOST): FORCE

notebooks: $(STAMPS) ## refresh the stored outputs of the notebooks from their full runs
	@$(SEANAV) store $(if $(PAPER),--paper $(PAPER))

test: $(ENVIRONMENT) ## all tests, then every notebook against its stored outputs and results
	$(BIN)/python -m pytest -n 2 --dist loadfile
	rm -rf build/nbval
ifneq ($(PAPERS),)
	SEANAV_RESULTS=$(CURDIR)/build/nbval $(BIN)/python -m pytest -p no:cacheprovider -n 2 --dist loadfile \
	  --nbval --nbval-cell-timeout=1800 notebooks
endif
	$(SEANAV) check

lint: $(ENVIRONMENT) ## style and docstrings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(ENVIRONMENT) ## mend the style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lockcheck: $(ENVIRONMENT) ## the lock: exact, hashed, one numerics stack, what pyproject.toml asks for
	$(BIN)/python -m pytest -q tests/test_lock.py

lock: $(ENVIRONMENT) ## resolve requirements.lock anew from pyproject.toml
	command -v uv >/dev/null || { $(PYTHON) -m venv build/uv && build/uv/bin/pip install -q uv; }
	PATH="$$PATH:$(CURDIR)/build/uv/bin" uv pip compile pyproject.toml --extra test \
	  --universal --python-version 3.11 --generate-hashes --only-binary :all: \
	  --no-header --no-annotate --no-emit-index-url --upgrade -o requirements.lock

bench: $(ENVIRONMENT) ## time the kernels against the targets
	@for file in $(sort $(wildcard benchmarks/*.py)); do $(BIN)/python $$file || exit 1; done

book: $(ENVIRONMENT) ## the notebooks and the report as web pages, into build/book/
	$(BIN)/python book/build.py

clean: ## remove build/ and .venv/
	rm -rf build .venv

.venv: $(ENVIRONMENT) ## the environment of requirements.lock

$(ENVIRONMENT): requirements.lock pyproject.toml
	@test -n "$(VERSION)" || { echo "$(PYTHON) does not run: install Python 3.11, 3.12 or 3.13, or say make PYTHON=..." >&2; exit 1; }
	@case $(VERSION) in 3.11.*|3.12.*|3.13.*) ;; *) echo "$(PYTHON) is Python $(VERSION), not 3.11 to 3.13: say make PYTHON=..." >&2; exit 1;; esac
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "$(PYTHON) lacks its venv module: install it (Debian and Ubuntu: apt install python3-venv)" >&2; exit 1; }
	rm -rf .venv
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes --only-binary :all: -r requirements.lock
	$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

FORCE:
