#!/usr/bin/env bash
# Sets up a checkout for `make demo` and `make test`: system libraries, then .venv.  Seconds when nothing has changed.
#
# .venv/.stamp holds a hash of everything the environment was made from.  It is removed before the environment is
# touched and written last, so that one left half-made (Ctrl-C, full disk) is never taken for a finished one.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

TORCH=2.13.0
LIBRARIES=(libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri libglx-mesa0 libusb-1.0-0 libgomp1 libx11-6 libxext6
           xvfb xdotool glslang-tools spirv-tools mesa-vulkan-drivers)

say() { printf 'set-up: %s\n' "$*" >&2; }

# Installs the named packages, or prints the one line to run and stops.
require_packages() {
    local install=(apt-get install -y --no-install-recommends "$@")
    if ! command -v apt-get >/dev/null; then
        say "these packages are missing, install them with your system's package manager: $*"
        exit 2
    fi
    if [[ $(id -u) -ne 0 ]]; then
        say "some system packages are missing; run this line, then the same make command again:"
        echo "sudo apt-get update && sudo ${install[*]}"
        exit 2
    fi
    say "installing $*"
    apt-get update -qq </dev/null
    DEBIAN_FRONTEND=noninteractive "${install[@]}" </dev/null >&2
}

missing_libraries() {
    local package
    for package in "${LIBRARIES[@]}"; do
        [[ $(dpkg-query -W -f '${Status}' "$package" 2>/dev/null) == "install ok installed" ]] || echo "$package"
    done
}

# The first Python from 3.11 to 3.13 that can make a virtual environment.
find_python() {
    local candidate
    for candidate in python3 python3.13 python3.12 python3.11; do
        if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' \
            >/dev/null 2>&1; then
            command -v "$candidate"
            return
        fi
    done
    return 1
}

# What apt offers in its place, where there is none: the default version if it will do, else a numbered one.
python_packages() {
    local version
    for version in "$(apt-cache show python3 2>/dev/null | sed -nE 's/^Version: (3\.[0-9]+)\..*/\1/p' | head -1)" \
        3.13 3.12 3.11; do
        [[ $version =~ ^3\.1[1-3]$ ]] || continue
        if apt-cache show "python$version-venv" >/dev/null 2>&1; then
            echo "python$version python$version-venv"
            return
        fi
    done
}

nvidia_driver() {
    [[ -e /proc/driver/nvidia/version ]] || nvidia-smi >/dev/null 2>&1
}

# A machine without an NVIDIA driver has no use for the gigabytes of CUDA packages torch brings on Linux.
install_torch() {
    local pip=(.venv/bin/python -m pip install -q)
    if nvidia_driver; then
        "${pip[@]}" -c .ci/constraints.txt "torch==$TORCH"
    elif .venv/bin/python -c "import torch, sys; sys.exit(torch.__version__.split('+')[0] != '$TORCH')" 2>/dev/null; then
        :
    elif "${pip[@]}" --no-deps "torch==$TORCH+cpu" 2>/dev/null; then  # from a configured index or find-links
        :
    elif "${pip[@]}" --no-deps --timeout 20 --retries 1 --index-url https://download.pytorch.org/whl/cpu \
        "torch==$TORCH" 2>/dev/null; then
        :
    else
        say "no CPU build of torch within reach, installing the standard one"
        "${pip[@]}" -c .ci/constraints.txt "torch==$TORCH"
    fi
}

main() {
    exec 9<.ci/setup.sh
    flock 9  # two make commands at once: the second waits for the first

    if command -v dpkg-query >/dev/null; then
        local missing
        mapfile -t missing < <(missing_libraries)
        [[ ${#missing[@]} -eq 0 ]] || require_packages "${missing[@]}"
    fi

    local wanted extras=dev
    if nvidia_driver; then
        extras=dev,cuda  # OpenGL's buffers are mapped into CUDA there, and that is tested
    fi
    wanted=$(cat pyproject.toml .ci/constraints.txt .ci/setup.sh viewer/__init__.py .ci/package.py <(pwd) <(echo "$extras") | sha256sum |
        cut -d' ' -f1)
    if [[ $(cat .venv/.stamp 2>/dev/null) == "$wanted" ]] && .venv/bin/python -c '' 2>/dev/null; then
        return
    fi

    if [[ ! -e .venv/.stamp ]] || ! .venv/bin/python -c '' 2>/dev/null; then
        rm -rf .venv
        local python
        if ! python=$(find_python); then
            local offered
            offered=$(python_packages)
            if [[ -z $offered ]]; then
                say "needs Python 3.11, 3.12 or 3.13 with its venv module, and found none"
                exit 2
            fi
            # shellcheck disable=SC2086  # two words on purpose
            require_packages $offered
            python=$(find_python) || { say "needs Python 3.11, 3.12 or 3.13 with its venv module"; exit 2; }
        fi
        say "making .venv with $python (the first time takes minutes)"
        "$python" -m venv .venv
    fi
    rm -f .venv/.stamp
    install_torch
    .venv/bin/python -m pip install -q -c .ci/constraints.txt -e ".[$extras]"
    say "compiling numba's loops (two minutes)"
    .venv/bin/python -m pointglass.viewer.compile_kernels
    echo "$wanted" >.venv/.stamp
    say "done"
}

main "$@" </dev/null
