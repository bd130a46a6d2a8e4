#!/bin/sh
#SBATCH --job-name=canted-merge
# Merges the parts that an array of part.sh left in a folder.
#
#     sbatch --dependency=afterok:ARRAY merge.sh FOLDER WHOLE.exr
set -eu
folder=$1
whole=$2
exec canted merge "$folder"/*.exr --output "$whole"
