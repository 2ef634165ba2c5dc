#!/bin/sh
# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
#
# Finds a Chromium for the browser tests, or installs Debian's where that is allowed: the headless
# shell, which is half as large and takes a fifth less of a core. CHROMIUM names another one.
set -eu

fail() { printf '%s\n' "fam_bundle_ros: $*" >&2; exit 1; }

for name in "${CHROMIUM:-}" chromium-headless-shell chromium chromium-browser google-chrome; do
    if [ -n "$name" ] && command -v "$name" >/dev/null 2>&1; then exit 0; fi
done

hint="install one ('sudo apt install chromium') or name it, 'make browser-test CHROMIUM=/path/to/chromium'"
if [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null 2>&1; then
    fail "no Chromium for the browser tests: $hint"
fi
printf '%s\n' 'fam_bundle_ros: installing Chromium (apt-get), about a minute'
log=$(mktemp)
export DEBIAN_FRONTEND=noninteractive
install() { apt-get install -y --no-install-recommends "$1"; }
if ! { apt-get update && { install chromium-headless-shell || install chromium; }; } >"$log" 2>&1; then
    tail -n 3 "$log" >&2
    fail "apt-get could not install Chromium (all it said: $log): $hint"
fi
rm -f "$log"
