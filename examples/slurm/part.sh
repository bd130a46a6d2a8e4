#!/bin/sh
#SBATCH --job-name=canted-part
#SBATCH --requeue
# One task of a job array: renders its range of the samples of an image.
#
#     sbatch --array=0-7 part.sh 8 FOLDER SAMPLES [scene and options of `canted render`]
#
# Merging gives the same bytes for any split. An interrupted task resumes from its checkpoint when it is restarted.
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
