#!/bin/sh
#SBATCH --job-name=canted-merge
# Merges the parts written by a job array of part.sh.
#
#     sbatch --dependency=afterok:ARRAY merge.sh FOLDER OUTPUT.exr
set -eu
folder=$1
output=$2
exec canted merge "$folder"/*.exr --output "$output"
