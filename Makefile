# Two commands: `make demo` and `make test`. Both set up what they need.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

# Tests start hundreds of processes: without bytecode on disk each of them compiles every module anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-slow outside worlds mutants check pins warm wheel bench acceptance-risk papers notebooks proof coverage coverage-identify catalogues tutorial clean help

help:            ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'

PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check

$(STAMP): pyproject.toml requirements.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) --require-hashes -r requirements.txt
	$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

pins:            ## the pins of constraints.txt once more with the hash of every file, after a change of either
	$(PIP) uv
	for extra in dev bench; do \
	    [ $$extra = dev ] && out=requirements.txt more='setuptools>=77' || { out=benchmarks/requirements.txt; more=''; }; \
	    echo "$$more" | $(BIN)/uv pip compile pyproject.toml - --extra $$extra -c constraints.txt --universal \
	        --python-version 3.11 --generate-hashes --no-annotate --no-header --quiet -o $$out || exit 1; \
	done

demo: $(STAMP)   ## test, identify and diagnose the simulated HPV41; writes demo/report.html
	$(BIN)/hil demo --out demo

check: $(STAMP)  ## format, lint, types, import layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

warm: $(STAMP)   ## compile the plants and test files that are not in the cache yet
	$(BIN)/python -m tests.warm

# Eight at a time on two cores: tests that wait for clocks are groups on workers of their own, and the cores compute.
test: $(STAMP)   ## everything CI asks for
	$(MAKE) --no-print-directory -j 2 check warm
	$(BIN)/pytest -n 8 --dist loadgroup -m "not slow"
	@echo "not checked here: the calibration certificate against its XML schemas; python -m tests.dcc --schemas DIR does"

# Who judges tenths of seconds runs alone; the others wait most of their time, and wait together.
test-slow: $(STAMP) warm  ## the rest: faults on every link in wall-clock time, on a machine that does nothing else
	$(BIN)/pytest -m "slow and alone"
	$(BIN)/pytest -n 12 --dist worksteal -m "slow and not alone"

outside: $(STAMP)  ## the device against every word of the program: outages, named cases, 300 drawn combinations (an hour)
	$(BIN)/python -m tests.outside --drawn 300

worlds: $(STAMP) ## the code that acts in N=1000 drawn worlds of virtual time, from SEED on
	$(BIN)/python -m tests.worlds -n $(or $(N),1000) $(if $(SEED),--seed $(SEED))

mutants: $(STAMP) ## faults planted in the code that acts (N=200, SEED=1), and how many of them worlds find
	$(BIN)/python -m tests.worlds.mutants -n $(or $(N),200) --seed $(or $(SEED),1)

wheel: $(STAMP)  ## build the wheel, install it alone, and try it where there is no checkout
	$(BIN)/python .ci/try_wheel.py

$(VENV)/.bench-installed: $(STAMP)
	$(PIP) --require-hashes -r benchmarks/requirements.txt
	@touch $@

bench: $(VENV)/.bench-installed  ## every benchmark beside its peers, one table of times and ratios
	$(BIN)/python benchmarks

acceptance-risk: $(STAMP)  ## what the EFC's acceptance test risks (WHOLE=200, JUDGED=1000 drawn valves)
	$(BIN)/python benchmarks/acceptance_risk.py --whole $(or $(WHOLE),200) --judged $(or $(JUDGED),1000)

papers: $(STAMP)  ## the papers' numbers beside those of the commands: pages and notebooks in docs
	$(BIN)/python -m docs.papers
	$(BIN)/python docs/notebooks.py

notebooks: $(STAMP)  ## whether the notebooks still print what is kept in them
	$(BIN)/pytest -m slow tests/unit/test_notebooks.py

proof: $(STAMP)  ## the concealment proof (CASES=20); SKELETON=wrong (CASES=3 units of each, SEED=1, JSON=1): units of another structure
ifeq ($(SKELETON),wrong)
	$(BIN)/python -m tests.studies --units $(or $(CASES),3) --seed $(or $(SEED),1) --out $(or $(OUT),proof-wrong) $(if $(JSON),--json)
else
	$(BIN)/python -m tests.studies.proof --cases $(or $(CASES),20) --out $(or $(OUT),proof)
endif
ifdef RECORDINGS
	$(BIN)/python -m tests.studies.proof.real --recordings $(RECORDINGS)
else
	@echo "real recordings were not run: make proof RECORDINGS=DIR names their folder"
endif

coverage: $(STAMP)  ## how often what procedures print holds the truth (SEEDS=300): the table in tests/studies/coverage/figures.md
	HIL_CORES=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.studies.coverage --seeds $(or $(SEEDS),300) --page tests/studies/coverage/figures.md

coverage-identify: $(STAMP)  ## how often intervals of identified parameters hold the truth (SEEDS=100): tests/studies/identify/figures.md
	HIL_CORES=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.studies.identify --seeds $(or $(SEEDS),100) --page tests/studies/identify/figures.md

tutorial: $(STAMP)  ## every command of the tutorials from an empty folder, as a reader would type it
	$(BIN)/python -m tests.tutorial

catalogues: $(STAMP)  ## gather the texts of pages for translation, and compile what is translated
	$(BIN)/python docs/catalogues.py

clean:           ## remove the environment and everything generated
	rm -rf $(VENV) demo proof .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
