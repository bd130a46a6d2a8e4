#!/bin/sh
#SBATCH --job-name=canted-part
#SBATCH --requeue
# One task of a job array: it renders its share of the samples of a picture.
#
#     sbatch --array=0-7 part.sh 8 FOLDER SAMPLES [options of `canted render`, the scene among them]
#
# The shares need not be equal: merging gives the same bytes for any split. A task that was preempted or ran out of
# time goes on from its checkpoint when it is started again.
set -eu
tasks=$1
folder=$2
samples=$3
shift 3
task=$SLURM_ARRAY_TASK_ID
first=$((samples * task / tasks))
last=$((samples * (task + 1) / tasks))
exec canted render "$@" --device cpu --samples "$first..$last" --threads "${SLURM_CPUS_PER_TASK:-1}" \
    --checkpoint "$folder/$task.checkpoint" --output "$folder/$task.exr"
