#!/bin/sh
# One shard of a Monte Carlo study, or the merge of all: see README.md.
#
#     shard.sh INDEX COUNT
#     shard.sh merge COUNT
set -eu

out=${OUT:-study}
mkdir -p "$out"

study() {
    "${COAXDESIGN:-coaxdesign}" montecarlo "${DESIGN:?the directory of a design}" \
        --maneuver "${MANEUVER:-accel-decel}" --runs "${RUNS:-200}" --seed "${SEED:-0}" --quiet "$@"
}

if [ "$1" = merge ]; then
    # Fails where a shard lacks runs.
    set -- $(seq 0 $(($2 - 1)) | sed "s|.*|$out/shard-&.jsonl|")
    study --merge "$@" --output "$out/runs.jsonl"
else
    study --shard "$1/$2" --output "$out/shard-$1.jsonl" >"$out/shard-$1.txt"
fi
