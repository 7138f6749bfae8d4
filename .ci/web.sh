#!/usr/bin/env bash
# Builds the page of `pointglass publish` (viewer/commands/publishing/web) into page/page.js.  Needs node and npm; users do not.
# The first line of the result is the digest of its sources (tests/unit/commands/test_publish_parts.py).
# --check: writes nothing, exits 1 where page.js is not what the sources make.
set -euo pipefail
export LC_ALL=C
cd "$(dirname "$0")/.."
web=viewer/commands/publishing/web page=viewer/commands/publishing/page/page.js made=out/web
mkdir -p "$made"
rm -rf "$made/src"
cp -r "$web"/. "$made"/
cd "$made"
cmp -s package-lock.json node_modules/.lock || { npm ci --no-audit --no-fund --silent; cp package-lock.json node_modules/.lock; }
npx tsc -p .
digest=$(cat package-lock.json package.json tsconfig.json src/*.ts | sha256sum | cut -d' ' -f1)
npx esbuild src/main.ts --bundle --minify --format=iife --target=es2020 --charset=ascii --legal-comments=eof --log-level=warning \
    --banner:js="/* sources $digest */" --outfile=page.js
cd - >/dev/null
if [ "${1:-}" = --check ]; then cmp "$made/page.js" "$page"; else cp "$made/page.js" "$page"; fi
