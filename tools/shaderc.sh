#!/usr/bin/env bash
# Builds the static shaderc library once, in the user's cache, and prints its folder on stdout.
#   export SHADERC_LIB_DIR=$(./tools/shaderc.sh); cargo build --features compile
# Only needed to change kernels: spirv/ is checked in. About ten minutes on two cores, once.
# Debian's own libshaderc-dev does not link (undefined symbols), so it is not used.
set -eu
cd "$(dirname "$0")/.."
version=$(sed -nE '/^name = "shaderc-sys"/{n;s/version = "(.*)"/\1/p}' Cargo.lock)
out=${XDG_CACHE_HOME:-$HOME/.cache}/insonify/shaderc-$version
if [ -s "$out/libshaderc_combined.a" ]; then echo "$out"; exit 0; fi
for tool in cmake c++ python3 make; do
  command -v $tool >/dev/null || { echo "tools/shaderc.sh: needs $tool (Debian: apt-get install cmake g++ python3 make)" >&2; exit 1; }
done
cargo fetch --locked >&2
src=$(ls -d "${CARGO_HOME:-$HOME/.cargo}"/registry/src/*/shaderc-sys-"$version"/build | head -n 1)
work=$out/build
mkdir -p "$work"
echo "building shaderc $version into $out" >&2
cmake -S "$src" -B "$work" -DCMAKE_BUILD_TYPE=Release -DCMAKE_POSITION_INDEPENDENT_CODE=ON \
  -DENABLE_SPVREMAPPER=OFF -DENABLE_GLSLANG_BINARIES=OFF -DSHADERC_SKIP_TESTS=ON -DSHADERC_SKIP_EXAMPLES=ON -DSHADERC_SKIP_COPYRIGHT_CHECK=ON \
  -DSPIRV_SKIP_EXECUTABLES=ON -DSPIRV_WERROR=OFF -DCMAKE_CXX_FLAGS_RELEASE="-O1 -DNDEBUG" >"$out/build.log" 2>&1 \
  && cmake --build "$work" --target shaderc_combined -j "$(nproc)" >>"$out/build.log" 2>&1 \
  || { tail -n 20 "$out/build.log" >&2; echo "tools/shaderc.sh: shaderc did not build; the whole log is $out/build.log" >&2; exit 1; }
mv "$(find "$work" -name libshaderc_combined.a | head -n 1)" "$out/libshaderc_combined.a"
rm -rf "$work"
echo "$out"
