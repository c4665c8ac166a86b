#!/bin/bash
# An array of 64 tasks over the recordings under a prefix, then one calibration per sensor:
#
#     pip install stillpoint
#     sbatch slurm.sh s3://bucket/recordings/
#
# Each task takes its part by SLURM_ARRAY_TASK_ID, _COUNT, _MIN and _STEP. Passing trouble (exit code 5) puts the task back
# into the queue, five times at most; what is finished is skipped then. Credentials are those of the environment that it is
# submitted from.
#SBATCH --job-name=stillpoint
#SBATCH --array=0-63%16
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --time=04:00:00
#SBATCH --requeue
#SBATCH --output=stillpoint-%A_%a.log

prefix=${1:?"usage: sbatch slurm.sh s3://bucket/prefix/"}
manifest=manifest-$SLURM_ARRAY_JOB_ID-$SLURM_ARRAY_TASK_ID.jsonl

stillpoint annotate "$prefix" --shard auto --accept-damage --manifest "$manifest"
code=$?
if [ $code -eq 5 ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 5 ]; then
  scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
# Once, when all parts are done:
#     sbatch --dependency=afterany:$SLURM_ARRAY_JOB_ID --wrap "stillpoint merge $prefix --by folder --format json -o fleet.json"
exit $code
