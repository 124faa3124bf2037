#!/bin/bash
# Strikes the bed of settle.in, or goes on where an earlier job was stopped: sbatch job.sh, as often as it takes.
# Submit it in its own folder. It needs out/bed.restart.
#SBATCH --job-name=strike
#SBATCH --ntasks=4                  # ranks: README.md says how many
#SBATCH --time=04:00:00
#SBATCH --signal=TERM@300           # 300 s before that, LIGGGHTS is told to write a restart file and end
#SBATCH --requeue                   # a job whose node has failed is started again, and goes on
#SBATCH --output=strike.%j.txt
#SBATCH --open-mode=append
set -euo pipefail

program=${SOLIDCULL_LAUNCHER:-liggghts-solidcull}
start=${START:-srun --mpi=pmix --kill-on-bad-exit=1}   # one rank gone: all stop, none waits for it in vain
# start=mpirun                      # where srun does not know this MPI; it gets ranks and nodes of Slurm all the same

# A restart file has its name once it is whole. Until then .part. stands before it: what a killed job left of one goes.
rm -f .part.restart_forced_liggghts_* out/.part.strike.*
for file in restart_forced_liggghts_*.data; do           # written when told to end
  [ -e "$file" ] && mv "$file" "out/strike.${file//[^0-9]/}.restart"
done
files=$(ls out/strike.*.restart 2> /dev/null | sort -V) || true
newest=$(tail -n 1 <<< "$files")
if [ -z "$newest" ]; then
  echo "job.sh: begins with out/bed.restart"
  from=(-log out/strike.log)
else
  echo "job.sh: goes on with $newest"
  head -n -2 <<< "$files" | xargs -r rm -f               # two stay: the newest, and one should it be damaged
  from=(-log "out/strike.on.$(date +%Y%m%d-%H%M%S).log" -var new 0 -var restart "$newest")
fi
exec $start "$program" -in strike.in "${from[@]}" "$@" < /dev/null
