# Needs git, make and python3 (3.11 to 3.13) with its venv module; nothing else.
# Written for GNU make 3.81 and later, a POSIX shell and POSIX awk and sed.
.DELETE_ON_ERROR:
.NOTPARALLEL:
.SECONDEXPANSION:
.SUFFIXES:
.DEFAULT_GOAL := help

# What the command line may set; equal names in the environment mean something else.
PYTHON :=
PAPER :=
QUICK :=
PARAMS :=
SEED :=
SCHEDULER :=
GIVEN := $(foreach v,$(.VARIABLES),$(if $(findstring command,$(origin $v)),$v))
UNKNOWN := $(filter-out PYTHON PAPER QUICK PARAMS SEED SCHEDULER,$(GIVEN))
$(if $(UNKNOWN),$(error unknown: $(UNKNOWN:%=%=...); did you mean PAPER=, QUICK=, PARAMS=, SEED=, SCHEDULER= or PYTHON=?))
# Of a name that is given twice make keeps the last and tells nobody; its command line does.
TWICE := $(strip $(shell { tr '\0' '\n' </proc/$$PPID/cmdline || ps -o args= -p $$PPID | tr ' ' '\n'; } \
  2>/dev/null | sed -n 's/^\([A-Z]*\)[:?+]*=.*/\1/p' | sort | uniq -d))
$(if $(TWICE),$(error given twice: $(TWICE); several papers are one word: PAPER="2 5"))
# $(call belongs,VARIABLE,targets): others would silently do without it.
belongs = $(if $(value $1),$(if $(filter-out $2 .venv,$(MAKECMDGOALS)),$(error $1 belongs to: make $2)))
$(call belongs,PAPER,figures notebooks confirm)
$(call belongs,QUICK,figures)
$(call belongs,PARAMS,figures)
$(call belongs,SCHEDULER,figures confirm)
$(call belongs,SEED,confirm)
$(if $(filter confirm,$(MAKECMDGOALS)),$(if $(strip $(SEED)),,$(error make confirm SEED=...: a whole number that was never run before)))

YES := 1 y yes Yes YES true True TRUE on
NO := 0 n no No NO false False FALSE off
$(if $(filter-out $(YES) $(NO),$(QUICK)),$(error QUICK=$(QUICK): must be 1 or 0))
FAST := $(filter $(YES),$(QUICK))

# A paper is a notebook with a number, a lesson one with 0. Other names are a user's own.
NUMBERED := $(shell ls notebooks 2>/dev/null | sed -n 's/^\([0-9][0-9]*_[A-Za-z0-9_][A-Za-z0-9_]*\)\.ipynb$$/\1/p')
LESSONS := $(filter 0_%,$(NUMBERED))
PAPERS := $(filter-out $(LESSONS),$(NUMBERED))
ABSENT := $(strip $(foreach p,$(PAPER),$(if $(filter $p $p_%,$(PAPERS)),,$p)))
$(if $(ABSENT),$(error no paper $(ABSENT); there are: $(PAPERS)))
CHOSEN := $(if $(strip $(PAPER)),$(filter $(PAPER) $(PAPER:%=%_%),$(PAPERS)),$(PAPERS))
STAMPS := $(CHOSEN:%=build/stamps/%)

# Nothing that a user set for these tools elsewhere may change results: what is passed on
# is the rest, such as PATH, HOME, TMPDIR, the language, proxies, and SEANAV_THREADS.
# Of PIP_... and pip's files, src/seanav/environment.py keeps the way to a registry.
unexport $(filter-out SEANAV_THREADS,$(filter PYTHON% VIRTUAL_ENV CONDA_% IPYTHON% JUPYTER% JPY_% \
  MPL% MATPLOTLIB% NUMBA_% GDAL_% PROJ_% PYTEST_% COVERAGE_% HYPOTHESIS_% RUFF_% PAPERMILL_% \
  SEANAV_% DASK_% PAPER QUICK PARAMS SEED SCHEDULER,$(.VARIABLES)))
# Handed over in the environment: no shell and no make reads quotes and dollars in them.
export SEANAV_PARAMS := $(value PARAMS)
export SEANAV_PYTHON := $(value PYTHON)
export SEANAV_SEED := $(value SEED)
export SEANAV_SCHEDULER := $(value SCHEDULER)
# The same texts in every language.
export PYTHONUTF8 := 1
export PYTHONNOUSERSITE := 1
# One thread per library: the runs of a study share the processors, not its matrices.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
# Nothing is read from or written to a home directory; there may be none.
export MPLCONFIGDIR := $(CURDIR)/build/home/matplotlib
export DASK_CONFIG := $(CURDIR)/build/home/dask
export IPYTHONDIR := $(CURDIR)/build/home/ipython
export JUPYTER_CONFIG_DIR := $(CURDIR)/build/home/jupyter/config
export JUPYTER_DATA_DIR := $(CURDIR)/build/home/jupyter/data
export JUPYTER_RUNTIME_DIR := $(CURDIR)/build/home/jupyter/runtime

BIN := .venv/bin
SEANAV := $(BIN)/python -m seanav

.PHONY: help figures notebooks confirm test soak mutants lint format lock lockcheck bench bench-peers lab book clean .venv FORCE

help: ## list the targets
	@echo "make TARGET [PYTHON=python3.12]"
	@awk '/^[a-z.-]+:.*## / { name = $$1; sub(/:.*/, "", name); sub(/.*## /, ""); \
	  printf "  %-12s%s\n", name, $$0 }' Makefile

ifneq ($(strip $(FAST)$(value PARAMS)),)
figures: .venv
	@$(SEANAV) run $(CHOSEN:%=--paper %) $(if $(FAST),--quick) --params="$$SEANAV_PARAMS"
