# Slurm: an array job, and the merge behind it whatever became of the tasks (`afterok` would wait for ever behind a failed one).
#states: squeue --noheader --array --format=%T --jobs="$WORK"
set -eu
partition=${PARTITION:+--partition=$PARTITION}
# The job ID: the last line, since a site may greet first; without the cluster's name behind it.
id() {
    id=$(printf '%s\n' "$1" | tail -n 1)
    id=${id%%;*}
    case $id in
    '' | *[!0-9]*) echo "sbatch printed no job ID but: $1" >&2 && exit 1 ;;
    esac
}
work=$(sbatch --parsable --export=ALL --job-name="$NAME" --array="$ARRAY${AT_ONCE:+%$AT_ONCE}" --time="$MINUTES" \
    --nodes=1 --ntasks=1 --cpus-per-task="$CPUS" --mem="${MEMORY_MB}M" --output="$LOGS/work-%A_%a.txt" $partition <<'TASK'
#!/bin/sh
exec sh "$TASK" "$SLURM_ARRAY_TASK_ID"
TASK
)
id "$work"
echo "work $id"
merge=$(sbatch --parsable --export=ALL --job-name="$NAME-merge" --dependency="afterany:$id" --time=60 \
    --nodes=1 --ntasks=1 --cpus-per-task=1 --mem=512M --output="$LOGS/merge-%j.txt" $partition <<'MERGE'
#!/bin/sh
exec sh "$MERGE"
MERGE
)
id "$merge"
echo "merge $id"
