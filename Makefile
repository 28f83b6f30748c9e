# foldcar: installs what is missing, builds, runs. `make help` lists what there is to make.
#
# The Python environment is .venv, made with $(PYTHON); PlatformIO is in it. A target that is up to date costs a
# fraction of a second. Everything is named relative to this folder, whose path may contain spaces.

PYTHON ?= /usr/bin/python3
BIN := .venv/bin
STUDY := width_study

# Nothing of a caller's own Python set-up may leak into .venv.
unexport PYTHONPATH PYTHONHOME PYTHONSTARTUP VIRTUAL_ENV PIP_USER PIP_TARGET PIP_PREFIX
# foldcar and the tools write into the source tree only what is asked for.
export PIP_DISABLE_PIP_VERSION_CHECK := 1

# What pip installs: every package with its version and hashes.
LOCK := host/requirements.txt
RELEASE_LOCK := host/requirements-release.txt
UV_VERSION := 0.13.9

CARSIM := .pio/build/carsim/program
CARSIM_MUJOCO := .pio/build/carsim_mujoco/program
# Folders are among the prerequisites so that a removed file counts as a change.
CARSIM_SOURCES := $(shell find firmware/lib firmware/src sim2d platformio.ini host/foldcar/mavlink_dialect -not -name '*.pyc' \
  -not -name __pycache__) tools/build_id.py tools/firmware_id.py tools/mavlink_headers.py tools/simulation_digest.py

# What `make fresh` tries, and on which release of Debian.
SUITE := trixie
TARGETS := study test

# Random and damaged bytes for the firmware's link.
FUZZ_BYTES := 100000000
FUZZ_SEED := 1
FUZZ_FLAGS := -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all

# Seconds, seed, and to repeat a loss its round.
TORTURE_S := 1800
TORTURE_SEED := 1
TORTURE_ROUND :=
TORTURE_ONLY :=

