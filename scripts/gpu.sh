#!/bin/sh
# Times fields on this machine's graphics adapter and writes a table: gpu.md, or the file named first. The second argument is
# the adapter's memory bandwidth in GB/s, from its data sheet: then the table has the share that was reached at least.
#
# A line is a mesh, or a batch of scenes: time of a frame, launches, bytes sent, received and moved on the device.
set -eu
cd "$(dirname "$0")/.."
out=${1:-gpu.md}
peak=${2:-}
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! cargo bench --bench gpu > "$log" 2>&1; then
    cat "$log" >&2
    exit 1
fi
{
    echo '| scene | a frame | on the device | adapter | share of memory bandwidth |'
    echo '|---|---|---|---|---|'
    grep -E '^[0-9].*(launches|skipped)' "$log" | awk -v peak="$peak" '{
        rate = match($0, /[0-9]+ GB\/s/) ? substr($0, RSTART, RLENGTH) + 0 : 0
        share = peak && rate ? sprintf("%.0f %%", 100 * rate / peak) : "-"
        sub(/: /, " | ")
        gsub(/; /, " | ")
        print "| " $0 " | " share " |"
    }'
} > "$out"
cat "$out"
