#!/usr/bin/env bash
# Measures this machine with programs that are already built: Tables I to III of the paper, raysim's
# setting, structure builds, every kernel against its twin, the stages of every scene at 8, 32 and 128
# paths with bytes and operations, latency. Writes measure.json and measure.md.
#   ./tools/measure.sh [--quick] [--device NAME] [--programs DIR] [-o DIR]
# --quick     for a software driver: fewer scenes, paths and frames, some two minutes
# --device    which Vulkan device, by part of its name or index
# --programs  folder with insonify, kernels and profile [default: target/release]
# -o          where to [default: target/measure]
# Needs bash, those three programs, scenes/ and tools/raysim.toml; no compiler, no network. Every part has
# its own time limit, 8 minutes in all; one that fails is reported on the page, and the exit code is 1.
set -uo pipefail
cd "$(dirname "$0")/.."

quick=0 programs=target/release out=target/measure device=()
while [ $# -gt 0 ]; do
  case $1 in
    --quick) quick=1 ;;
    --device | --programs | -o)
      [ $# -ge 2 ] || { echo "tools/measure.sh: $1 needs a value" >&2; exit 2; }
      case $1 in
        --device) device=(--device "$2") ;;
        --programs) programs=$2 ;;
        -o) out=$2 ;;
      esac
      shift ;;
    *) sed -n '2,13s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
  esac
  shift
done
for program in insonify kernels profile; do
  [ -x "$programs/$program" ] || {
    echo "tools/measure.sh: no $programs/$program; build with 'cargo build --release', or say --programs DIR" >&2
    exit 2
  }
done
[ -d scenes ] || { echo "tools/measure.sh: no folder scenes/ beside tools/" >&2; exit 2; }
parts=$out/parts
rm -rf "$parts"
mkdir -p "$parts" || exit 2

names=() states=() seconds=() failed=0
# part NAME LIMIT COMMAND...: runs it, keeps what it prints, says how it ended.
part() {
  local name=$1 limit=$2 began=$SECONDS status=0
  shift 2
  echo "measure: $name" >&2
  timeout -k 10 "$limit" "$@" >"$parts/$name.txt" 2>"$parts/$name.err" || status=$?
  case $status in
    0) states+=("done") ;;
    124 | 137) states+=("cut off after $limit s"); failed=1 ;;
    *) states+=("failed with exit code $status"); failed=1 ;;
  esac
  names+=("$name")
  seconds+=($((SECONDS - began)))
}
profile() { # NAME LIMIT ARGUMENT...
  local name=$1 limit=$2
  shift 2
  part "$name" "$limit" "$programs/profile" "${device[@]}" -o "$parts" "$@"
}

scenes=(scenes/phantom.toml scenes/abdomen.toml scenes/heart.toml scenes/fetus.toml scenes/pregnancy.toml scenes/limbs.toml)
paper=(paper --fetus scenes/pregnancy.toml --heart scenes/heart.toml)
part device 10 "$programs/insonify" info
if [ $quick = 1 ]; then
  small=(--set probe.scanlines=48 --set probe.elevation_layers=3 --set probe.samples=1024)
  part kernels 30 "$programs/kernels" "${device[@]}" run beam
  profile paper 60 --tracer bvh "${paper[@]}" --frames 1 --poses 2 --rounds 1 "${small[@]}"
  profile raysim 30 --tracer bvh stages tools/raysim.toml --paths 1 --frames 1 --name raysim
  profile builds 20 builds --subdivisions 4,5
  profile stages 60 --tracer bvh stages scenes/phantom.toml scenes/pregnancy.toml --paths 8 --frames 1 "${small[@]}"
else
  part kernels 60 "$programs/kernels" "${device[@]}" check
  profile paper 100 "${paper[@]}" --frames 5 --poses 12 --rounds 2
  profile raysim 30 stages tools/raysim.toml --paths 1,32 --frames 9 --name raysim
  profile builds 40 builds
  for scene in "${scenes[@]}"; do
    name=$(basename "$scene" .toml)
    profile "stages-$name" 38 stages "$scene" --paths 8,32,128 --frames 5 --name "stages-$name"
  done
fi

# Text as a JSON string.
quoted() {
  local text=$1
  text=${text//\\/\\\\}
  text=${text//\"/\\\"}
  text=${text//$'\n'/\\n}
  text=${text//$'\t'/\\t}
  text=${text//$'\r'/}
  printf '"%s"' "${text//$'\e'/}"
}

load=$(cut -d' ' -f1-3 /proc/loadavg 2>/dev/null || echo unknown)
{
  printf '{\n"load": %s, "processors": %s, "quick": %s,\n"parts": {' "$(quoted "$load")" "$(nproc)" $quick
  comma=""
  for i in "${!names[@]}"; do
    name=${names[i]}
    printf '%s\n%s: {"state": %s, "seconds": %s, "said": %s, "figures": ' "$comma" "$(quoted "$name")" \
      "$(quoted "${states[i]}")" "${seconds[i]}" "$(quoted "$(cat "$parts/$name.txt" "$parts/$name.err")")"
    if [ -s "$parts/$name.json" ]; then cat "$parts/$name.json"; else printf 'null'; fi
    printf '}'
    comma=","
  done
  printf '\n}\n}\n'
} >"$out/measure.json"
{
  echo "# Measured"
  echo
  echo "$(nproc) processors, load $load, $(date -u +%Y-%m-%d)."
  [ $quick = 0 ] || echo "Quick: small frames, to try the parts rather than to compare."
  echo
  echo "| part | state | s |"
  echo "|---|---|---|"
  for i in "${!names[@]}"; do echo "| ${names[i]} | ${states[i]} | ${seconds[i]} |"; done
  for i in "${!names[@]}"; do
    name=${names[i]}
    printf '\n## %s\n\n' "$name"
    case $name in
      # Plain lines; of the kernels' comparisons only those that are wrong.
      device) printf '```\n%s\n```\n' "$(cat "$parts/$name.txt")" ;;
      kernels)
        printf '```\n%s\n```\n%s comparisons, %s wrong.\n' \
          "$(awk '!/compared,/ && NR == 1; /WRONG/; /^[a-z_]+: .* ms, fastest/' "$parts/$name.txt")" \
          "$(grep -c 'compared,' "$parts/$name.txt")" "$(grep -c WRONG "$parts/$name.txt")" ;;
      *) grep -v '\.\(json\|csv\|svg\)$' "$parts/$name.txt" ;;
    esac
    if [ "${states[i]}" != "done" ]; then
      printf '\n%s:\n```\n%s\n```\n' "${states[i]}" "$(tail -n 20 "$parts/$name.err")"
    fi
  done
} >"$out/measure.md"
echo "$out/measure.md"
echo "$out/measure.json"
exit $failed
