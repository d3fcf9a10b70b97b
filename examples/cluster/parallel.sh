#!/bin/sh
# Flies a study with GNU parallel, and merges it: see README.md. Further
# arguments go to parallel: --jobs 4, or --sshloginfile FILE --env _ with OUT
# on a file system that all machines share.
set -eu

here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
shards=${SHARDS:-8}
export RAYON_NUM_THREADS="${RAYON_NUM_THREADS:-1}"

# A shard that fails is tried again twice; the first that fails for good ends
# the whole.
seq 0 $((shards - 1)) | parallel --halt soon,fail=1 --retries 3 "$@" sh "$here/shard.sh" {} "$shards"
sh "$here/shard.sh" merge "$shards"
