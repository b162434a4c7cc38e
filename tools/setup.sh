#!/usr/bin/env bash
# Installs what insonify needs and this machine lacks, and says what it installs. Idempotent, asks
# nothing. `setup.sh run` is enough to render and, where there is a display, for the window; without
# an argument it adds what the tests need (validation layers, spirv-val, a virtual display) and what
# compiling kernels needs.
set -eu
mode=${1:-test}

say() { printf 'setup: %s\n' "$*" >&2; }

# Says what could not be had, also at the end of tools/test.sh: it is not this system's lack, but a source out of reach.
lacks() {
  say "$*"
  [ -z "${INSONIFY_LACKS:-}" ] || printf '%s\n' "$*" >>"$INSONIFY_LACKS"
}

manual() {
  say "$1"
  say "install by hand, then run this again:"
  say "  a C compiler and linker (cc), pkg-config and libudev with its header (libudev-dev), the Vulkan loader (libvulkan.so.1),"
  say "  a Vulkan driver (your GPU's, or Mesa's lavapipe, 25 or newer for ray query)"
  say "  for the window: libX11, libX11-xcb, libXcursor, libXi, libXrandr, libxkbcommon, libxkbcommon-x11"
  [ "$mode" = run ] || say "  the Khronos validation layers, SPIRV-Tools (spirv-val), Xvfb, cmake, a C++ compiler, Python 3"
  exit 1
}

command -v cargo >/dev/null || manual "no Rust toolchain: install one first (rustup, Rust 1.95 or newer)"

