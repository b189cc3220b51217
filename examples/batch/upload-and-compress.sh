#!/bin/sh
# Compresses every file of a directory with a wavelume service, and fetches the materials.
#
#   upload-and-compress.sh http://127.0.0.1:8080 scans materials [manifest.tsv]
#
# writes materials/NAME.wlm for each file. Killed at any point and started again, it uploads no file and queues no job
# twice. A line of the manifest has three columns with tabs between them: the name of a file, how to read it (the query
# string of POST /v1/measurements, percent-encoded), and the request (the JSON of POST /v1/jobs without "measurement"):
#
#   scan 1.csv	quantity=reflectance&column=2	{"target": {"er_l2": 0.005}, "name": "Red tile"}
#
# An empty column, or no line, means no options and the request in $REQUEST. A changed file or line is done anew.
# materials/.batch/NAME.job has the key and the job of a file. Needed: curl 7.87 or newer, awk, sha256sum or shasum.
# Exit code 0: every file has its material. 1: some have none, each with a line on stderr. 2: the work could not begin.

[ $# -ge 3 ] || { sed -n '2,/^$/s/^# \{0,1\}//p' "$0" >&2; exit 2; }
api=${1%/}/v1 from=$2 to=$3 manifest=${4:-/dev/null} state=$3/.batch part=$3/.batch/part all=0 failed=0
standard=${REQUEST:-'{"target": {"er_l2": 0.01}, "priority": 1}'} sha256=$(command -v sha256sum || echo shasum -a 256)
# Prints a column of the line that the manifest has for this file.
column() { name=$name awk -F '\t' -v n="$1" '{ sub(/\r$/, "") } $1 "" == ENVIRON["name"] { print $n; exit }' "$manifest"; }
# Makes one request, and repeats it while the service is busy or restarts.
ask() { answer=$(curl -gsS --fail-with-body --retry 999 --retry-max-time 900 --retry-connrefused "$@" 2>&1); }
# Prints the strings that an answer has under a key, as they stand in the JSON.
text() { printf '%s\n' "$answer" | grep -oE "\"$1\":\"([^\"\\\\]|\\\\.)*" | sed 's/^[^:]*:"//'; }
fail() { printf '%s: %s\n' "$name" "$({ printf '%s\n' "$answer"; text detail; } | tail -n 1)" >&2; failed=$((failed + 1)); }

# The service ignores the query of /healthz; a curl that is too old stops at it.
{ (cd "$from") && cat "$manifest" && mkdir -p "$state" && curl -sSf --url-query q "${1%/}/healthz"; } >/dev/null || exit 2
# After 2 s the service has stored or dropped what a killed start was sending.
exec 9>"$state/lock"; flock 9 2>/dev/null; sleep 2
for file in "$from"/*; do
  name=${file##*/}; [ -f "$file" ] || continue; all=$((all + 1))
  options=$(column 2) request=$(column 3 | grep . || printf '%s\n' "$standard")
  upload=batch-$({ printf '%s\n' "$options"; cat "$file"; } | $sha256 | cut -c 1-64)
  key=$upload-$(printf '%s\n' "$request" | $sha256 | cut -c 1-64)
  if grep -qs "^$key " "$state/$name.job"; then continue; else rm -f "$to/$name.wlm" "$state/$name.job"; fi
  ask "$api/measurements?q=$upload" &&
    { [ "$(text id)" ] || ask -X POST -T "$file" --url-query "filename=$name" "$api/measurements?name=$upload&$options"; } &&
    ask --json "{\"measurement\":\"$(text id)\",${request#*\{}" -H "idempotency-key: $key" "$api/jobs" &&
    echo "$key $(text id)" >"$state/$name.job" || fail
done
for file in "$from"/*; do
  name=${file##*/}; [ -e "$state/$name.job" ] && [ ! -e "$to/$name.wlm" ] || continue
  while ask "$api/jobs/$(cut -d ' ' -f 2 "$state/$name.job")" && text state | grep -qE 'queued|running'; do sleep 1; done
  [ "$(text material)" ] && ask -o "$part" "$api/materials/$(text material)/content" && mv "$part" "$to/$name.wlm" || fail
done
echo "$((all - failed)) compressed, $failed failed"; [ "$failed" -eq 0 ]
