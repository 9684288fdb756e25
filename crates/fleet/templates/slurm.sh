# Slurm: an array job, and the merge behind it whatever became of the tasks (`afterok` would wait for ever behind a failed one).
#states: squeue --noheader --array --format=%T --jobs="$WORK"
set -eu
partition=${PARTITION:+--partition=$PARTITION}
work=$(sbatch --parsable --export=ALL --job-name="$NAME" --array="$ARRAY${AT_ONCE:+%$AT_ONCE}" --time="$MINUTES" \
    --nodes=1 --ntasks=1 --cpus-per-task="$CPUS" --mem="${MEMORY_MB}M" --output="$LOGS/work-%A_%a.txt" $partition <<'TASK'
#!/bin/sh
exec sh "$TASK" "$SLURM_ARRAY_TASK_ID"
TASK
)
echo "work ${work%%;*}"
merge=$(sbatch --parsable --export=ALL --job-name="$NAME-merge" --dependency="afterany:${work%%;*}" --time=60 \
    --nodes=1 --ntasks=1 --cpus-per-task=1 --mem=512M --output="$LOGS/merge-%j.txt" $partition <<'MERGE'
#!/bin/sh
exec sh "$MERGE"
MERGE
)
echo "merge ${merge%%;*}"
