# From a fresh Debian 12 with git, Python 3.11, g++ and make. `make help` lists the targets.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# Warnings are errors in CI only.
WERROR := $(if $(CI),ON,OFF)
# The same sources are compiled for the wheel, the C++ tests and from the sdist: once, where paths are
# taken relative to each.
export CMAKE_CXX_COMPILER_LAUNCHER := ccache
export CCACHE_BASEDIR := $(CURDIR)
export CCACHE_NOHASHDIR := 1
export CXX

BUILD_PACKAGES := ccache cmake g++ libceres-dev libeigen3-dev libhwy-dev libopencv-dev libyaml-cpp-dev make \
    ninja-build nlohmann-json3-dev python3-dev python3-venv zlib1g-dev
# What xcalib-cli needs besides.
CLI_PACKAGES := libavcodec-dev libavformat-dev libavutil-dev libcli11-dev libswscale-dev pkg-config
TEST_PACKAGES := clang-format libgtest-dev pkg-config
FUZZ_PACKAGES := clang libclang-rt-14-dev
BENCH_PACKAGES := libbenchmark-dev
# The cross compiler's own libraries, and an emulator: no foreign architecture is added to dpkg.
AARCH64_PACKAGES := cmake g++-aarch64-linux-gnu googletest libeigen3-dev libhwy-dev ninja-build pkg-config \
    qemu-user

CPP_FILES = $(shell find bench/cpp cpp examples tests -name '*.[ch]' -o -name '*.[ch]pp')
# What the wheel is made of: it is built again when one of these changes.
WHEEL_FILES := CMakeLists.txt pyproject.toml README.md LICENSE third_party/README.md \
    $(shell find cmake cpp python -type f -not -path '*/__pycache__/*')

.PHONY: help demo cli wheel test-wheel test lint test-cpp test-sdist test-python test-aarch64 test-cluster test-native test-bad-inputs sanitize fuzz kill-test packages \
    format stub clean
help:
	@grep -E '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*##/:/' | column -t -s ':'

demo: $(VENV)/.installed ## render a rig, calibrate it, register it: pictures in build/demo
	$(BIN)/xcalib demo -o build/demo

test: lint test-cpp test-sdist test-python ## every check and test, C++ and Python

# -- What the machine needs -----------------------------------------------------------------------

.PHONY: build-packages test-packages bench-packages
build-packages:
	@scripts/install_packages.sh $(BUILD_PACKAGES)
test-packages: | build-packages
	@scripts/install_packages.sh $(TEST_PACKAGES) $(CLI_PACKAGES)
bench-packages: | build-packages
	@scripts/install_packages.sh $(BENCH_PACKAGES)

# -- The environment, and the package in it -------------------------------------------------------

# $(call requirements,table key): a list of requirements in pyproject.toml, one a line.
requirements = $(BIN)/python -c 'import functools, sys, tomllib; \
    table = tomllib.load(open("pyproject.toml", "rb")); \
    print(*functools.reduce(dict.get, sys.argv[1:], table), sep="\n")' $(1)

$(VENV)/.created: | build-packages
	$(PYTHON) -m venv --clear $(VENV)
	touch $@

$(VENV)/.build-requires: pyproject.toml $(VENV)/.created
	@echo "installing what the build requires"
	@$(PIP) install -q -r <($(call requirements,build-system requires))
	touch $@

$(VENV)/.test-requires: pyproject.toml $(VENV)/.build-requires
	@echo "installing what the tests require"
	@$(PIP) install -q -r <($(call requirements,project optional-dependencies test))
	touch $@

# PyTorch is the largest of them: of its builds, the one that PIP_EXTRA_INDEX_URL and the like choose.
$(VENV)/.bench-requires: pyproject.toml $(VENV)/.build-requires
	@echo "installing what the benchmarks require"
	@$(PIP) install -q -r <($(call requirements,project optional-dependencies bench))
	touch $@

