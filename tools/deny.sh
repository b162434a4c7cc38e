#!/usr/bin/env bash
# Licences, sources and known holes of all packages, by the rules of deny.toml: where cargo-deny is there, and for the holes
# the list of advisories, from the network or from an earlier run. `tools/deny.sh --offline` asks nobody.
set -eu
cd "$(dirname "$0")/.."
if ! cargo deny --version >/dev/null 2>&1; then
  echo 'skipped: licences and advisories, no cargo-deny (cargo install --locked cargo-deny)'
  exit 0
fi
offline=
[ "${1:-}" != --offline ] || offline=--offline
cargo deny $offline check licenses sources bans
if [ -z "$offline" ] && ! cargo deny fetch db 2>/dev/null; then
  offline=--offline
fi
if [ -n "$offline" ] && ! compgen -G "${CARGO_HOME:-$HOME/.cargo}/advisory-dbs/*/" >/dev/null; then
  echo 'skipped: advisories, whose list was never fetched and cannot be now'
  exit 0
fi
cargo deny $offline check advisories
