#!/usr/bin/env bash
# Every test, with all set-up that they need, but for those that compile kernels: `--features compile`
# adds them, with SHADERC_LIB_DIR set as in .ci/run. As the first argument, `--long` adds the tests
# that take minutes or need a quiet machine: statistics over many seeds, how little the processor does for a
# window at rest. Other arguments go to `cargo test`; those of the Python package (tools/python.sh) follow unless the
# arguments choose tests.
#
# Where something is missing, tests say that they are skipped, which `cargo test` shows with `-- --nocapture` only.
# With INSONIFY_NO_SKIP=1 they fail instead, but for those on data that do not ship; with INSONIFY_NO_SKIP=all
# these fail, too.
set -eu
cd "$(dirname "$0")/.."
long=()
if [ "${1:-}" = --long ]; then
  shift
  long=(--include-ignored)
fi
./tools/setup.sh
export INSONIFY_VALIDATE=1
# As the program itself has it (src/gpu/process.rs): llvmpipe compiles in a third of the time.
if [ -z "${LP_NATIVE_VECTOR_WIDTH:-}${MESA_SHADER_CACHE_DIR:-}" ]; then
  export LP_NATIVE_VECTOR_WIDTH=128 MESA_SHADER_CACHE_DIR=${XDG_CACHE_HOME:-$HOME/.cache}/insonify/mesa
  mkdir -p "$MESA_SHADER_CACHE_DIR"
fi
# Tests of the window wait for it more than they compute: at least four at once.
threads=$(nproc)
export RUST_TEST_THREADS=${RUST_TEST_THREADS:-$((threads < 4 ? 4 : threads))}
[ -e ../shared/data ] || echo "skipped: no shared data (tests on real meshes)"
failed=0
if [ ${#long[@]} -eq 0 ]; then
  cargo test --features anatomy "$@" || failed=$?
else
  case " $* " in
  *" -- "*) cargo test --features anatomy "$@" "${long[@]}" || failed=$? ;;
  *) cargo test --features anatomy "$@" -- "${long[@]}" || failed=$? ;;
  esac
fi
features=anatomy
while [ $# -gt 0 ]; do
  case $1 in
  --features) features=anatomy,$2 && shift 2 ;;
  --no-fail-fast) shift ;;
  *) exit "$failed" ;;
  esac
done
FEATURES=$features ./tools/python.sh || failed=$?
exit "$failed"
