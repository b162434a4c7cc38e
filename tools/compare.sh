#!/usr/bin/env bash
# Renders scenes with two builds of insonify in turns and prints how much faster the second is, as
# Markdown: the whole frame and each stage, medians over the rounds.
#   ./tools/compare.sh [-q QUALITY] [-r ROUNDS] [-a ARGUMENT]... OLD NEW SCENE...
#   ./tools/compare.sh -q draft /tmp/old/insonify@804ac2a target/release/insonify scenes/*.toml
# -q  quality of both [default: standard]     -r  rounds that count [default: 5]
# -a  one more argument of both, e.g. -a --set -a simulation.paths=8
# OLD and NEW are programs, PROGRAM@COMMIT where git does not know what a program was built of.
# A round is one run of each, now the one first, now the other. A run shows 40 frames and its median counts: older
# programs make the first of them together, some sixteen where the machine has 24 GB, with the same times for each, and
# kernels are still compiled meanwhile; a first round is not counted at all.
set -euo pipefail

usage() { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 2; }
fail() { echo "tools/compare.sh: $*" >&2; exit 1; }

quality=standard rounds=5 more=()
while getopts q:r:a: option; do
  case $option in
    q) quality=$OPTARG ;;
    r) rounds=$OPTARG ;;
    a) more+=("$OPTARG") ;;
    *) usage ;;
  esac
done
shift $((OPTIND - 1))
[ $# -ge 3 ] || usage
[[ $rounds =~ ^[1-9][0-9]*$ ]] || fail "-r $rounds: how many rounds count, at least 1"
programs=("${1%@*}" "${2%@*}") named=("$1" "$2")
shift 2

# What a program was built of: as told, else the commit of the checkout that it lies in.
commit_of() {
  if [[ $1 == *@* ]]; then echo "${1##*@}"; return; fi
  local folder
  folder=$(dirname "$1")
  git -C "$folder" describe --always --dirty --abbrev=12 2>/dev/null || echo "commit unknown"
}

for program in "${programs[@]}"; do
  [ -x "$program" ] || fail "$program is no program; build one with 'cargo build --release'"
done
for scene in "$@"; do [ -r "$scene" ] || fail "cannot read $scene"; done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Lines "NAME MS" of a report's medians, the frame last.
medians() {
  awk '
    /^  "stages_ms": \{/ { inside = 1; next }
    /^  "frame_ms": \{/ { frame = 1; next }
    /^  \}/ { inside = 0; frame = 0 }
    inside && /^    "/ { split($0, part, "\""); name = part[2] }
    (inside || frame) && /"median":/ {
      value = $2; sub(/,$/, "", value)
      print (frame ? "frame" : name), value
    }' "$1"
}

# Shows a scene by program number $1 into $work/$2.json.
run() {
  "${programs[$1]}" render "$scene" --quality "$quality" --frames 40 "${more[@]}" \
    -o "$work/image.png" --json "$work/$2.json" >"$work/said" 2>&1 \
    || { cat "$work/said" >&2; fail "${programs[$1]} cannot render $scene"; }
}

device="" rows=""
for scene in "$@"; do
  : >"$work/all"
  for ((round = 0; round <= rounds; round++)); do
    order="0 1"
    ((round % 2 == 0)) || order="1 0"
    for which in $order; do
      run "$which" "report"
      if [ -z "$device" ]; then
        device=$(awk -F'"' '/^  "device": \{/ { inside = 1 } /^  \}/ { inside = 0 }
          inside && ($2 == "name" || $2 == "driver") { printf "%s%s", joint, $4; joint = ", " }' "$work/report.json")
      fi
      ((round == 0)) || medians "$work/report.json" | sed "s/^/$which /" >>"$work/all"
    done
  done
  name=$(basename "$scene" .toml)
  rows+=$(awk -v scene="$name" '
    function median(list,   n, v, i, j, t) {
      n = split(list, v, " ")
      for (i = 2; i <= n; i++) for (j = i; j > 1 && v[j - 1] + 0 > v[j] + 0; j--) { t = v[j]; v[j] = v[j - 1]; v[j - 1] = t }
      return n % 2 ? v[(n + 1) / 2] : (v[n / 2] + v[n / 2 + 1]) / 2
    }
    function ms(x) { return x >= 100 ? sprintf("%.0f", x) : x >= 10 ? sprintf("%.1f", x) : sprintf("%.2f", x) }
    !($2 in seen) { seen[$2] = 1; order[++count] = $2 }
    { times[$1, $2] = times[$1, $2] " " $3 }
    function row(stage,   old, new, factor) {
      old = ((0, stage) in times) ? median(times[0, stage]) : -1
      new = ((1, stage) in times) ? median(times[1, stage]) : -1
      factor = old > 0 && new > 0 ? sprintf("%.2f", old / new) : "-"
      printf "| %s | %s | %s | %s | %s |\n", scene, stage, old < 0 ? "-" : ms(old), new < 0 ? "-" : ms(new), factor
    }
    END {
      row("frame")
      for (i = 1; i <= count; i++) if (order[i] != "frame") row(order[i])
    }' "$work/all")$'\n'
done

echo "Quality $quality, medians of $rounds rounds in turns; $device; $(nproc) processors, load $(cut -d' ' -f1-3 /proc/loadavg)."
echo "Old: ${programs[0]}, $(commit_of "${named[0]}"). New: ${programs[1]}, $(commit_of "${named[1]}")."
echo
echo "| scene | stage | old ms | new ms | factor |"
echo "|---|---|---|---|---|"
printf '%s' "$rows"
