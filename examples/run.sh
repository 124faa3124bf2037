#!/usr/bin/env bash
# Runs an example, culled and unculled, and prints the comparison: examples/run.sh [NAME [OPTION...]], default impact.
# Installs what is missing and builds first. What it leaves: examples/NAME/out/.
# Exit status: 0 it ran and nothing is lost (the table names what is outside its margin), 1 a granule is lost, 2 no result.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
name=${1:-impact}
if [ ! -f "$here/$name/example.py" ]; then
  echo "run.sh: no example '$name'; there is: $(cd "$here" && ls */example.py | sed 's,/.*,,' | tr '\n' ' ')" >&2
  exit 2
fi
"$here/../scripts/prepare.sh" liggghts-solidcull
exec /usr/bin/python3 "$here/$name/example.py" "${@:2}"
