#!/usr/bin/env bash
# A Slurm array: task i of n renders every n-th picture.  The tasks share a folder and nothing else; a task that was ended is
# submitted again and goes on where it was (--resume).
#
#   sbatch assets/examples/many_machines/slurm_array.sh SCAN CAMERAS OUT
#
# Without Slurm the same tasks run one after the other: `bash slurm_array.sh SCAN CAMERAS OUT`.
#SBATCH --job-name=pointglass
#SBATCH --array=0-15
#SBATCH --cpus-per-task=4
#SBATCH --mem=8G
#SBATCH --time=02:00:00
set -euo pipefail
scan=$1 cameras=$2 out=$3
# of the grid, which all tasks build at once where it was not built before: `POINTGLASS_CACHE=OUT.cache pointglass info SCAN`
export POINTGLASS_CACHE=${POINTGLASS_CACHE:-$out.cache}
first=${SLURM_ARRAY_TASK_ID:-0} count=${SLURM_ARRAY_TASK_COUNT:-${TASKS:-2}}
last=$first
[[ -n ${SLURM_ARRAY_TASK_ID:-} ]] || last=$((count - 1))
for ((i = first; i <= last; i++)); do
    pointglass render "$scan" --cameras "$cameras" --out "$out" --shard "$i/$count" --resume ${OPTIONS:-}
done
