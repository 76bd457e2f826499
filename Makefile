# `make demo` and `make test` are all that a new user needs; `make help` lists the rest.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
HOST_BUILD := build/host
ASAN_BUILD := build/asan
RV32_BUILD := build/rv32
CXX_FILES = $(shell find firmware -name '*.hpp' -o -name '*.cpp' -o -name '*.h')
export PATH := $(abspath $(BIN)):$(PATH)

.DEFAULT_GOAL := help
.PHONY: help gen gen-check format lint type sim cpp-tests rv32 test demo bench clean

help:  ## This list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(VENV)/installed: pyproject.toml tools/check-machine
	@tools/check-machine $(PYTHON)
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

gen: $(VENV)/installed  ## Write what is generated from the protocol's definitions
	$(BIN)/python -m wheelwire_protocol.generate

gen-check: $(VENV)/installed  ## Fail when a generated file is not what the definitions say
	$(BIN)/python -m wheelwire_protocol.generate --check

format: $(VENV)/installed  ## Format Python and C++
	$(BIN)/ruff format host protocol tests
	$(BIN)/ruff check --fix host protocol tests
	@$(BIN)/clang-format -i $(CXX_FILES)

lint: $(VENV)/installed  ## Style, layers, formatting
	$(BIN)/ruff check host protocol tests
	$(BIN)/ruff format --check host protocol tests
	$(BIN)/lint-imports
	@$(BIN)/clang-format --dry-run -Werror $(CXX_FILES)

type: $(VENV)/installed  ## mypy --strict
	$(BIN)/mypy

# $(call cmake,folder,options,targets)
cmake = $(BIN)/cmake -S firmware/esp32/sim -B $(1) -G Ninja $(2) --log-level=WARNING >/dev/null && \
	$(BIN)/cmake --build $(1) --target $(3)

sim: $(VENV)/installed  ## Build the firmware for this computer, with its simulated robot
	@$(call cmake,$(HOST_BUILD),-DCMAKE_BUILD_TYPE=Release,wheelwire-fwsim fwsim)

cpp-tests: $(VENV)/installed  ## Build the C++ tests, plain and under the sanitizers
	@$(call cmake,$(HOST_BUILD),-DCMAKE_BUILD_TYPE=Release,all)
	@$(call cmake,$(ASAN_BUILD),-DCMAKE_BUILD_TYPE=RelWithDebInfo -DWHEELWIRE_SANITIZE=ON,all)

rv32: $(VENV)/installed  ## Build the core for RV32IMC with Debian's compiler, to count its instructions
	@$(BIN)/cmake -S firmware/esp32/rv32 -B $(RV32_BUILD) -G Ninja --log-level=WARNING >/dev/null
	@$(BIN)/cmake --build $(RV32_BUILD)

test: cpp-tests  ## Every test
	$(BIN)/python -m pytest

demo: sim  ## Drive the simulated robot: a figure eight, then a stop by watchdog
	@$(BIN)/wheelwire demo --output build/demo

bench: sim  ## Benchmarks: codec against its peers, control quality, cost
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	$(BIN)/python tests/bench/codec.py
	$(BIN)/python tests/bench/control.py
	$(BIN)/python tests/bench/cost.py

clean:  ## Remove everything built
	rm -rf build $(VENV)
