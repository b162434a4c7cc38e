#!/usr/bin/env bash
# Builds the Python package as PyPI takes it, for Python 3.10 and newer: target/wheels/insonify-*-manylinux_2_28_*.whl, to
# be installed on every Linux whose C library is of 2018 or newer, whatever the one here is: zig links it.
#   ./tools/wheel.sh
# Needs a Rust toolchain, Python's venv, and PyPI (maturin and zig, into target/wheel-tools).
set -eu
cd "$(dirname "$0")/.."
tools=target/wheel-tools
if [ ! -x $tools/bin/maturin ]; then
  python3 -m venv $tools
  $tools/bin/python -m pip install --quiet --disable-pip-version-check 'maturin[zig]==1.16.0' ziglang==0.17.1 || {
    rm -rf $tools
    echo "tools/wheel.sh: maturin and zig are not to be had: is PyPI within reach?" >&2
    exit 1
  }
fi
PATH=$PWD/$tools/bin:$PATH maturin build --release --zig --compatibility manylinux_2_28 --manifest-path python/Cargo.toml --out target/wheels
