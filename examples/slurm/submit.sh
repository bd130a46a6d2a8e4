#!/bin/sh
# Submits a job array that renders an image in parts, and a dependent merge job; prints the id of the merge job.
#
#     submit.sh TASKS SAMPLES FOLDER OUTPUT.exr [scene and options of `canted render`]
set -eu
tasks=$1
samples=$2
folder=$3
output=$4
shift 4
here=$(dirname "$0")
mkdir -p "$folder"
array=$(sbatch --parsable --array="0-$((tasks - 1))" "$here/part.sh" "$tasks" "$folder" "$samples" "$@")
# Without --kill-on-invalid-dep the merge would wait forever if a part fails.
sbatch --parsable --dependency="afterok:$array" --kill-on-invalid-dep=yes "$here/merge.sh" "$folder" "$output"
