#!/bin/sh
# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
#
# Makes a virtual environment with the pinned requirements and this package (editable), or
# leaves one alone that is complete and up to date.
#
#   scripts/venv.sh FOLDER            the pins of requirements.txt
#   scripts/venv.sh FOLDER ubuntu     numpy, scipy, ... as Ubuntu 24.04 ships them, no numba
#   scripts/venv.sh FOLDER docs       the same as without, and docs/requirements.txt
#   scripts/venv.sh FOLDER mutants    the same as without, and scripts/mutants.txt
#
# PYTHON names the interpreter; without it the first that works is taken. With ROS_DISTRO set
# (ROS sourced) that ROS is used: its Python, its rclpy, and Ubuntu's numpy, for which the
# messages of ROS are compiled.
#
# The stamp file is written last. It tells a complete environment from one whose making was
# interrupted, and holds what the environment was made from.
set -eu

venv=$1
flavour=${2:-newest}
purpose=$flavour
if [ -n "${ROS_DISTRO:-}" ]; then flavour=ubuntu; fi
stamp=$venv/.complete
log=$venv/install.log

say() { printf '%s\n' "fam_bundle_ros: $*"; }
fail() { printf '%s\n' "fam_bundle_ros: $*" >&2; exit 1; }

# The interpreter below a virtual environment: the one that is about to be replaced may be active.
base='import sys; print(getattr(sys, "_base_executable", sys.executable))'
right_version='import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))'

# Interpreters are chosen by running them: a name on PATH may be a shim that does not start.
find_python() {
    if [ -n "${PYTHON:-}" ]; then
        candidates=$PYTHON
    elif [ -n "${ROS_DISTRO:-}" ]; then
        candidates='python3 python3.12 python3.11'
    else
        candidates='python3.12 python3.11 python3'
    fi
    without_venv=''
    for candidate in $candidates; do
        "$candidate" -c "$right_version" 2>/dev/null || continue
        if "$candidate" -c 'import ensurepip, venv' 2>/dev/null; then
            "$candidate" -c "$base"
            return
        fi
        without_venv=${without_venv:-$candidate}
    done
    if [ -n "$without_venv" ]; then
        name=$("$without_venv" -c 'import sys; print("python3.%d" % sys.version_info[1])')
        fail "$without_venv cannot make virtual environments: run 'sudo apt install $name-venv'" \
            "and then make again"
    fi
    found=$("${PYTHON:-python3}" -V 2>/dev/null) || found='none that runs'
    fail "Python 3.11 or 3.12 is needed, found ${found}: install one (on Ubuntu 24.04 'sudo apt" \
        "install python3.12-venv', on Debian 12 'sudo apt install python3.11-venv')" \
        "or name it, 'make PYTHON=/path/to/python3.12'"
}

# One line for the user instead of pip's many; the log keeps them all.
pip_install() {
    if "$venv/bin/python" -m pip install --disable-pip-version-check --no-input \
        --retries 2 --timeout 30 "$@" >>"$log" 2>&1; then
        return
    fi
    if grep -qiE 'NewConnectionError|ConnectTimeout|ReadTimeout|ProxyError|Max retries|name resolution|No space left' "$log"; then
        if grep -q 'No space left' "$log"; then fail "the disk is full: free some space and run make again"; fi
        fail "pip cannot reach the package index: check the network, proxy or PIP_INDEX_URL and" \
            "run make again (details: $log)"
    fi
    grep -v WARNING "$log" | tail -n 5 >&2
    fail "pip failed: see the lines above and $log, then run make again"
}

# uv installs in seconds what takes pip a minute. It does not read pip's configuration: a user
# who has an index of their own gets pip, and so does one whose network uv cannot pass.
quick_install() {
    case $("$venv/bin/python" -m pip config list) in *.index-url=*) return 1 ;; esac
    "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --retries 0 \
        --timeout 30 "$(grep '^uv==' requirements.txt)" >>"$log" 2>&1 &&
        "$venv/bin/uv" pip install --python "$venv/bin/python" "$@" >>"$log" 2>&1
}

