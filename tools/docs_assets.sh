#!/bin/sh
# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

# Copies the assets of the documentation into build/docs_assets: the style sheet and fonts of
# KaTeX, and the script of Mermaid. With them the site needs no network.
# The version of KaTeX must be that of the script in sphinxcontrib-katex (constraints.txt).
set -eu
cd "$(dirname "$0")/.."
KATEX=0.16.22
MERMAID=11.17.2
for program in node npm; do
    if ! command -v "$program" >/dev/null; then
        echo "make docs needs $program (Debian, Ubuntu: apt install nodejs npm)." >&2
        exit 1
    fi
done
target=$PWD/build/docs_assets
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
(
    cd "$folder"
    npm pack --silent "katex@$KATEX" "mermaid@$MERMAID" >/dev/null
    mkdir katex mermaid
    tar xzf "katex-$KATEX.tgz" -C katex --strip-components=1
    tar xzf "mermaid-$MERMAID.tgz" -C mermaid --strip-components=1 \
        package/LICENSE package/dist/mermaid.min.js
)
rm -rf "$target"
mkdir -p "$target/katex/fonts" "$target/mermaid"
cp "$folder/katex/LICENSE" "$folder/katex/dist/katex.min.css" "$target/katex/"
cp "$folder/katex/dist/fonts/"*.woff2 "$target/katex/fonts/"
cp "$folder/mermaid/LICENSE" "$folder/mermaid/dist/mermaid.min.js" "$target/mermaid/"
