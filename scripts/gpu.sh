#!/bin/sh
# Times fields on this machine's graphics adapter and writes a table: gpu.md, or the file named.
#
# A line is a mesh, or a batch of scenes: time of a frame, launches, bytes sent, received and moved on the device, and the
# bandwidth that takes at least. Divide it by that of the adapter's data sheet for the share that was reached.
set -eu
cd "$(dirname "$0")/.."
out=${1:-gpu.md}
lines=$(cargo bench --bench gpu 2>&1 | grep -E '^[0-9].*(launches|skipped)')
{
    echo '| scene | what a frame takes | on the device |'
    echo '|---|---|---|'
    echo "$lines" | sed -e 's/^/| /' -e 's/: / | /' -e 's/; / | /' -e 's/$/ |/'
} > "$out"
cat "$out"
