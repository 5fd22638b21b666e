# `make help` lists the targets. Everything is installed into .venv; nothing else on this machine changes.

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet
SPHINX := $(BIN)/python -m sphinx --fail-on-warning --keep-going --nitpicky --quiet

# Without stored bytecode, each of the hundreds of processes of the tests compiles its libraries again, which takes it 2 s.
unexport PYTHONDONTWRITEBYTECODE

# These tests run a robot in real time, which takes a part of a processor: nothing else runs next to two of them. What
# fails is repeated alone, twice at most: a computer that halts for a moment fails a test too, a defect each time.
REAL_TIME := $(addprefix tests/,command_line/operation command_line/demo command_line/doctor/test_doctor.py command_line/live/test_restarts.py experiments/calibration/test_weights_daemon.py experiments/robot/test_daemon_robot.py mudskipper/test_client.py mudskipper/test_gym_daemon.py)

# Ends a test that hangs, and prints where it hangs.
PYTEST := $(BIN)/python -m pytest -q --numprocesses 2 --dist worksteal --durations=10 -o faulthandler_timeout=1800 -o faulthandler_exit_on_timeout=true

REPEAT = $(PYTEST) --numprocesses 0 --last-failed $(REAL_TIME) $(ARGS)

# Exact versions with hashes, for installations as root and for CI; --upgrade in ARGS takes newer versions.
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --custom-compile-command "make lock"

.PHONY: help lock setup demo test test-compiled test-vm test-page watch-pictures wheel mutants dst claims lint docs docs-links man clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: .venv/setup  ## install what running and plotting need into .venv

demo: .venv/setup  ## walk a simulated robot over three muds, in real time
	@$(BIN)/mudskipper demo $(ARGS)

test: .venv/test  ## run all tests without network: first those that compute, then those in real time
	@$(PYTEST) --ignore=tests/bench $(addprefix --ignore=,$(REAL_TIME)) $(ARGS); computing=$$?; \
	$(PYTEST) $(REAL_TIME) $(ARGS) || $(REPEAT) || $(REPEAT); real_time=$$?; \
	echo "exit status: computing tests $$computing, real-time tests $$real_time"; \
	test $$computing -eq 0 -a $$real_time -eq 0

test-compiled: .venv/test  ## build the compiled tick and compare it with the sources, digit by digit; needs a C compiler
	$(BIN)/python -m pytest -v -m compiled tests/compiled $(ARGS)

test-vm: .venv/test  ## run the daemon under systemd on a real kernel, in a virtual machine
	@$(BIN)/python -m verification.virtual_machine.installed_robot
	$(BIN)/python -m pytest -v verification/virtual_machine $(ARGS)

test-page: .venv/test  ## open the live page in a headless Chromium, at the widths of a phone and of a desk; needs chromium-driver
	$(BIN)/python -m pytest -v verification/browser $(ARGS)

watch-pictures: .venv/test  ## draw the screen of `watch` for its page
	@$(BIN)/python -m tests.command_line.watch.pictures docs

wheel: .venv/test  ## build the wheel, check its files, and walk the demo from it in an empty environment
	@$(BIN)/python -m verification.wheel

mutants: .venv/test  ## change what keeps the robot safe in 4200 places; its tests must notice each change
	$(BIN)/python -m tests.mutants $(ARGS)

dst: .venv/test  ## simulate SEEDS=200 random schedules of failures and operators; every promise must hold
	@$(BIN)/python -m tests.dst.campaign $(or $(SEEDS),200) $(ARGS)

claims: .venv/test  ## measure the figures of the documentation again; ARGS='NAME --rewrite' writes them
	@$(BIN)/python -m verification.claims $(ARGS)

lint: .venv/test  ## run ruff and mypy --strict
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy

lock: .venv/setup  ## write requirements/*.txt from pyproject.toml; needs the Internet
	@$(PIP) "uv>=0.5"
	@echo "setuptools>=77" | $(LOCK) --extra serial --extra screen pyproject.toml - --output-file requirements/robot.txt $(ARGS)
	@echo "setuptools>=77" | $(LOCK) --extra serial --extra screen --extra live --extra ros2 --extra plots --extra data --extra inputs pyproject.toml - --output-file requirements/robot_with_extras.txt $(ARGS)
	@$(LOCK) --extra plots --extra screen --extra serial --extra data --extra cluster --extra test --extra docs --extra inputs pyproject.toml --output-file requirements/development.txt $(ARGS)
	@printf 'mypy>=1.14,<3\nsetuptools>=77\n' | $(LOCK) - --output-file requirements/compiler.txt $(ARGS)

docs: .venv/test  ## build the documentation into build/docs and run its notebooks; a warning is an error
	@$(SPHINX) -b html docs build/docs
	@echo "open build/docs/index.html"

docs-links: .venv/test  ## check the external links of the documentation; needs the Internet
	@$(SPHINX) -D nb_execution_mode=off -b linkcheck docs build/links

man: .venv/test  ## build the manual page build/man/mudskipper.1
	@$(SPHINX) -D nb_execution_mode=off -b man docs build/man
	@echo "man -l build/man/mudskipper.1"

clean:  ## remove the environment and everything that was built
	rm -rf .venv .virtual_machine build *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis

.venv/setup: pyproject.toml
	@echo "Installing into .venv (a minute or two) ..."
	@$(PYTHON) -m venv .venv
	@$(PIP) --editable ".[plots,screen,serial,data]"
	@touch $@

.venv/test: pyproject.toml requirements/development.txt
	@echo "Installing exactly what requirements/development.txt names into .venv (a minute or two) ..."
	@$(PYTHON) -m venv .venv
	@$(PIP) --no-deps --no-compile --require-hashes --only-binary=:all: --requirement requirements/development.txt
	@$(PIP) --no-deps --no-index --no-build-isolation --editable .
	@touch .venv/setup $@