# Without build isolation, so that CMake finds the same pybind11 again and builds what changed only.
$(VENV)/.installed: $(WHEEL_FILES) $(VENV)/.build-requires
	$(PIP) install -q --no-build-isolation --config-settings=build-dir=build/wheel \
	    --config-settings=cmake.define.XCALIB_WERROR=$(WERROR) .
	touch $@

# -- Checks ---------------------------------------------------------------------------------------

lint: $(VENV)/.installed $(VENV)/.test-requires | test-packages ## formatting, lint, types, and who includes whom
	clang-format --dry-run --Werror $(CPP_FILES)
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy
	$(BIN)/python scripts/check_rooms.py

# $(call preset,name,options): configures, builds and tests one of CMakePresets.json.
define preset
cmake --preset $(1) -DXCALIB_WERROR=$(WERROR) $(2)
cmake --build --preset $(1)
ctest --preset $(1)
endef

test-cpp: | test-packages bench-packages ## C++ tests, and the installed libraries used by others' projects
	$(call preset,release,-DXCALIB_BENCH=ON)
	$(call preset,embedded)

sanitize: | test-packages ## C++ tests under the sanitizers: addresses and undefined behaviour, then threads
	$(call preset,sanitize)
	$(call preset,threads)

.PHONY: fuzz-packages
fuzz-packages: | test-packages
	@scripts/install_packages.sh $(FUZZ_PACKAGES)
FUZZ_SECONDS ?= 60
FUZZ_TARGETS := arrays depth_stream flir headers journal npy rig_file times_table tiff_stack video
# A unit that takes over 10 s or 2 GB has failed too; what OpenCV reserves, untouched, for a strip of a TIFF is up to 8 GB.
fuzz: $(VENV)/.installed $(VENV)/.test-requires | fuzz-packages ## every reader of files under libFuzzer, a minute each
	cmake --preset fuzz -DXCALIB_WERROR=$(WERROR)
	cmake --build --preset fuzz
	PYTHONPATH=tests:tests/bad_inputs $(BIN)/python tests/fuzz/write_corpora.py build/fuzz/seeds
	for target in $(FUZZ_TARGETS); do \
	    mkdir -p build/fuzz/corpus/$$target; \
	    build/fuzz/tests/fuzz/fuzz_$$target -max_total_time=$(FUZZ_SECONDS) -timeout=10 -rss_limit_mb=2048 -malloc_limit_mb=8192 \
	        -print_final_stats=1 -verbosity=0 -artifact_prefix=build/fuzz/ build/fuzz/corpus/$$target build/fuzz/seeds/$$target; \
	done

KILLS ?= 100
kill-test: $(VENV)/.installed $(VENV)/.test-requires cli ## runs killed at random moments, and resumed
	$(BIN)/python tests/kills.py --kills $(KILLS)

test-cluster: $(VENV)/.installed $(VENV)/.test-requires ## workers and schedulers that are killed, stopped, full, or of another version
	cd tests && XCALIB_CLUSTER=1 ../$(BIN)/python -m pytest test_cluster.py

test-native: | test-packages ## the registrar for this machine's instruction set alone, as some compile all they have
	$(call preset,native)

.PHONY: aarch64-packages
aarch64-packages:
	@scripts/install_packages.sh $(AARCH64_PACKAGES)
test-aarch64: | aarch64-packages ## the registrar for 64-bit ARM, its tests under an emulator
	$(call preset,aarch64)

packages: | build-packages ## Debian packages, into build/packages
	@scripts/install_packages.sh dpkg-dev $(CLI_PACKAGES)
	cmake --preset packages
	cmake --build --preset packages
	cd build/packages && cpack

