#!/bin/sh
# Submits a picture as an array of parts and a merge that waits for all of them; prints the number of the merge job.
#
#     submit.sh TASKS SAMPLES FOLDER WHOLE.exr [options of `canted render`, the scene among them]
set -eu
tasks=$1
samples=$2
folder=$3
whole=$4
shift 4
here=$(dirname "$0")
mkdir -p "$folder"
array=$(sbatch --parsable --array="0-$((tasks - 1))" "$here/part.sh" "$tasks" "$folder" "$samples" "$@")
# A merge whose parts failed would wait for good.
sbatch --parsable --dependency="afterok:$array" --kill-on-invalid-dep=yes "$here/merge.sh" "$folder" "$whole"
