#!/bin/sh
# The groups of a job as an array of Slurm, without Snakemake:
#
#     sbatch --array=0-7 docs/workflow/array.sh /data/job
#
# Group K is task K; a task that is started again goes on.
#SBATCH --cpus-per-task=2
#SBATCH --mem=2000
#SBATCH --requeue
exec "${MBA:-mba}" map "$1" --submap "$SLURM_ARRAY_TASK_ID" --threads "${SLURM_CPUS_PER_TASK:-1}" --quiet
