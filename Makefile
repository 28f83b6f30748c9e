# foldcar: installs what is missing, builds, runs. `make help` lists what there is to make.
#
# The Python environment is .venv, made with $(PYTHON); PlatformIO is in it. A target that is up to date costs a
# fraction of a second. Everything is named relative to this folder, whose path may contain spaces.

PYTHON ?= /usr/bin/python3
BIN := .venv/bin
STUDY := width_study

# Nothing of a caller's own Python set-up may leak into .venv. Without bytecode, each process of a test compiles foldcar anew.
unexport PYTHONPATH PYTHONHOME PYTHONSTARTUP PYTHONDONTWRITEBYTECODE VIRTUAL_ENV PIP_USER PIP_TARGET PIP_PREFIX
# foldcar and the tools write into the source tree only what is asked for.
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Caches stay below the checkout, where `make clean` removes them: uv's and pip's unless UV_CACHE_DIR and PIP_CACHE_DIR name others.
export XDG_CACHE_HOME := $(CURDIR)/.pio/cache
export MPLCONFIGDIR := $(XDG_CACHE_HOME)/matplotlib
export npm_config_cache := $(XDG_CACHE_HOME)/npm

# Debian's ccache, if it is there, compiles once what several environments compile alike.
export PATH := /usr/lib/ccache:$(PATH)
export CCACHE_DIR ?= $(CURDIR)/.pio/ccache

# What is installed: every package with its version and hashes. EXTRAS_LOCK has what LOCK has not.
LOCK := host/requirements.txt
EXTRAS_LOCK := host/requirements-dev.txt
RELEASE_LOCK := host/requirements-release.txt

CARSIM := .pio/build/carsim/program
CARSIM_MUJOCO := .pio/build/carsim_mujoco/program
# The simulator in WebAssembly, for pages and for systems without a native one. PlatformIO empties its build folder now and then.
CARSIM_WASM := .pio/wasm/carsim.wasm
# The pages' scripts with three.js and charts; the notice is written last.
BUNDLES := host/foldcar/bundles/NOTICE.txt
# Folders are among the prerequisites so that a removed file counts as a change.
CARSIM_SOURCES := $(shell find firmware/lib firmware/src sim2d platformio.ini $(addprefix host/foldcar/link/,dialect.py foldcar.xml standard_messages.txt) -not -name '*.pyc' \
  -not -name __pycache__) tools/build_id.py tools/golden_check.py tools/firmware_id.py tools/mavlink_headers.py tools/simulation_digest.py tools/carsim_build.py tools/joined_sources.py tools/determinism.py

# What `make fresh` tries, and on which release of Debian.
SUITE := trixie
TARGETS := study test

# Seconds for each fuzzer of `make fuzz`, and the fuzzers.
FUZZ_S := 60
FUZZERS := batch step design link parameters
CLANG = $(firstword $(shell command -v clang++ clang++-19 clang++-18 clang++-16 clang++-14))
CLANG_TIDY = $(firstword $(shell command -v clang-tidy clang-tidy-19 clang-tidy-18 clang-tidy-16 clang-tidy-14))
# Percent of the lines of firmware/lib and sim2d/lib.
MIN_COVERAGE := 90
FUZZ_FLAGS := -O1 -g -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all -ffp-contract=off

BOX2D = $(firstword $(wildcard .pio/libdeps/carsim/box2d .pio-core/lib/box2d))

# Every header but the one that needs ArduinoJson, and where they find each other's; the board's find the tests' fakes.
# What a source includes first compiles alone in every build; the board's sources are built behind each other.
HEADERS := $(filter-out firmware/lib/design_json/%,$(shell find firmware/lib sim2d test -name '*.h' | sort))
PROVED_HEADERS = $(shell for header in $(filter-out firmware/lib/feather_hal/%,$(HEADERS)); do \
  grep -sm1 '^.include' "$${header%.h}.cpp" | grep -qF "\"$$(basename $$header)\"" && echo $$header; done)
