#!/usr/bin/env bash
# Tests of the Python package: makes a virtual environment in target/python with what they need (from PyPI), builds
# the module with the features of the other tests, and runs pytest. Arguments go to pytest.
#   ./tools/python.sh -k labels
# Exit code 1 too where that environment cannot be made.
# FEATURES  features of the build, as of the other tests [default: none]
set -eu
cd "$(dirname "$0")/.."
python=target/python/bin/python
packages=(numpy==2.4.6 pytest==9.2.0 pytest-xdist==3.8.0 mypy==2.4.1 ray==2.60.0 gymnasium==1.4.0 h5py==3.16.0 webdataset==1.0.2 pyuff_ustb==3.0.0 matplotlib tqdm)
wanted=target/python/packages.txt
if [ ! -f "$wanted" ] || [ "$(cat "$wanted")" != "${packages[*]}" ]; then
  made() {
    python3 -m venv target/python && "$python" -m pip install --quiet --disable-pip-version-check "${packages[@]}"
  }
  if ! made; then
    lacking="a virtual environment with ${packages[*]} (is PyPI within reach, and Debian's python3-venv there?): tests of the Python package are not run"
    echo "tools/python.sh: lacks $lacking" >&2
    [ -z "${INSONIFY_LACKS:-}" ] || echo "$lacking" >>"$INSONIFY_LACKS"
    exit 1
  fi
  echo "${packages[*]}" >"$wanted"
fi
# One set of features with the other tests: only the module itself is built anew, and the program that its tests compare it with.
cargo build --features "${FEATURES:-}" --lib --bin insonify
cp target/debug/lib_insonify.so python/insonify/_insonify.abi3.so
"$python" -m mypy --no-error-summary --cache-dir target/mypy python/insonify
PYTHONPATH=$PWD/python "$python" -m pytest -q -rfEs -n auto -p no:cacheprovider python/tests "$@"
