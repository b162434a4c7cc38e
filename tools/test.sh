#!/usr/bin/env bash
# Every test, with all set-up that they need, but for those that compile kernels: `--features compile`
# adds them, with SHADERC_LIB_DIR set as in .ci/run; and those of the modeller of the shipped anatomy, whose 30 packages nothing
# else needs, and the program that makes a page of the physics checks: `--features anatomy,validate`. As the first argument, `--long` adds these, and the tests
# that take minutes or need a quiet machine: statistics over many seeds, physics by both tracers, every kernel on a second
# driver in every case, how little the processor does for a window at rest. Other arguments go to `cargo test`; those of the Python package (tools/python.sh) follow unless the
# arguments choose tests.
#
# The last lines say, a line each, which programs passed, failed or died and how long they took, which tests were
# skipped and why, and what could not be reached. A program that dies does not hide the others.
# Exit code: 0, all passed; 1, something failed or died; 2, nothing failed, but something that the tests
# need could not be had, so that this is no pass.
#
# With INSONIFY_NO_SKIP=1 tests without what they need fail instead of being skipped, but for those on data that do
# not ship; with INSONIFY_NO_SKIP=all these fail, too.
set -eu
cd "$(dirname "$0")/.."
started=$SECONDS
long=() features=
if [ "${1:-}" = --long ]; then
  shift
  features=anatomy,validate
  long=(--include-ignored)
  # Physics by both tracers (tests/physics/check.rs), the second driver on every case (tools/tests/kernels.rs).
  export INSONIFY_LONG=1
fi
mkdir -p target/report
report=$PWD/target/report
rm -f "$report"/*
# Where set-up and tests write what they lack and skip.
export INSONIFY_LACKS=$report/lacks INSONIFY_SKIPPED=$report/skipped
: >"$INSONIFY_LACKS"
: >"$INSONIFY_SKIPPED"
./tools/setup.sh
set_up=$((SECONDS - started))
export INSONIFY_VALIDATE=1
# As the program itself has it (src/gpu/process.rs), in the program's own folder; .cargo/config.toml has the same for
# `cargo test` alone, in target/.
if [ -z "${LP_NATIVE_VECTOR_WIDTH:-}${MESA_SHADER_CACHE_DIR:-}" ]; then
  export LP_NATIVE_VECTOR_WIDTH=128 MESA_SHADER_CACHE_DIR=${XDG_CACHE_HOME:-$HOME/.cache}/insonify/mesa
  mkdir -p "$MESA_SHADER_CACHE_DIR"
fi
# Tests of the window wait for it more than they compute: at least four at once.
threads=$(nproc)
export RUST_TEST_THREADS=${RUST_TEST_THREADS:-$((threads < 4 ? 4 : threads))}
[ -e ../shared/data ] || echo "no shared data (tests on real meshes)" >>"$INSONIFY_SKIPPED"

arguments=() chosen=
while [ $# -gt 0 ]; do
  case $1 in
  --features) features=${features:+$features,}$2 && shift 2 ;;
  --no-fail-fast) shift ;;
  --) shift && long+=("$@") && chosen=1 && break ;;
  *) arguments+=("$1") && chosen=1 && shift ;;
  esac
done
# Passes lines on as they come, each test with its number of how many. Not awk: Debian's waits for 4 kB of them.
numbered() {
  local line of=0 n=0
  while IFS= read -r line || [ -n "$line" ]; do
    case $line in
    "running "*" test" | "running "*" tests") of=${line#running } of=${of%% *} n=0 ;;
    "test "*" ... "*) n=$((n + 1)) && printf '[%*d/%d] ' ${#of} $n "$of" ;;
    esac
    printf '%s\n' "$line"
  done
}
# Runs a command, with its output in a file of the report too. Returns its exit code.
reported() {
  local file=$report/$1 && shift
  "$@" 2>&1 | tee "$file" | numbered
  return "${PIPESTATUS[0]}"
}
# A program that dies leaves its memory behind where the system writes that into the folder.
[ "$(cat /proc/sys/kernel/core_pattern 2>/dev/null)" != core ] || [ -e core ] || ulimit -c unlimited || true
code=0
begun=$SECONDS
reported build cargo test --features "$features" --no-run "${arguments[@]}" || code=1
built=$((SECONDS - begun)) begun=$SECONDS
[ "$code" != 0 ] || reported tests cargo test --features "$features" --no-fail-fast "${arguments[@]}" -- "${long[@]}" || code=1
tested=$((SECONDS - begun)) begun=$SECONDS
if [ -z "$chosen" ] && ! FEATURES=$features reported python ./tools/python.sh; then
  # Not where its packages could not be had.
  grep -q "tests of the Python package" "$INSONIFY_LACKS" || code=1
fi
python=$((SECONDS - begun))

# The threads of the last program that died.
died=$(sed -nE "s/^  process didn't exit successfully: \`([^ \`]+).*\(.*SIG.*/\1/p" "$report"/tests 2>/dev/null | tail -1)
if [ "$(ulimit -c)" = unlimited ] && [ -e core ]; then
  [ -z "$died" ] || ! command -v gdb >/dev/null ||
    gdb -nx -batch -ex "thread apply all backtrace 24" "$died" core 2>/dev/null | tail -n 600 | tee "$report"/threads
fi
# Also those of tests in which a process dies on purpose, which run in their crate's folder.
[ "$(ulimit -c)" != unlimited ] || find core src tools -maxdepth 2 -name core -type f -delete 2>/dev/null || true

echo
echo "==== summary ===="
cat "$report"/build "$report"/tests "$report"/python 2>/dev/null | awk -f tools/summary.awk || code=1
sort "$INSONIFY_SKIPPED" | uniq -c | sed -E 's/^ *([0-9]+) (.*)/skipped \1 times: \2/'
sort -u "$INSONIFY_LACKS" | sed 's/^/lacking /'
echo "times   set-up $set_up s, build $built s, tests $tested s, Python $python s"
if [ "$code" = 0 ] && [ -s "$INSONIFY_LACKS" ]; then
  echo "result  NOT COMPLETE: what is lacking was not tested"
  exit 2
fi
[ "$code" = 0 ] && echo "result  passed" || echo "result  FAILED"
exit "$code"