# The portable firmware on the simulated board, for programs that need nothing else.
FIRMWARE_SOURCES := $(filter-out firmware/lib/feather_hal/%,$(wildcard firmware/lib/*/*.cpp)) sim2d/lib/sim_hal/sim_hal.cpp
FIRMWARE_FLAGS := -std=gnu++17 -I.pio/mavlink $(addprefix -I,$(wildcard firmware/lib/*)) -Isim2d/lib/sim_hal
FIRMWARE_HEADERS := $(wildcard firmware/lib/*/*.h sim2d/lib/sim_hal/*.h test/*.h)

# Every header but the one that needs ArduinoJson, and where they find each other's; the board's find the tests' fakes.
HEADERS := $(filter-out firmware/lib/design_json/%,$(shell find firmware/lib sim2d test -name '*.h' | sort))
HEADER_FLAGS := -fsyntax-only -std=gnu++17 -Wall -Wextra -Werror -pthread -DUNITY_INCLUDE_DOUBLE -Itest -Itest/arduino_fakes \
  $(addprefix -I,$(wildcard firmware/lib/* sim2d/lib/*)) $(addprefix -isystem ,.pio/mavlink $(wildcard .venv/lib/python3*/site-packages/mujoco/include) \
  $(wildcard .pio-core/lib/Unity .pio/libdeps/native/*/include .pio/libdeps/native/*/src .pio/libdeps/native/*))
HEADER_COMPILERS := g++ $(shell command -v clang++)

.DEFAULT_GOAL := help
.PHONY: help setup mujoco study pyramids calibration fidelity statistics dear_runs test test-native headers test-host lint bench fuzz races fresh clean wheel release lock system-packages platformio cluster-check torture installed
.DELETE_ON_ERROR:

help:
	@echo 'make setup     install what is missing (system packages, .venv, PlatformIO) and build the simulator'
	@echo 'make mujoco    set up and build the simulator in three dimensions, for --engine mujoco'
	@echo 'make study     set up, run the width study and write its report to out/$(STUDY)'
	@echo 'make test      set up and run every test'
	@echo 'make bench     set up and measure the speed'
	@echo 'make cluster-check  as root: sweep over network namespaces with delay, loss, deaths and a partition, and over TLS'
	@echo 'make fuzz      feed the car'"'"'s link with $(FUZZ_BYTES) random and damaged bytes (FUZZ_BYTES=, FUZZ_SEED=)'
	@echo 'make races     record and store a log in two threads under ThreadSanitizer'
	@echo 'make mutation  plant faults in the car'"'"'s physics and firmware and see whether the suites notice (MUTANTS=, MUTATION_SEED=)'
	@echo 'make torture   disturb sweeps, stores and trials at random for TORTURE_S=$(TORTURE_S) s: is anything lost? (TORTURE_SEED=)'
	@echo 'make fidelity  set up, compare with MuJoCo and bring docs/fidelity.md up to date'
	@echo 'make pyramids  set up, search sizes of the step pyramids that fit the publication, bring docs/scenarios.md up to date'
	@echo 'make calibration  set up, calibrate by the published trials, try it on known truths, renew docs/calibration.md'
	@echo 'make statistics  measure coverage of the intervals and trials saved, and bring docs/statistics.md up to date'
	@echo 'make dear_runs  set up, measure what MuJoCo until decided costs, and bring docs/advice.md up to date'
	@echo 'make fresh     as root: make study and make test in a bare root of SUITE=$(SUITE) (TARGETS=study: the study only)'
	@echo 'make release   archive of the sources and wheel with carsim, in dist/, checked and tried outside the checkout'
	@echo 'make lint      set up and check the Python sources only'
	@echo 'make lock      renew $(LOCK) after a change of pyproject.toml (LOCK_FLAGS=--upgrade: newest versions)'
	@echo 'make clean     remove everything that was built or installed here; results in out/ stay'
	@echo 'PYTHON=...     the Python (3.10 or newer) that .venv is made with; now $(PYTHON)'

setup: $(CARSIM)

mujoco: $(CARSIM_MUJOCO)

study: setup
	@mkdir -p out
	$(BIN)/foldcar sweep scenarios/$(STUDY).json --store out/$(STUDY).db
	$(BIN)/foldcar report out/$(STUDY).db -o out/$(STUDY)
	@echo "The report is $(CURDIR)/out/$(STUDY)/index.html"

pyramids: setup mujoco
	@mkdir -p out
	$(BIN)/python tools/pyramids.py out/pyramids docs/scenarios.md

calibration: setup
	@mkdir -p out
	$(BIN)/python tools/calibration.py out/calibration docs/calibration.md

fidelity: setup mujoco
	@mkdir -p out
	$(BIN)/foldcar crosscheck scenarios/fidelity.json --baseline 10 -o out/fidelity
	$(BIN)/python tools/fidelity.py out/fidelity docs/fidelity.md

statistics: .venv/installed
	$(BIN)/python tools/interval_coverage.py docs/statistics.md

dear_runs: setup mujoco
	$(BIN)/python tools/dear_runs.py out/dear_runs docs/advice.md

# One after the other, also under make -j, so that what fails stands last.
test: setup
	@tools/install_system_packages.sh tests
	$(MAKE) lint
	$(MAKE) test-native
	$(MAKE) test-host

lint: .venv/installed
	$(BIN)/ruff check host tools test $(wildcard bench)
	$(BIN)/mypy host/foldcar
	$(BIN)/mypy --ignore-missing-imports tools/*.py bench/*.py

test-native: setup
	$(BIN)/pio test -e native -e native_mujoco
	$(MAKE) headers

# Each header compiles alone: what it needs it includes itself. After the tests' build, which fetches Unity.
headers: setup
	@for compiler in $(HEADER_COMPILERS); do printf '%s\n' $(HEADERS) | \
	  xargs -P 2 -I '{}' $$compiler $(HEADER_FLAGS) -x c++ -include '{}' /dev/null || exit 1; \
	  echo "$(words $(HEADERS)) headers compile alone with $$compiler"; done

# A third process: several tests wait for a car that drives in real time.
test-host: setup mujoco
	$(BIN)/python -m pytest -n 3 --dist worksteal --durations 25 --durations-min 3 test/host

bench: setup mujoco .pio/bench/firmware_tick
	.pio/bench/firmware_tick
	$(BIN)/python bench/bench.py

cluster-check: setup
	$(BIN)/python tools/cluster_check.py out/cluster_check

fuzz: .pio/fuzz/fuzz_link
	.pio/fuzz/fuzz_link $(FUZZ_BYTES) $(FUZZ_SEED)

races: .pio/races/log_races
	TSAN_OPTIONS=history_size=7 .pio/races/log_races

# Kills, interrupts, steps clocks, fills disks, flips bits; at the first loss it says how to repeat it.
torture: setup
	TORTURE_S=$(TORTURE_S) TORTURE_SEED=$(TORTURE_SEED) TORTURE_ROUND='$(TORTURE_ROUND)' TORTURE_ONLY='$(TORTURE_ONLY)' \
	  $(BIN)/python test/torture/torture.py

# Both commands, as a new user on a machine with nothing on it (as root).
fresh:
	@tools/install_system_packages.sh fresh
	@tools/fresh.sh $(SUITE) $(TARGETS)

.pio/fuzz/fuzz_link: test/fuzz/fuzz_link.cpp $(FIRMWARE_SOURCES) $(FIRMWARE_HEADERS) | setup
	@mkdir -p $(@D)
	$(CXX) $(FIRMWARE_FLAGS) $(FUZZ_FLAGS) $(filter %.cpp,$^) -o $@

.pio/races/log_races: test/races/log_races.cpp $(FIRMWARE_SOURCES) $(FIRMWARE_HEADERS) | setup
	@mkdir -p $(@D)
	$(CXX) $(FIRMWARE_FLAGS) -O1 -g -fsanitize=thread -pthread $(filter %.cpp,$^) -o $@

.pio/bench/firmware_tick: bench/firmware_tick.cpp $(FIRMWARE_SOURCES) $(FIRMWARE_HEADERS) | setup
	@mkdir -p $(@D)
	$(CXX) $(FIRMWARE_FLAGS) -O2 $(filter %.cpp,$^) -o $@

clean:
	rm -rf .venv .pio .pio-core platformio.local.ini build dist host/foldcar.egg-info .mypy_cache .ruff_cache .pytest_cache
	find host tools test -name __pycache__ -type d -prune -exec rm -rf {} +

system-packages:
	@tools/install_system_packages.sh

.venv/installed: pyproject.toml $(LOCK) | system-packages
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { \
	  echo 'make: PYTHON=$(PYTHON) is missing or older than Python 3.10; name a newer one' >&2; exit 2; }
	"$(PYTHON)" -m venv .venv
	$(BIN)/pip install --quiet --no-deps --require-hashes -r $(LOCK)
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

# One lock for every supported Python; what it names stays as it is where it still fits (LOCK_FLAGS=--upgrade renews it).
lock: .pio/lock/bin/uv
	.pio/lock/bin/uv pip compile --universal --python-version 3.10 --generate-hashes --no-emit-index-url \
	  --no-annotate --custom-compile-command 'make lock' --quiet $(LOCK_FLAGS) --extra dev --extra mujoco --extra cluster pyproject.toml -o $(LOCK)
	.pio/lock/bin/uv pip compile --universal --python-version 3.10 --generate-hashes --no-emit-index-url --no-annotate \
	  --custom-compile-command 'make lock' --quiet $(LOCK_FLAGS) --group pyproject.toml:release -o $(RELEASE_LOCK)

# A wheel with carsim: the archive of the sources, then the wheel from nothing but that archive.
wheel: .venv/installed .pio/release/installed
	@tools/build_wheel.sh dist

# Both, checked: their form, what the programs load, and as a user has them, with no compiler and no checkout.
release: wheel
	.pio/release/bin/twine check --strict dist/*
	@tools/try_wheel.sh dist/*.whl

# On a bare machine: the wheel in dist/, which was built on another, as the Dockerfile installs it.
installed:
	tools/install_wheel.sh dist/*.whl /opt/foldcar '[mujoco]'
	tools/smoke.sh /opt/foldcar/bin/foldcar

.pio/release/installed: $(RELEASE_LOCK) | system-packages
	"$(PYTHON)" -m venv .pio/release
	.pio/release/bin/pip install --quiet --no-deps --require-hashes -r $(RELEASE_LOCK)
	@touch $@

.pio/lock/bin/uv:
	"$(PYTHON)" -m venv .pio/lock
	.pio/lock/bin/pip install --quiet uv==$(UV_VERSION)

# Quick where all is there already; see the script for when it does something.
platformio: .venv/installed
	@$(BIN)/python tools/seed_platformio.py --if-unreachable

$(CARSIM): $(CARSIM_SOURCES) | platformio
	$(BIN)/pio run -e carsim
	@touch $@

$(CARSIM_MUJOCO): $(CARSIM_SOURCES) tools/mujoco_library.py | platformio
	$(BIN)/pio run -e carsim_mujoco
	@touch $@

# Plants small faults in the C++ sources and sees whether the tests notice them: MUTANTS of each file, or all.
MUTANTS := 10
MUTATION_SEED := 1
.PHONY: mutation
mutation: setup
	$(BIN)/python tools/mutation.py --mutants $(MUTANTS) --seed $(MUTATION_SEED)
