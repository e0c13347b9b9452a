#!/bin/sh
# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

# Prints the Python of the environment, 3.11 or 3.12, or an error message.
# usage: choose_python.sh [PYTHON [EXISTING]]; a named Python that does not fit is an error, or if
# the Python of an existing environment has another version.
works() {
    "$1" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' \
        >/dev/null 2>&1
}
if [ -n "${1:-}" ]; then
    if works "$1"; then
        if [ -x "${2:-}" ] && [ "$("$1" --version)" != "$("$2" --version)" ]; then
            echo "PYTHON=$1: $("$1" --version); $2 is $("$2" --version). Run make clean first." >&2
            exit 1
        fi
        echo "$1"
        exit 0
    fi
    version=$("$1" --version 2>&1) || version='it cannot be run'
    echo "PYTHON=$1: $version; expected Python 3.11 or 3.12 with venv." >&2
    exit 1
fi
for candidate in python3.12 python3.11 python3; do
    if works "$candidate"; then
        echo "$candidate"
        exit 0
    fi
done
version=$(python3 --version 2>&1 || echo 'no python3')
echo "masmc_ros needs Python 3.11 or 3.12 with venv; found $version." >&2
echo "Install it (Debian, Ubuntu: apt install python3-venv) or name it: make PYTHON=/path/to/python3.12" >&2
exit 1
