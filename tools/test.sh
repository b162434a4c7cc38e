#!/usr/bin/env bash
# Every test, with all set-up that they need. Arguments go to the test runner.
set -eu
cd "$(dirname "$0")/.."
./tools/setup.sh
export INSONIFY_VALIDATE=1
[ -e ../shared/data ] || echo "skipped: no shared data (tests on real meshes)"
cargo test --features anatomy "$@"
