#!/bin/bash
# A data set made by a Slurm array job: one shard a task. What is stopped - by time or by a node - goes on when the
# job is queued again, and the set is the same bytes whoever made what.
#   sbatch --array=0-31 --time=04:00:00 --requeue slurm_dataset.sh plan.toml /shared/set
# A GPU a task: add --gres=gpu:1. The program is `insonify` on the PATH, or what INSONIFY names.
set -eu
plan=${1:?usage: sbatch --array=0-N slurm_dataset.sh PLAN.toml FOLDER}
folder=${2:?usage: sbatch --array=0-N slurm_dataset.sh PLAN.toml FOLDER}
# Arrays may begin at another number and leave numbers out: a shard is the place in a full array.
shard=$((SLURM_ARRAY_TASK_ID - SLURM_ARRAY_TASK_MIN))
if [ $((SLURM_ARRAY_TASK_MAX - SLURM_ARRAY_TASK_MIN + 1)) != "$SLURM_ARRAY_TASK_COUNT" ]; then
  echo "slurm_dataset.sh: the array has gaps; give it like --array=0-31" >&2
  exit 2
fi
exec "${INSONIFY:-insonify}" dataset "$plan" -o "$folder" --shard "$shard/$SLURM_ARRAY_TASK_COUNT" --resume
