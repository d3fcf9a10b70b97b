#!/bin/sh
# Flies a study as an array of Slurm jobs, and merges it after them: see
# README.md. Further arguments, such as --partition=NAME, go to sbatch.
set -eu

here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
shards=${SHARDS:-8}
mkdir -p "${OUT:-study}"

# A job that ends early, for example at its time limit, is put into the queue
# again by Slurm where the site allows it, and flies what is missing.
array=$(sbatch --parsable --export=ALL --array="0-$((shards - 1))" --cpus-per-task=1 --requeue \
    --job-name=coaxdesign --output="${OUT:-study}/slurm-%a.log" "$@" <<JOB
#!/bin/sh
export RAYON_NUM_THREADS="\${SLURM_CPUS_PER_TASK:-1}"
exec sh "$here/shard.sh" "\$SLURM_ARRAY_TASK_ID" $shards
JOB
)
merge=$(sbatch --parsable --export=ALL --dependency="afterok:${array%%;*}" --cpus-per-task=1 \
    --job-name=coaxdesign-merge --output="${OUT:-study}/merge.txt" "$@" <<JOB
#!/bin/sh
exec sh "$here/shard.sh" merge $shards
JOB
)
echo "array ${array%%;*}, merge ${merge%%;*}: ${OUT:-study}/runs.jsonl"