# Whether one of these files exists: `ls` would want all.
any() {
  local file
  for file; do [ -e "$file" ] && return; done
  return 1
}
has_library() { ldconfig -p 2>/dev/null | grep -q "$1"; }
# A driver is a manifest whose library can be loaded; NVIDIA's and Mesa's land in these folders.
has_driver() {
  [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && return 0
  any /etc/vulkan/icd.d/*.json /usr/share/vulkan/icd.d/*.json /usr/local/share/vulkan/icd.d/*.json
}

want=()
command -v cc >/dev/null || want+=(gcc libc6-dev)
# Game pads: what the program is linked with.
command -v pkg-config >/dev/null || want+=(pkg-config)
pkg-config --exists libudev 2>/dev/null || want+=(libudev-dev)
has_library libvulkan.so.1 || want+=(libvulkan1)
# The window's libraries are opened at run time; every desktop has them, a bare server has not.
if [ "$mode" != run ] || [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
  for pair in libX11.so.6:libx11-6 libX11-xcb.so.1:libx11-xcb1 libXcursor.so.1:libxcursor1 libXi.so.6:libxi6 \
    libXrandr.so.2:libxrandr2 libxkbcommon.so.0:libxkbcommon0 libxkbcommon-x11.so.0:libxkbcommon-x11-0; do
    has_library "${pair%%:*}" || want+=("${pair#*:}")
  done
fi
if [ "$mode" != run ]; then
  command -v Xvfb >/dev/null || want+=(xvfb)
  any /usr/share/vulkan/explicit_layer.d/*validation*.json /etc/vulkan/explicit_layer.d/*validation*.json || want+=(vulkan-validationlayers)
  command -v spirv-val >/dev/null || want+=(spirv-tools)
  command -v cmake >/dev/null || want+=(cmake)
  command -v c++ >/dev/null || want+=(g++)
  command -v make >/dev/null || want+=(make)
  command -v python3 >/dev/null || want+=(python3)
  python3 -c 'import ensurepip' 2>/dev/null || want+=(python3-venv)
fi
driver=
has_driver || driver=mesa-vulkan-drivers
# A driver that is there stays as it is; the tests' is to have ray query, which Mesa's for the processor has since 24.1.
mesa=$(dpkg-query -W -f '${Version}' mesa-vulkan-drivers 2>/dev/null || true)
if [ "$mode" != run ] && [ -n "$mesa" ] && dpkg --compare-versions "$mesa" lt 24.1; then
  say "mesa-vulkan-drivers $mesa has no ray query: tests of it will fail. On Debian 12, with bookworm-backports among apt's"
  say "sources: apt-get install -t bookworm-backports mesa-vulkan-drivers"
fi
# Root's own apt-get, or sudo's where that asks nothing.
apt_quietly() {
  local as=()
  [ "$(id -u)" = 0 ] || as=(sudo -n)
  "${as[@]}" env DEBIAN_FRONTEND=noninteractive apt-get "$@" >/dev/null 2>&1
}
# Whether Debian's packages are known here; a fresh machine has no lists of them yet.
knows() {
  command -v apt-get >/dev/null || return 1
  apt-cache show "$1" >/dev/null 2>&1 && return
  grep -qs '^ID=debian' /etc/os-release && apt_quietly update -qq && apt-cache show "$1" >/dev/null 2>&1
}
# Debian has each of these packages: there a missing one is a source out of reach.
missing() {
  if grep -qs '^ID=debian' /etc/os-release; then lacks "$*"; else say "$*"; fi
}
# A second driver shows what the first one forgives: SwiftShader, two files out of Debian's package
# chromium-common, in target/second-driver, where only the tests look. Nothing is installed.
second_driver() {
  local into package=chromium-common
  into=$(cd "$(dirname "$0")/.." && pwd)/target/second-driver
  [ -s "$into/vk_swiftshader_icd.json" ] && return
  if ! command -v dpkg-deb >/dev/null || ! knows "$package"; then
    missing "no package $package (Debian has it): tests on a second driver are skipped"
    return
  fi
  say "unpacking SwiftShader, the tests' second driver, from $package into $into"
  rm -rf "$into"
  mkdir -p "$into/package"
  if ! (cd "$into/package" && apt-get download -qq "$package" 2>log && dpkg-deb --fsys-tarfile ./*.deb |
    tar -x -C "$into" --wildcards --transform='s,.*/,,' '*vk_swiftshader*') || [ ! -s "$into/vk_swiftshader_icd.json" ]; then
    lacks "SwiftShader, out of the package $package ($(tail -n 1 "$into/package/log")): tests on a second driver are skipped"
    rm -f "$into/vk_swiftshader_icd.json"
  fi
  rm -rf "$into/package"
}

# Debian's packages that only tests need and that other systems have in other forms: where they cannot be had, the
# tests that need them are skipped.
for_tests() {
  local what=$1 && shift
  if ! grep -qs '^ID=debian' /etc/os-release || ! knows "$1"; then
    missing "no package $1: $what are skipped"
    return
  fi
  say "installing $*, for $what"
  apt_quietly install -y -qq --no-install-recommends "$@" || lacks "the packages $*: $what are skipped"
}
tests_only() {
  [ "$mode" = run ] && return
  second_driver
  # The form of a user study is filled in by a browser. Ubuntu's package is a snap, which needs a daemon.
  if ! command -v chromedriver >/dev/null || ! command -v chromium chromium-browser google-chrome >/dev/null; then
    for_tests "tests in a browser" chromium chromium-driver
  fi
  # By this name chromedriver speaks to its browser; every installed system has it, a bare tree may not.
  if ! getent hosts localhost >/dev/null; then
    say "adding localhost to /etc/hosts"
    if [ "$(id -u)" = 0 ]; then echo "127.0.0.1 localhost" >>/etc/hosts; else echo "127.0.0.1 localhost" | sudo -n tee -a /etc/hosts >/dev/null; fi ||
      lacks "the name localhost in /etc/hosts: tests in a browser fail"
  fi
  command -v ffmpeg >/dev/null || for_tests "tests of MP4 films" ffmpeg
}

if [ ${#want[@]} -eq 0 ] && [ -z "$driver" ]; then
  tests_only
  exit 0
fi

. /etc/os-release 2>/dev/null || true
case " ${ID:-} ${ID_LIKE:-} " in
  *" debian "*|*" ubuntu "*) command -v apt-get >/dev/null || manual "no apt-get on ${PRETTY_NAME:-this system}" ;;
  *) manual "this script knows Debian and Ubuntu, not ${PRETTY_NAME:-this system}; missing: ${want[*]} $driver" ;;
esac
if [ "$(id -u)" = 0 ]; then sudo=(); else
  command -v sudo >/dev/null || manual "needs root to install: ${want[*]} $driver"
  sudo=(sudo)
fi
apt() { "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get "$@" -qq >/dev/null; }

say "apt-get update"
apt update
if [ ${#want[@]} -gt 0 ]; then
  say "installing ${want[*]}"
  apt install -y --no-install-recommends "${want[@]}"
fi
if [ -n "$driver" ]; then
  # Debian 12's own Mesa has no ray query; its backports have. The line is derived from the
  # machine's own entry, so that mirror and keyring stay the owner's choice.
  target=()
  if [ "${VERSION_CODENAME:-}" = bookworm ] && ! apt-cache policy | grep -q bookworm-backports; then
    entry=/etc/apt/sources.list.d/insonify-backports
    if source=$(grep -lsE '^Suites:.*\bbookworm\b' /etc/apt/sources.list.d/*.sources | head -n 1) && [ -n "$source" ]; then
      uri=$(sed -nE 's/^URIs: *([^ ]+).*/\1/p' "$source" | head -n 1)
      key=$(sed -nE 's/^(Signed-By: .*)/\1/p' "$source" | head -n 1)
      say "adding bookworm-backports ($entry.sources) for a Mesa with ray query"
      printf 'Types: deb\nURIs: %s\nSuites: bookworm-backports\nComponents: main\n%s\n' "$uri" "$key" | "${sudo[@]}" tee "$entry.sources" >/dev/null
      added=$entry.sources
    elif line=$(grep -hsE '^deb (\[[^]]*\] )?[^ ]+ bookworm ' /etc/apt/sources.list /etc/apt/sources.list.d/*.list | head -n 1) && [ -n "$line" ]; then
      say "adding bookworm-backports ($entry.list) for a Mesa with ray query"
      printf '%s\n' "$line" | sed -E 's/ bookworm .*/ bookworm-backports main/' | "${sudo[@]}" tee "$entry.list" >/dev/null
      added=$entry.list
    fi
    if [ -n "${added:-}" ] && ! apt update; then
      say "the mirror has no bookworm-backports; taking $added back (the compute tracer works without)"
      "${sudo[@]}" rm -f "$added"
      apt update
    fi
  fi
  if apt-cache policy 2>/dev/null | grep -q bookworm-backports; then target=(-t bookworm-backports); fi
  say "no Vulkan driver found: installing Mesa's, among them the software driver lavapipe"
  apt install -y --no-install-recommends "${target[@]}" mesa-vulkan-drivers
fi
tests_only