# The pins of requirements.txt, or of a further file where that has one for the same package.
pins() {
    further=/dev/null
    if [ "$flavour" = ubuntu ]; then further="$further requirements-ubuntu.txt"; fi
    if [ "$purpose" = docs ]; then further="$further docs/requirements.txt"; fi
    if [ "$purpose" = mutants ]; then further="$further scripts/mutants.txt"; fi
    # shellcheck disable=SC2086
    names=$(cat $further | sed -n 's/^\([A-Za-z0-9_.-]*\)==.*/^\1==/p')
    # shellcheck disable=SC2086
    { grep -viE "$(printf '%s' "${names:-^$}" | tr '\n' '|')" requirements.txt; cat $further; } |
        # Without numba, which nothing needs: the tests with Ubuntu's packages show that.
        if [ "$flavour" = ubuntu ]; then grep -vE '^(numba|llvmlite)=='; else cat; fi |
        if [ -n "${ROS_DISTRO:-}" ]; then grep -v '^ros-'; else cat; fi
}

made_from="$PWD/$venv, ROS: ${ROS_DISTRO:-wheels}, \
$(pins | cat - setup.py setup.cfg scripts/venv.sh | cksum)"

# A complete environment keeps its interpreter unless the user names another.
if [ -f "$stamp" ] && [ "$(sed 1q "$stamp")" = "$made_from" ] &&
    { [ -z "${PYTHON:-}" ] || [ "$(sed -n 2p "$stamp")" = "$("$PYTHON" -c "$base")" ]; } &&
    "$venv/bin/python" -c 'import numpy' 2>/dev/null; then
    exit 0
fi

python=$(find_python)
version=$("$python" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])')
# Before anything is removed or made.
has_rclpy='import importlib.util, sys; sys.exit(importlib.util.find_spec("rclpy") is None)'
if [ -n "${ROS_DISTRO:-}" ] && ! "$python" -c "$has_rclpy"; then
    fail "ROS_DISTRO is $ROS_DISTRO but $python finds no rclpy:" \
        "source /opt/ros/$ROS_DISTRO/setup.sh, or 'unset ROS_DISTRO' to use wheels"
fi
if [ -f "$stamp" ]; then
    say "$venv is damaged or was made from other pins: making it again"
elif [ -f "$venv/pyvenv.cfg" ] || [ -f "$log" ] || [ -d "$venv/bin" ]; then
    say "$venv is half made (an install was interrupted or failed): making it again"
elif [ -e "$venv" ] && ! rmdir "$venv" 2>/dev/null; then
    fail "$venv is in the way and is no virtual environment: move it away and run make again"
fi
rm -rf "$venv"
mkdir "$venv"

say "making $venv with $python ($version)"
system=''
if [ -n "${ROS_DISTRO:-}" ]; then
    system=--system-site-packages
    say "using ROS 2 $ROS_DISTRO as sourced, no rclpy wheels"
fi
"$python" -m venv $system "$venv" >"$log" 2>&1 || {
    tail -n 3 "$log" >&2
    fail "$python could not make $venv: see the lines above, then run make again"
}

pins >"$venv/pins.txt"
say "installing $(grep -c == "$venv/pins.txt") pinned packages, up to two minutes (log: $log)"
quick_install -r "$venv/pins.txt" || pip_install -r "$venv/pins.txt"
say "installing fam_bundle_ros"
pip_install --no-deps --no-build-isolation --editable .
# What numba compiles is kept in the user's cache: the first run of a user need not wait for it.
if ! "$venv/bin/fam_bundle" bench --warm >>"$log" 2>&1; then
    say "the compiled code could not be prepared, the first run will be slower (see $log)"
fi
printf '%s\n' "$made_from" "$python" >"$stamp"
say "$venv is ready"
