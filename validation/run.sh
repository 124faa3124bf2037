#!/usr/bin/env bash
# Runs the validation cases, unculled and culled, and writes validation/report/: run time against error, one page for all.
#   validation/run.sh [--quick|--full|--production] [--decide|--no-decide] [--report-only] [--keep] [CASE...]       default: --quick, all cases
# Installs what is missing and builds first. After a kill the same command goes on.
# Exit status: 0 the report is written and nothing is lost, 1 a granule is lost, 2 a case failed (one line each).
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
"$here/../scripts/prepare.sh" liggghts-solidcull
cd "$here"
PYTHONPATH=$here/..${PYTHONPATH:+:$PYTHONPATH} exec /usr/bin/python3 -m solidcull_runs.validation.command "$@"