HEADER_FLAGS := -fsyntax-only -std=gnu++17 -Wall -Wextra -Werror -pthread -DUNITY_INCLUDE_DOUBLE -DB2_USER_SETTINGS -Itest -Itest/arduino_fakes \
  $(addprefix -I,$(wildcard firmware/lib/* sim2d/lib/*)) $(addprefix -isystem ,.pio/mavlink $(wildcard .venv/lib/python3*/site-packages/mujoco/include) \
  $(wildcard .pio-core/lib/Unity .pio/libdeps/native/*/include .pio/libdeps/native/*/src .pio/libdeps/native/*))
HEADER_COMPILERS := g++ $(shell command -v clang++)

.DEFAULT_GOAL := help
.PHONY: help setup extras mujoco study pyramids fidelity advice synthetic scale test test-packages test-native headers test-host lint bench commands fuzz races fresh container-check clean wheel release lock system-packages platformio installed fuzz-packages check docs tidy determinism golden
.DELETE_ON_ERROR:

help:
	@echo 'make setup     install what is missing (system packages, .venv, PlatformIO) and build the simulator'
	@echo 'make extras    install what else foldcar uses (Dask, Parquet) and what the tests need'
	@echo 'make mujoco    set up and build carsim with MuJoCo, for --engine mujoco'
	@echo 'make study     set up, run the width study and write its report to out/$(STUDY)'
	@echo 'make test      set up and run every test'
	@echo 'make bench     set up and measure the speed'
	@echo 'make commands  measure the processor time of each command, bring docs/performance.md up to date'
	@echo 'make fuzz      fuzz every parser of the C++ programs under sanitizers, each for FUZZ_S=$(FUZZ_S) seconds'
	@echo 'make check     the C++ suites under sanitizers, coverage of C++ and Python, headers alone, clang-tidy'
	@echo 'make determinism  build the simulator with g++ and clang++ at -O0 to -O3, and compare their numbers and carsim.wasm bit by bit'
	@echo 'make golden    renew the golden numbers of test/determinism after a change of the physics'
	@echo 'make races     record and store a log in two threads under ThreadSanitizer'
	@echo 'make fidelity  set up, compare with MuJoCo and bring docs/fidelity.md up to date'
	@echo 'make pyramids  set up, search sizes of the step pyramids that fit the publication, bring docs/scenarios.md up to date'
	@echo 'make advice      regret and coverage of the advice on hidden realities, in out/advice'
	@echo 'make synthetic   the whole method on a hidden reality in MuJoCo, in out/synthetic'
	@echo 'make scale       the cost of families of up to a million runs, in out/scale'
	@echo 'make fresh     as root: make study and make test in a bare root of SUITE=$(SUITE) (TARGETS=study: the study only)'
	@echo 'make container-check  as root: the steps of the Dockerfile in bare roots, without a container engine'
	@echo 'make release   archive of the sources and wheel with carsim, in dist/, checked and tried outside the checkout'
	@echo 'make docs      the pages of docs/ as a site with search, in out/site'
	@echo 'make lint      set up and check the Python sources only'
	@echo 'make lock      renew $(LOCK) after a change of pyproject.toml (LOCK_FLAGS=--upgrade: newest versions)'
	@echo 'make clean     remove everything that was built or installed here; results in out/ stay'
	@echo 'PYTHON=...     the Python (3.10 or newer) that .venv is made with; now $(PYTHON)'

setup: $(CARSIM) $(CARSIM_WASM) $(BUNDLES)

extras: .venv/extras

mujoco: $(CARSIM_MUJOCO)

study:
	@$(MAKE) --no-print-directory -j 2 setup
	@mkdir -p out
	$(BIN)/foldcar sweep scenarios/$(STUDY).json --store out/$(STUDY).db
	$(BIN)/foldcar report out/$(STUDY).db -o out/$(STUDY)
	@echo "The report is $(CURDIR)/out/$(STUDY)/index.html"

pyramids: setup mujoco
	@mkdir -p out
	$(BIN)/python tools/pyramids.py out/pyramids docs/scenarios.md

fidelity: setup mujoco
	@mkdir -p out
	$(BIN)/python tools/fidelity.py out/fidelity.db out/across.db docs/fidelity.md

# What docs/belief.md quotes.
advice: setup .venv/extras
	$(BIN)/python tools/advice.py out/advice

# The whole method on a hidden reality, as docs/fidelity.md tells it; into a new folder.
synthetic: setup mujoco
	@mkdir -p out
	$(BIN)/python docs/synthetic_study.py out/synthetic

# The cost of families of up to a million runs, as in docs/performance.md; into a new folder.
scale: setup
	@mkdir -p out
	$(BIN)/python bench/scale.py out/scale --most 1000000

# All else runs beside the host's tests, in the time in which these wait for cars and browsers. What fails stands last, also
# under make -j; a shell's background ignores Ctrl-C, hence the trap, and timeout ends all that it started.
test: test-packages
	@$(MAKE) --no-print-directory -j 2 setup
	@$(MAKE) --no-print-directory mujoco
	@timeout 2h nice $(MAKE) -k lint test-native >.pio/beside.txt 2>&1 & beside=$$!; trap 'kill $$beside; exit 130' INT TERM; \
	  $(MAKE) test-host; host=$$?; wait $$beside; others=$$?; \
	  [ $$others = 0 ] && echo 'ruff, mypy and the C++ suites find nothing: .pio/beside.txt' || cat .pio/beside.txt; \
	  exit $$((host | others))

test-packages:
	@tools/install_system_packages.sh tests

lint: .venv/extras .pio/types/numpy $(BUNDLES)
	$(BIN)/ruff check host tools test $(wildcard bench)
	$(BIN)/mypy host/foldcar tools/*.py $(wildcard bench/*.py)
	$(BIN)/python tools/page_types.py

# Types are checked against the lock's NumPy for Python 3.11, whichever Python .venv has: each NumPy has other types.
.pio/types/numpy: $(LOCK) | .venv/installed
	rm -rf $(@D) && mkdir -p $(@D)
	sed -n "/^numpy==.* '3.11.\*'/,/[^\\]$$/{s/ ; [^\\]*/ /;p}" $(LOCK) >$(@D)/requirements.txt
	$(BIN)/pip install --quiet --no-deps --require-hashes --only-binary :all: --python-version 3.11 --target $(@D) -r $(@D)/requirements.txt
	@touch $@

test-native: setup .venv/extras
	$(BIN)/pio test -e native -e native_mujoco

# Each header compiles alone: what it needs it includes itself. After a build of the tests, which fetches Unity.
headers: setup
	@for compiler in $(HEADER_COMPILERS); do printf '%s\n' $(filter-out $(PROVED_HEADERS),$(HEADERS)) | \
	  xargs -P 2 -I '{}' $$compiler $(HEADER_FLAGS) -isystem $(BOX2D)/include -x c++ -include '{}' /dev/null || exit 1; \
	  printf '#include "%s"\n' $(PROVED_HEADERS) | $$compiler $(HEADER_FLAGS) -isystem $(BOX2D)/include -I. -x c++ - || exit 1; \
	  echo "$(words $(HEADERS)) headers compile alone with $$compiler"; done

# A third process: several tests wait for a car that drives in real time.
test-host: setup mujoco
	$(BIN)/python -m pytest -n 3 --dist worksteal -m 'not slow' --durations 25 --durations-min 3 test/host

bench: setup mujoco .pio/bench/firmware_tick
	.pio/bench/firmware_tick
	$(BIN)/python bench/bench.py

# What docs/performance.md says of each command.
commands: setup
	$(BIN)/python bench/commands.py $(CURDIR)/$(BIN)/foldcar docs/performance.md

fuzz: .pio/fuzz/built
	@for fuzzer in $(FUZZERS); do mkdir -p .pio/fuzz/corpus/$$fuzzer .pio/fuzz/seeds/$$fuzzer; done
	@$(BIN)/python test/fuzz/seeds.py .pio/fuzz/seeds
	@for fuzzer in $(FUZZERS); do echo "$$fuzzer: $(FUZZ_S) s"; \
	  .pio/fuzz/fuzz_$$fuzzer -max_total_time=$(FUZZ_S) -timeout=60 -max_len=16384 -print_final_stats=1 -verbosity=0 \
	  -artifact_prefix=.pio/fuzz/$$fuzzer- .pio/fuzz/corpus/$$fuzzer .pio/fuzz/seeds/$$fuzzer || exit 1; done
	@echo 'The fuzzers ($(FUZZERS)) have found nothing in $(FUZZ_S) s each'

fuzz-packages:
	@tools/install_system_packages.sh check

# Bit-identical results over compilers and levels of optimisation.
determinism: setup
	$(BIN)/python tools/determinism.py

# After a change of the physics.
golden:
	FOLDCAR_GOLDEN=renew $(MAKE) setup
	$(BIN)/python tools/determinism.py --renew --numerics g++ O0 carsim.wasm O3

# The C++ suites under sanitizers, what of the lines they and the host's tests run, and static analysis.
check: setup mujoco
	@tools/install_system_packages.sh check
	find .pio/build/native_check -name '*.gcda' -delete 2>/dev/null || true
	$(BIN)/pio test -e native_check
	$(BIN)/gcovr --root . --filter 'firmware/lib/' --filter 'sim2d/lib/' --exclude-throw-branches --gcov-ignore-parse-errors \
	  --fail-under-line $(MIN_COVERAGE) .pio/build/native_check
	$(MAKE) headers tidy
	$(BIN)/coverage erase --rcfile pyproject.toml
	$(BIN)/coverage run --rcfile pyproject.toml -m pytest -n 3 --dist worksteal test/host
	$(BIN)/coverage combine --rcfile pyproject.toml --quiet
	$(BIN)/coverage report --rcfile pyproject.toml --skip-covered
	@echo 'No sanitizer, no test and not clang-tidy finds a fault; $(MIN_COVERAGE) % of the C++ lines or more are run'

tidy: setup fuzz-packages
	@$(BIN)/python tools/carsim_build.py check '$(CLANG_TIDY) --quiet'
	@echo 'clang-tidy finds nothing'

races: .pio/races/log_races
	TSAN_OPTIONS=history_size=7 .pio/races/log_races

# Both commands, as a new user on a machine with nothing on it (as root).
fresh:
	@tools/install_system_packages.sh fresh
	@tools/fresh.sh $(SUITE) $(TARGETS)

# The Dockerfile's steps in bare roots, without a container engine, then the container's command (as root).
container-check:
	@tools/install_system_packages.sh fresh
	"$(PYTHON)" tools/container_check.py

# One file stands for all: they share the simulator's objects.
.pio/fuzz/built: $(CARSIM_SOURCES) $(wildcard test/fuzz/*) test/mavlink_host.h | setup fuzz-packages
	$(BIN)/python tools/carsim_build.py programs $(@D) $(CLANG) '$(FUZZ_FLAGS) -fsanitize=fuzzer' $(FUZZERS:%=test/fuzz/fuzz_%.cpp)
	@touch $@

.pio/races/log_races: $(CARSIM_SOURCES) $(wildcard test/races/* test/*.h) | setup
	$(BIN)/python tools/carsim_build.py programs $(@D) $(CXX) '-O1 -g -fsanitize=thread' test/races/log_races.cpp

.pio/bench/firmware_tick: bench/firmware_tick.cpp $(CARSIM_SOURCES) $(wildcard test/*.h) | setup
	$(BIN)/python tools/carsim_build.py programs $(@D) $(CXX) -O2 $<

clean:
	rm -rf .venv .pio .pio-core host/web/node_modules host/foldcar/bundles platformio.local.ini build dist .coverage* host/foldcar.egg-info .mypy_cache .ruff_cache .pytest_cache
	find host tools test -name __pycache__ -type d -prune -exec rm -rf {} +

system-packages:
	@tools/install_system_packages.sh

# uv needs a fraction of pip's time; pip stays for where packages come from a place that only its own settings name.
install = $(BIN)/uv pip install --quiet --python $(BIN)/python $(if $(PIP_INDEX_URL),--index-url $(PIP_INDEX_URL)) --no-deps --require-hashes -r $(1) || \
  $(BIN)/pip install --quiet --no-deps --require-hashes -r $(1)

.venv/installed: pyproject.toml $(LOCK) | system-packages
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { \
	  echo 'make: PYTHON=$(PYTHON) is missing or older than Python 3.10; name a newer one' >&2; exit 2; }
	"$(PYTHON)" -m venv .venv
	sed -n '/^uv==/,/[^\\]$$/p' $(LOCK) >.venv/uv.txt
	$(BIN)/pip install --quiet --no-deps --require-hashes -r .venv/uv.txt
	$(call install,$(LOCK))
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

.venv/extras: $(EXTRAS_LOCK) | .venv/installed
	$(call install,$(EXTRAS_LOCK))
	@touch $@

$(BUNDLES): tools/web_bundles.py host/web/package-lock.json host/web/package.json $(shell find host/foldcar -path '*/web*' -not -name '*.html') \
  | .venv/installed
	$(BIN)/python tools/web_bundles.py
	@touch $@

# The site's live pages, by listing: a report in which visitors drive simulated cars.
LIVE = out/live
docs: setup .pio/release/installed
	rm -rf $(LIVE)
	mkdir -p $(LIVE)
	$(BIN)/foldcar sweep scenarios/width_study.json --store $(LIVE)/width_study.db
	$(BIN)/foldcar trials import $(LIVE)/width_study.db scenarios/published_trials.csv
	$(BIN)/foldcar report $(LIVE)/width_study.db -o $(LIVE)/width_study
	$(BIN)/foldcar sweep examples/six_wheels.json --store $(LIVE)/six_wheels.db
	$(BIN)/foldcar report $(LIVE)/six_wheels.db -o $(LIVE)/six_wheels
	NO_MKDOCS_2_WARNING=1 .pio/release/bin/mkdocs build --strict --quiet --config-file tools/mkdocs.yml
	@echo "The site is $(CURDIR)/out/site/index.html; with search: $(BIN)/python -m http.server --directory out/site"

# For every supported Python; what it names stays as it is where it still fits (LOCK_FLAGS=--upgrade renews it).
compile = $(BIN)/uv pip compile --universal --python-version 3.10 --generate-hashes --no-emit-index-url --no-annotate \
  --custom-compile-command 'make lock' --quiet $(LOCK_FLAGS)
lock: .venv/installed
	$(compile) --extra make pyproject.toml -o $(LOCK)
	$(compile) --extra dev --constraint $(LOCK) pyproject.toml -o $(EXTRAS_LOCK)
	awk 'NR == FNR { locked[$$0]; next } /^[a-z]/ { is_new = !($$0 in locked) } /^#/ || is_new' $(LOCK) $(EXTRAS_LOCK) >.pio/lock.txt
	mv .pio/lock.txt $(EXTRAS_LOCK)
	$(compile) --group pyproject.toml:release -o $(RELEASE_LOCK)

# A wheel with carsim: the archive of the sources, then the wheel from nothing but that archive.
wheel: .venv/extras .pio/release/installed
	@tools/build_wheel.sh dist

# Both, checked: their form, what the programs load, and as a user has them, with no compiler and no checkout.
release: wheel
	.pio/release/bin/twine check --strict dist/*
	@tools/try_wheel.sh dist/*linux*.whl

# On a bare machine: the wheel in dist/, which was built on another, as the Dockerfile installs it.
installed:
	tools/install_wheel.sh dist/*linux*.whl /opt/foldcar '[all]'
	tools/smoke.sh /opt/foldcar/bin/foldcar

.pio/release/installed: $(RELEASE_LOCK) | system-packages
	"$(PYTHON)" -m venv .pio/release
	.pio/release/bin/pip install --quiet --no-deps --require-hashes -r $(RELEASE_LOCK)
	@touch $@

# Quick where all is there already; see the script for when it does something.
platformio: .venv/installed
	@$(BIN)/python tools/seed_platformio.py --if-unreachable

$(CARSIM): $(CARSIM_SOURCES) | platformio
	$(BIN)/pio run -e carsim
	@touch $@

# The native build writes the generated headers. Without Emscripten all but pages that drive works.
$(CARSIM_WASM): $(CARSIM_SOURCES) | $(CARSIM)
	@tools/install_system_packages.sh wasm || true
	$(BIN)/python tools/carsim_build.py wasm $(@D)
	@touch $@

$(CARSIM_MUJOCO): $(CARSIM_SOURCES) tools/mujoco_library.py | platformio .venv/extras
	$(BIN)/pio run -e carsim_mujoco
	@touch $@
