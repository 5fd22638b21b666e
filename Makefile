# `make` lists what there is. Everything lives in .venv; nothing else on the machine is touched.

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet

# Tests of a robot in real time, or whose order counts: one after the other, and beside nothing else.
IN_PEACE := bench $(addprefix command_line/,experiments/test_actuator.py operation/test_attended_walk.py demo/test_demo.py doctor/test_doctor.py operation/test_failing.py operation/test_operation.py test_permission.py) $(addprefix experiments/,bench/test_rig.py robot/test_daemon_robot.py)

# A test that hangs is ended, and told with the place where it hung.
ENDED_HUNG := -o faulthandler_timeout=600 -o faulthandler_exit_on_timeout=true

.PHONY: help setup demo test test-vm mutants lint clean

help:  ## this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

setup: .venv/setup  ## the environment, with all that running and plotting need

demo: .venv/setup  ## a simulated robot walks over three muds, in real time
	@$(BIN)/mudskipper demo $(ARGS)

test: .venv/test  ## every test, without network
	$(BIN)/python -m pytest -q $(ENDED_HUNG) --numprocesses 2 --dist loadfile $(addprefix --ignore=tests/,$(IN_PEACE)) $(ARGS)
	$(BIN)/python -m pytest -q $(ENDED_HUNG) --simulated $(addprefix tests/,$(IN_PEACE)) $(ARGS)

test-vm: .venv/test  ## the daemon under systemd on a real kernel, in a virtual machine
	@$(BIN)/python -m virtual_machine.installed_robot
	$(BIN)/python -m pytest -v virtual_machine $(ARGS)

mutants: .venv/test  ## change the transmit gate in 204 places; its tests must notice each
	$(BIN)/python -m tests.drivers.odrive.gate_mutants

lint: .venv/test  ## ruff and mypy --strict
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy

clean:  ## remove the environment and what was built
	rm -rf .venv .virtual_machine build *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis

.venv/setup: pyproject.toml
	@echo "Installing into .venv (a minute or two) ..."
	@$(PYTHON) -m venv .venv
	@$(PIP) --editable ".[plots,serial]"
	@touch $@

.venv/test: .venv/setup
	@echo "Installing what the tests need ..."
	@$(PIP) --editable ".[plots,serial,test]"
	@touch $@