test-sdist: build/sdist/.tested ## an sdist builds, and installs from source
build/sdist/.tested: $(WHEEL_FILES) $(VENV)/.test-requires | $(VENV)/.installed
	rm -rf build/sdist
	$(BIN)/python -m build --sdist --no-isolation --outdir build/sdist .
	! tar -tf build/sdist/*.tar.gz | grep -E '/(\.venv|build|__pycache__|\.[a-z]+_cache)/'
	tar -xf build/sdist/*.tar.gz -C build/sdist
	CCACHE_BASEDIR=$$(echo $(CURDIR)/build/sdist/xcalib*[0-9]) $(PIP) install -q --no-build-isolation --no-deps \
	    --config-settings=build-dir=build/wheel --config-settings=cmake.define.XCALIB_WERROR=$(WERROR) \
	    --target build/sdist/site build/sdist/xcalib*[0-9]/
	cd build/sdist/site && ../../../$(BIN)/python -c \
	    'import pathlib, xcalib; assert pathlib.Path(xcalib.__file__).is_relative_to(pathlib.Path.cwd())'
	touch $@

$(VENV)/.wheel-requires: pyproject.toml $(VENV)/.build-requires
	@echo "installing what a wheel for others requires"
	@$(PIP) install -q -r <($(call requirements,project optional-dependencies wheel))
	touch $@
wheel: $(VENV)/.wheel-requires | build-packages ## a wheel without Debian's libraries, and the sdist, into build/dist
	@scripts/install_packages.sh dpkg-dev
	scripts/wheel_libraries.sh build/wheel-libraries
	scripts/build_wheel.sh $(BIN)/python build/wheel-libraries build/dist
	$(BIN)/python -m build --sdist --no-isolation --outdir build/dist .
SUITE ?= bookworm
test-wheel: wheel ## as root: the demo by that wheel in a bare Debian with Python and nothing else (SUITE=bookworm)
	@scripts/install_packages.sh debootstrap
	scripts/try_wheel.sh $(SUITE) build/dist $(BIN)/python

cli: | test-packages ## the command without Python, into build/release/cpp/cli
	cmake --preset release -DXCALIB_WERROR=$(WERROR)
	cmake --build --preset release --target xcalib-cli

# From the tests' folder: the package they import is the installed one.
test-python: $(VENV)/.installed $(VENV)/.test-requires cli ## Python tests, on the installed package
	cd tests && ../$(BIN)/python -m pytest -n auto --dist loadfile

test-bad-inputs: $(VENV)/.installed $(VENV)/.test-requires cli ## each bad input on both commands and the Python API
	cd tests && XCALIB_ALL_ROWS=1 ../$(BIN)/python -m pytest -n auto bad_inputs

# -- Figures --------------------------------------------------------------------------------------

.PHONY: bench bench-all bench-docs bench-cpp
BENCH_READY := $(VENV)/.installed $(VENV)/.bench-requires bench-cpp
bench: $(BENCH_READY) ## the published figures, into bench/results (some 15 minutes)
	$(BIN)/python bench/run.py
bench-all: $(BENCH_READY) ## the long benchmarks too (more than an hour)
	$(BIN)/python bench/run.py --all
bench-docs: $(BENCH_READY) ## as bench, and rewrites docs/performance.md by what it finds
	$(BIN)/python bench/run.py --docs
bench-cpp: | bench-packages
	cmake -S . -B build/bench/cpp -G Ninja -DXCALIB_BENCH=ON -DXCALIB_WERROR=$(WERROR)
	cmake --build build/bench/cpp --target xcalib_bench

.PHONY: docs
$(VENV)/.docs-requires: pyproject.toml $(VENV)/.build-requires
	@echo "installing what the site requires"
	@$(PIP) install -q -r <($(call requirements,project optional-dependencies docs))
	touch $@
docs: $(VENV)/.installed $(VENV)/.docs-requires ## the site of docs/, into build/docs
	$(BIN)/sphinx-build -q -W --keep-going -E docs build/docs

format: $(VENV)/.test-requires | test-packages ## rewrite the code in its style
	clang-format -i $(CPP_FILES)
	$(BIN)/ruff check --fix --exit-zero
	$(BIN)/ruff format

stub: $(VENV)/.test-requires $(VENV)/.installed ## copy the docstrings of the C++ module into its stub
	$(BIN)/python scripts/fill_stub.py python/xcalib/_core.pyi
	$(BIN)/ruff format python/xcalib/_core.pyi

clean: ## remove what the targets above made
	rm -rf build dist $(VENV)
