#!/usr/bin/env bash
# Makes the figures of Starkov et al. 2019 that show images (2, 10 to 16) from the shipped scenes, and a clip like its
# supplementary one: pictures, and a page that shows them with captions.
#   tools/figures.sh [-o DIR] [-q QUALITY] [-p PROGRAM]
# DIR: target/figures; QUALITY: draft, standard or reference, default the scenes' own; PROGRAM: a built insonify, default
# is to build it. About six minutes on two cores without a GPU.
set -eu
cd "$(dirname "$0")/.."
out=target/figures program="" quality=()
while getopts o:q:p: option; do
  case $option in
  o) out=$OPTARG ;;
  q) quality=(--quality "$OPTARG") ;;
  p) program=$OPTARG ;;
  *) sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
  esac
done
if [ -z "$program" ]; then
  cargo build --release --bin insonify
  program=target/release/insonify
fi
mkdir -p "$out"
page=$out/index.html
scenes=$(cd scenes && pwd)

insonify() { echo "insonify $*" >&2; "$program" "$@" "${quality[@]}"; }
heading() { printf '<h2>%s</h2>\n<p>%s</p>\n' "$1" "$2" >>"$page.part"; }
picture() { printf '<figure><img src="%s" alt=""><figcaption>%s</figcaption></figure>\n' "$1" "$2" >>"$page.part"; }
# Renders SCENE into NAME.png with CAPTION.
shot() { # SCENE NAME CAPTION ARGUMENT...
  local scene=$1 name=$2 caption=$3
  shift 3
  insonify render "$scene" -o "$out/$name.png" "$@" >/dev/null
  picture "$name.png" "$caption"
}

cat >"$page.part" <<'HTML'
<!doctype html><meta charset="utf-8"><title>Figures</title>
<style>body{background:#111;color:#ddd;font:15px sans-serif;margin:2em}figure{display:inline-block;margin:0 1em 1em 0;vertical-align:top}
img{max-height:420px;max-width:100%}figcaption{color:#aaa}</style>
<h1>The paper's figures, by our scenes</h1>
HTML

# The fetus alone, without contact, so that the probe can look from the side.
sed -e '/^\[contact\]/,/^$/d' -e "s|file = \"fetus/|file = \"$scenes/fetus/|" scenes/fetus.toml >"$out/fetus.toml"
{
  cat "$out/fetus.toml"
  printf '\n[volume]\nfile = "fetus.mha"\n[fusion]\nmask = ["elsewhere"]\n'
  printf '[[mesh]]\nname = "elsewhere"\nshape = { sphere = { radius = 1, subdivisions = 1 } }\ntissue = "water"\ntranslate = [0, 900, 0]\n'
} >"$out/slice.toml"
# About the middle of the fetus, a quarter turn in the image plane.
side=(--set 'probe.pose.position=[72.5, 0, 71.5]' --set 'probe.pose.direction=[-1, 0, 0]' --set 'probe.pose.lateral=[0, 0, 1]')
heading "Figure 2" "What a view depends on: simulated from the front and from the side, and from the side by a slice of a volume that was acquired from the front, whose shadows and speckle stay as they were."
insonify acquire "$out/fetus.toml" --sweep linear:6mm --frames 7 --spacing 0.3,1,0.2 --volume "$out/fetus.mha" >/dev/null
shot "$out/fetus.toml" 2-front "0 degrees"
shot "$out/fetus.toml" 2-side "90 degrees, simulated" "${side[@]}"
shot "$out/slice.toml" 2-slice "90 degrees, a slice of the volume acquired at 0" "${side[@]}"

heading "Figures 10 and 12" "Steps of a fusion."
insonify vary scenes/pregnancy.toml --show steps -o "$out/10-steps.png" >/dev/null
picture 10-steps.png "volume, simulation, mask, composition, blurred mask, fused image"

heading "Figure 11" "Surroundings of what is simulated."
insonify vary scenes/pregnancy.toml --show surroundings -o "$out/11-surroundings.png" >/dev/null
picture 11-surroundings.png "acquired volume, none, the scene's own scatterers"

heading "A real volume" "Fusion with a volume that nobody simulated: a freehand sweep over a spine phantom (PLUS toolkit)."
if [ -e ../shared/data ]; then
  shot tests/scenes/fusion.toml 12-phantom "a sac in the phantom's volume"
else
  echo "skipped: no shared data (fusion with a real volume)" >&2
  echo '<p>Its data are not on this machine.</p>' >>"$page.part"
fi

heading "Figure 13" "Frequencies: a second pregnancy, of eight weeks."
for f in 5 7 9; do
  shot scenes/early.toml "13-$f-mhz" "$f MHz" --set "probe.frequency=$f MHz"
done

heading "Figure 14" "An ectopic pregnancy, with each of the surroundings."
insonify vary scenes/ectopic.toml --show surroundings -o "$out/14-surroundings.png" >/dev/null
picture 14-surroundings.png "acquired volume, none, the scene's own scatterers"

heading "Figure 15" "Transform nodes: a fetus at rest, and moved."
shot scenes/fetus.toml 15-nominal "nominal" --time 0
shot scenes/fetus.toml 15-moved "after 3.2 s" --time 3.2

heading "Figure 16" "A selector node: the heart in four of its keyframes."
for t in 0 160 320 480; do
  shot scenes/heart.toml "16-$t-ms" "$t ms" --time "$t ms"
done

heading "Palpation" "Transform nodes that scale: an artery and a vein, at rest and pressed."
shot scenes/artery.toml 17-rest "0 s" --time 0
shot scenes/artery.toml 17-pressed "2.5 s" --time 2.5

heading "Supplementary clip" "A moving probe over moving anatomy, fused with an acquired volume."
# Eight seconds: to the side and back, tilted on the way. The quaternion is that of the tilt about the lateral axis.
awk 'BEGIN { print "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz"
  for (i = 0; i <= 32; ++i) { p = 6.2831853 * i / 32; a = 0.06 * sin(p)
    printf "%.3f,%.4f,%.4f,0,%.6f,%.6f,0,0\n", i / 8, 6 * sin(p), 4 * sin(p), cos(a / 2), sin(a / 2) } }' >"$out/clip.csv"
insonify render scenes/pregnancy.toml --trajectory "$out/clip.csv" --fps 8 --set imaging.image_height=420 -o "$out/clip.gif" >/dev/null
picture clip.gif "scenes/pregnancy.toml along clip.csv"

mv "$page.part" "$page"
echo "$page"
