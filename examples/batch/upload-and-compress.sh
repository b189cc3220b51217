#!/bin/sh
# Compresses every file of a directory with a wavelume service, and fetches the materials.
#
#   upload-and-compress.sh http://127.0.0.1:8080 scans materials [manifest.tsv]
#
# uploads each file of scans/, queues a job for it, waits, and writes materials/NAME.wlm. Kill it at any point and start
# it again: it uploads no file twice, queues no job twice, and keeps what is there. A file or a line of the manifest
# that has changed is done anew. Each service needs an output directory of its own.
#
# A line of the manifest has up to three columns with tabs between them: the name of a file, how to read it (the query
# string of POST /v1/measurements, percent-encoded), and the request (the JSON of POST /v1/jobs without "measurement"):
#
#   scan 1.csv	quantity=reflectance&column=2	{"target": {"er_l2": 0.005}, "name": "Red tile"}
#
# A file without a line, or an empty column, gets no options and the request in $REQUEST, {"target": {"er_l2": 0.01},
# "priority": 1}.
#
# Exit code 0: every file has its material. 1: some have none, each with one line on stderr. 2: the work could not
# begin.
#
# It needs curl 7.66 or newer, awk, and sha256sum or shasum. Answers of 429 and 503 are repeated after the time in their
# Retry-After, and a service that restarts is waited for. Where flock is installed, a second start waits for the first
# one, and for an upload that a killed one has left running.
#
# materials/.batch/notes/NAME is one line for each file: a key (the digest of its bytes, options and request), the job,
# and, once materials/NAME.wlm is in place, the material. Notes and materials appear by renaming, whole or not at all. A
# kill between an answer and its note loses the note, so the service is asked: an upload is named batch-DIGEST, and a
# file is sent only if no measurement has that name; a job has the key as its Idempotency-Key, to which the service
# answers with the same job for a day. A file that is refused for what it is (400, 413, 415, 422) is not sent again
# until its note is deleted. Not covered: bytes that the service had before under another name keep that name, and may
# be sent again after such a kill.
#
# Without a JSON parser, grep finds "id":"…" in an answer. That is safe: the service writes no white space between
# tokens, and a quote inside a JSON string has a backslash before it, so these characters are always a key and its
# value.
set -u
[ $# -ge 3 ] || { sed -n '2,/^set/{/^set/!s/^# \{0,1\}//p}' "$0" >&2; exit 2; }
service=${1%/} from=$2 to=$3 manifest=${4:-/dev/null} standard=${REQUEST:-'{"target": {"er_l2": 0.01}, "priority": 1}'}
state=$to/.batch tab=$(printf '\t') done=0 failed=0
note() { printf '%s\n' "$*" >"$state/new" && mv "$state/new" "$state/notes/$name"; }
fail() { printf '%s: %s\n' "$name" "$reason" >&2 && failed=$((failed + 1)); }
digest() { { sha256sum 2>/dev/null || shasum -a 256; } | cut -c 1-64; }
# Prints the first string under a key of the answer.
text() { grep -oE "\"$1\":\"([^\"\\\\]|\\\\.)*\"" "$state/answer" | sed -n "1s/^\"$1\":\"\(.*\)\"\$/\1/p"; }
# Makes one request; leaves its answer in a file, and the reason if its status is not 2xx.
ask() {
  : >"$state/answer"
  code=$(curl -gsS --connect-timeout 20 --retry 99 --retry-max-time 900 --retry-connrefused \
    -o "$state/answer" -w '%{http_code}' "$@" 2>"$state/error")
  case $?/$code in 0/2*) return ;; 7/*) echo "$service does not answer; start this again to go on" >&2; exit 1 ;; esac
  reason=$(text detail)
  reason=${reason:-"status $code $(tail -n 1 "$state/error")"}
  return 1
}
# Finds or makes the measurement and the job of a file, and notes the job.
queue() {
  ask "$service/v1/measurements?q=batch-$upload" || return 1
  if [ -z "$(text id)" ]; then
    encoded=$(printf %s "$name" | od -An -v -tx1 | tr -d ' \n' | sed 's/../%&/g')
    ask --data-binary "@$file" "$service/v1/measurements?filename=$encoded&name=batch-$upload${options:+&$options}" ||
      case $code in 400 | 413 | 415 | 422) note "$key refused $reason" && return ;; *) return 1 ;; esac
  fi
  id=$(text id) reason="an archive of several measurements; unpack it first"
  [ "$(grep -o '"id":"b3-' "$state/answer" | wc -l)" -eq 1 ] || { note "$key refused $reason" && return; }
  body=$(printf %s "$request" | sed "s/^ *{/{\"measurement\":\"$id\",/")
  ask -H 'content-type: application/json' -H "idempotency-key: batch-$key" --data-raw "$body" "$service/v1/jobs" &&
    note "$key $(text id)"
}
# Waits for the job of a file, and puts its material in place.
fetch() {
  while ask "$service/v1/jobs/$job" || return 1; do
    case $(text state) in queued | running) sleep 1 ;; *) break ;; esac
  done
  material=$(text material) reason="job $job $(text state): $(text detail)"
  [ -n "$material" ] && ask "$service/v1/materials/$material/content" && mv "$state/answer" "$to/$name.wlm" &&
    note "$key $job $material"
}

{ curl -sSf -o /dev/null "$service/healthz" && [ -d "$from" ] && [ -r "$manifest" ] && mkdir -p "$state/notes"; } || exit 2
exec 9>"$state/lock"
if command -v flock >/dev/null; then flock 9; fi
[ ! -e "$state/running" ] || sleep 2 # By then the service has stored or dropped what a killed start was sending.
: >"$state/running"
for file in "$from"/*; do
  [ -f "$file" ] || continue
  name=${file##*/}
  columns=$(name=$name awk -F '\t' '{ sub(/\r$/, "") } $1 "" == ENVIRON["name"] { print $2 "\t" $3; exit }' "$manifest")
  options=${columns%%"$tab"*} request=${columns#*"$tab"}
  request=${request:-$standard} upload=$({ cat "$file" && printf '\n%s' "$options"; } | digest)
  key=$(printf '%s\n' "$upload" "$request" | digest)
  case $(cat "$state/notes/$name" 2>/dev/null) in "$key "*) ;; *) rm -f "$state/notes/$name" && { queue || fail; } ;; esac
done
for file in "$from"/*; do
  name=${file##*/}
  [ -s "$state/notes/$name" ] || continue
  read -r key job material <"$state/notes/$name"
  if [ "$job" = refused ]; then reason=$material && fail
  elif { [ -n "$material" ] && [ -s "$to/$name.wlm" ]; } || fetch; then done=$((done + 1))
  else fail; fi
done
rm -f "$state/running"
echo "$done compressed, $failed failed"
[ "$failed" -eq 0 ]