else
figures: $(STAMPS) ## all results into paper_figures/; [PAPER="2 5"] [QUICK=1] [PARAMS="runs=200 seed=7"]: into build/; [SCHEDULER=local]: on Dask
	@echo "paper_figures/ is up to date: $(CHOSEN)"
endif

# The stamp of a paper says when its full run began. Beside it that run notes, as a rule,
# what the notebook imports: read as words and believed if whole, lest it stop make. A
# paper without a whole note, with lost results or with a file gone runs again.
note = $(strip $(shell cat build/stamps/$1.d 2>/dev/null))
whole = $(if $(subst $2,,$(strip build/stamps/$1: $(files) $(files:=:))),FORCE,$(or $(files),FORCE))
files = $(filter-out %:,$2)
present = $(if $(filter-out $(wildcard $1),$1),FORCE,$1)
CONFIRMED := $(wildcard paper_figures/confirmation.csv)
published = $(if $(wildcard paper_figures/$1/claims.json),,FORCE)
noted = $(call published,$1) $(call present,$(call whole,$1,$(call note,$1)))
$(STAMPS): build/stamps/%: notebooks/%.ipynb requirements.lock $(CONFIRMED) $$(call noted,$$*) | .venv
	@$(SEANAV) run --paper $*

notebooks: $(STAMPS) ## refresh the stored outputs of the notebooks from their full runs
	@$(SEANAV) store $(CHOSEN:%=--paper %)
	@$(if $(strip $(PAPER)),,$(SEANAV) lessons)

confirm: .venv ## SEED=...: judge all claims again with a seed that was never run before
	@$(SEANAV) confirm $(CHOSEN:%=--paper %) --seed "$$SEANAV_SEED"

test: .venv ## all tests, then every notebook against its stored outputs and results
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder
	rm -rf build/nbval
ifneq ($(NUMBERED),)
	SEANAV_RESULTS="$$(pwd)/build/nbval" $(BIN)/python -m pytest -p no:cacheprovider -n 2 \
	  --dist loadfile --no-loadscope-reorder --nbval --nbval-cell-timeout=1800 $(NUMBERED:%=notebooks/%.ipynb)
endif
	$(SEANAV) check

soak: .venv ## any value of any parameter: thousands of cases, every notebook with other ones
	SEANAV_CASES=2000 $(BIN)/python -m pytest -n 2 --dist worksteal -rP \
	  tests/soak/soak_bytes.py tests/studies/test_any_value.py tests/soak/soak_notebooks.py

lint: .venv ## style, docstrings, types, and who may import whom
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --cache-dir build/lint/imports
	$(BIN)/mypy --cache-dir build/lint/types

format: .venv ## mend the style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lockcheck: .venv ## the lock: exact, hashed, one numerics stack, what pyproject.toml asks for
	$(BIN)/python -m pytest -q tests/test_lock.py

lock: .venv ## resolve requirements.lock anew from pyproject.toml, for all platforms
	mkdir -p build
	command -v uv >/dev/null || $(BIN)/python -I src/seanav/environment.py build/uv uv
	PATH="$$PATH:build/uv/bin"; uv pip compile pyproject.toml --extra test --extra book --extra cluster \
	  --universal --python-version 3.11 --generate-hashes --only-binary :all: \
	  --no-header --no-annotate --no-emit-index-url --upgrade -o build/requirements.lock
	PATH="$$PATH:build/uv/bin"; export MACOSX_DEPLOYMENT_TARGET=14.0; \
	for python in 3.11 3.12 3.13; do \
	  for platform in x86_64-manylinux_2_28 aarch64-manylinux_2_28 aarch64-apple-darwin; do \
	    uv pip install --quiet --dry-run --target build/none --no-deps --only-binary :all: \
	      --require-hashes --python-version $$python --python-platform $$platform \
	      -r build/requirements.lock || { echo "no lock for $$platform, $$python" >&2; exit 1; }; \
	  done; \
	done
	mv build/requirements.lock requirements.lock

mutants: .venv ## break 400 signs, numbers and comparisons one by one: does a test notice? Over an hour
	$(BIN)/python tests/soak/mutants.py 400

bench: bench-peers ## the same, and the studies against their targets
	@for file in $(sort $(wildcard benchmarks/bench_*.py)); do $(BIN)/python $$file || exit 1; done

bench-peers: build/peers/.built ## the kernels beside other libraries: benchmarks/RESULTS.md
	@PYTHONPATH=src build/peers/bin/python benchmarks/compare.py

build/peers/.built: benchmarks/peers.lock | .venv
	$(BIN)/python -I src/seanav/environment.py build/peers --require-hashes -r benchmarks/peers.lock
	@touch $@

lab: .venv ## JupyterLab on the notebooks, with the kernel of .venv
	$(BIN)/python -m jupyterlab $(if $(filter 0,$(shell id -u)),--allow-root) notebooks

book: .venv ## the notebooks and the report as web pages, into build/book/
	$(BIN)/python book/build.py

clean: ## remove build/ and .venv/
	rm -rf build .venv

.venv: ## the environment of requirements.lock: with PYTHON, else with the interpreter it has
	@for python in $(if $(value PYTHON),"$$SEANAV_PYTHON",$(BIN)/python python3); do \
	  "$$python" -I -S -c '' 2>/dev/null && exec "$$python" -I -S -X utf8 src/seanav/environment.py; \
	done; \
	echo "$${SEANAV_PYTHON:-python3} does not run: install Python 3.11, 3.12 or 3.13," \
	  "or say make PYTHON=..." >&2; exit 1

FORCE:
