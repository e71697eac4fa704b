#!/bin/sh
# with_display.sh COMMAND...: runs it beside a screen of its own that nobody sees (Xvfb); its exit code. 3: there is no Xvfb.
# -noreset: else the server begins anew whenever its last client goes, and who comes just then finds none.
set -eu
command -v Xvfb > /dev/null || { echo "with_display.sh: Xvfb is missing (apt-get install xvfb)" >&2; exit 3; }
scratch=$(mktemp -d)
trap 'kill "$server" 2> /dev/null || true; rm -rf "$scratch"' EXIT
mkfifo "$scratch/display"
Xvfb -displayfd 9 -screen 0 1280x1024x24 -nolisten tcp -noreset 9> "$scratch/display" > /dev/null 2>&1 &
server=$!
read -r number < "$scratch/display"
code=0
DISPLAY=":$number" "$@" || code=$?
exit $code
