#!/usr/bin/env bash
# A run of aogauge on a Slurm cluster: an array of shards, and a job that merges them.
#
#   ./slurm.sh SUITE DIR SHARDS [AT_ONCE]      ./slurm.sh thin-occluders /scratch/ao 8 4
#
# DIR must be seen by all nodes, SUITE is a built-in suite or a file that all nodes see.
# The same command again does what is missing, and merges. The merge's exit code is the
# verdict: sacct -j JOB, or the end of DIR/merge.log.
#SBATCH --job-name=aogauge
#SBATCH --time=60
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:USR1@60
set -euo pipefail

suite=$1 dir=$2 shards=$3

if [ -z "${SLURM_JOB_ID-}" ]; then # on the login node
    mkdir -p "$dir"
    array=$(sbatch --parsable --array="0-$((shards - 1))%${4:-$shards}" --output="$dir/shard-%a.log" "$0" "$suite" "$dir" "$shards")
    # After any end: the merge says which shards are missing or failed.
    merge=$(sbatch --parsable --dependency="afterany:$array" --output="$dir/merge.log" "$0" "$suite" "$dir" "$shards")
    echo "shards $array, merge $merge"
    exit
fi

if [ -z "${SLURM_ARRAY_TASK_ID-}" ]; then
    exec aogauge merge "$dir/shards-$shards" --out "$dir/record"
fi

# Slurm sends USR1 a minute before the time is up, and TERM on preemption and scancel.
# Either way aogauge ends in good order. After preemption Slurm itself starts the
# task again; when the time is up the task asks for it, and goes on where it ended.
is_late='' signalled=yes
# shellcheck disable=SC2329 # called by the traps
stop() {
    signalled=yes
    kill -TERM "$aogauge" 2> /dev/null || true
}
trap 'is_late=yes; stop' USR1
trap stop TERM
aogauge run "$suite" --shard auto --threads "$SLURM_CPUS_PER_TASK" --out "$dir/shards-$shards/$SLURM_ARRAY_TASK_ID" &
aogauge=$!
while [ -n "$signalled" ]; do
    signalled='' code=0
    wait "$aogauge" || code=$?
    [ "$code" -gt 128 ] || break # above, a signal ended the wait, or aogauge
done
if [ "$code" = 5 ] && [ -n "$is_late" ] && [ "${SLURM_RESTART_COUNT:-0}" -lt 20 ]; then
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit "$code"
